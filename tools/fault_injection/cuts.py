"""A file that ends too early, at every byte: bare, or with what a disk puts behind its end."""

from __future__ import annotations

import random
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from fault_injection.judging import Judge, Verdict, WrongAnswerError, contents, copy_of
from fault_injection.sample import COMMITS_A_SEGMENT, make_sample
from fault_injection.subject import Subject

GARBAGE_BYTES = 200
APPEND_AFTER = 8
"""Once in so many cuts of a last segment's head the log is opened for appending; behind it, always.
"""


def cuts(plan: Plan) -> Generator[Outcome, None, None]:
    """Cut logs at every byte of every segment, each with some kind of tail.

    A live one, a closed one, and a closed one without what tells where it ended.
    """
    sample = make_sample(plan.folder / "sample")
    logs = [
        Subject.of(path, plan.folder, title, last_commits=COMMITS_A_SEGMENT, told=told)
        for title, path, told in (
            ("live", sample.live, True),
            ("closed", sample.closed, True),
            ("untold", sample.closed, False),
        )
    ]
    yield from cut(plan, logs)


def cut(plan: Plan, logs: list[Subject]) -> Generator[Outcome, None, None]:
    """Cut every segment at every byte, with each kind of tail in turn, and ask what the log says.

    A segment that others follow may not be shortened unseen, nor may the last one if a mark
    tells where it ended. Else whole commits are left of it: exactly those that lie before the cut,
    also when the log is then opened for appending. (Its head was synced before it got its name: cut
    there, it may as well be refused.)

    Args:
        plan: Its seed says in which order, and with which tail.
        logs: Logs to damage.
    """
    dice = random.Random(plan.seed)
    known = {log.title: log.is_end_known for log in logs}
    places = [(g, p.name, at) for g in logs for p in g.files for at in range(p.stat().st_size)]
    dice.shuffle(places)
    for turn, (log, name, size) in enumerate(places):
        path = log.log / name
        tail_is, tail = _tail(dice, turn)
        what = f"{name}: cut at byte {size}, {tail_is}"
        whole = path.read_bytes()
        is_last = path == log.files[-1]
        in_head = size < log.places[0][0]
        missing = sum(end > size for _, end in log.places) if is_last else 0
        must_refuse = known[log.title] and missing > 0
        may_lose = 0 if must_refuse else missing
        path.write_bytes(whole[:size] + tail)
        judged = partial(log.judge.judge, log.log, name, may_lose=may_lose, only=log.judge.quick)
        yield log.outcome(plan, what, partial(_refused, judged) if must_refuse else judged)
        if is_last and (not in_head or turn % APPEND_AFTER == 0):
            with copy_of(log.log) as copy:
                judged = partial(_recover, copy, log.judge, missing, in_head=in_head)
                if must_refuse:
                    judged = partial(_refused, partial(log.judge.judge_appending, copy, name))
                yield log.outcome(plan, f"{what}, opened for appending", judged, copy)
        path.write_bytes(whole)


def _refused(judged: Callable[[], Verdict]) -> Verdict:
    """Judge what a mark knows to be longer: whatever is left of it is no answer."""
    verdict = judged()
    if verdict is not Verdict.REFUSED:
        raise WrongAnswerError(f"a closed log was cut: expected an error, got: {verdict.value}")
    return verdict


def _recover(log: Path, judge: Judge, missing: int, *, in_head: bool) -> Verdict:
    """Open to append twice: the first keeps what is whole, the second changes nothing more."""
    verdict = judge.judge_appending(log, may_lose=missing)
    if verdict is Verdict.REFUSED:
        if not in_head:
            raise WrongAnswerError("a torn tail that is not repaired")
        return verdict
    before = contents(log)
    sl.append(log, compact=False).close()
    if before != contents(log):
        raise WrongAnswerError("a second opening changed files that the first had left in order")
    return verdict


def _tail(dice: random.Random, turn: int) -> tuple[str, bytes]:
    """Return what lies behind the cut, in turns: nothing, zeros, garbage, a torn record."""
    zeros = dice.choice((1, 8, 511, 512, 4096, dice.randrange(1, 4097)))
    tails = (
        ("bare", b""),
        (f"with {zeros} zeros", bytes(zeros)),
        ("with garbage", dice.randbytes(GARBAGE_BYTES)),
        ("with half a chunk", b"\x06" + (5000).to_bytes(8, "little") + dice.randbytes(99)),
    )
    return tails[turn % len(tails)]
