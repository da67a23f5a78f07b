"""One bit of a log turned over, or a file cut, anywhere: detected, or harmless."""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path

from mcap.opcode import Opcode

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from fault_injection.judging import Judge, Subject, Verdict, WrongAnswerError, contents, copy_of
from fault_injection.sample import COMMITS_A_SEGMENT, make_sample
from semmap_log.store import records as mcap
from semmap_log.store.record_scan import frames

_TEXTS = (Opcode.SCHEMA, Opcode.CHANNEL)

APPEND_AFTER_FLIPS = 16
"""Once in so many flips, the log is not only read but opened for appending."""

Place = tuple[Subject, str, int, int, bool]
"""A log, a file of it, a byte, a bit, and whether it is one of a schema's or a channel's text."""


def flips(plan: Plan) -> Generator[Outcome, None, None]:
    """Flip every bit of a live and of a closed log; of schemas and channels, a bit of each byte.

    (These texts stand twice in each segment, are nine tenths of a small one, and are all alike.)
    """
    yield from flip(plan, subjects(plan), text_bits=1)


def subjects(plan: Plan) -> list[Subject]:
    """Return a live and a closed log of three segments."""
    sample = make_sample(plan.folder / "sample")
    return [
        Subject.of(sample.live, plan.folder, "live"),
        Subject.of(sample.closed, plan.folder, "closed"),
    ]


def flip(
    plan: Plan, logs: list[Subject], *, bits: int = 8, text_bits: int = 8
) -> Generator[Outcome, None, None]:
    """Flip bits of logs, one at a time, and ask what they say.

    Args:
        plan: Its seed says in which order.
        logs: Logs to damage.
        bits: How many of the eight bits of a byte.
        text_bits: The same for bytes of schemas and channels.
    """
    dice = random.Random(plan.seed)
    places = [place for log in logs for place in _places(log, dice, bits, text_bits)]
    dice.shuffle(places)
    for turn, (log, name, at, bit, is_text) in enumerate(places):
        what = f"{name}: bit {bit} of byte {at} flipped"
        path = log.log / name
        in_last = log.places[-1][0] <= at < log.places[-1][1]
        may_lose = int(path == log.files[-1] and in_last)
        with flipped(path, at, bit):
            only = log.judge.quick if is_text else log.judge.some(turn)
            judged = partial(log.judge.judge, log.log, name, may_lose=may_lose, only=only)
            yield log.outcome(plan, what, judged)
            if turn % APPEND_AFTER_FLIPS == 0:
                with copy_of(log.log) as copy:
                    judged = partial(log.judge.judge_appending, copy, name, may_lose=may_lose)
                    yield log.outcome(plan, f"{what}, opened for appending", judged, copy)


def _places(log: Subject, dice: random.Random, bits: int, text_bits: int) -> Iterator[Place]:
    for path in log.files:
        texts = text_bytes(path)
        for at in range(path.stat().st_size):
            is_text = at in texts
            for bit in dice.sample(range(8), text_bits if is_text else bits):
                yield log, path.name, at, bit, is_text


class flipped:  # noqa: N801  # reads as what it is: with flipped(path, at, bit)
    """One bit of a file is wrong as long as this lasts."""

    def __init__(self, path: Path, at: int, bit: int) -> None:
        self._fd = os.open(path, os.O_RDWR)
        self._place = (at, bit)

    def __enter__(self) -> None:
        _turn_over(self._fd, *self._place)

    def __exit__(self, *_: object) -> None:
        _turn_over(self._fd, *self._place)
        os.close(self._fd)


def _turn_over(fd: int, at: int, bit: int) -> None:
    (byte,) = os.pread(fd, 1, at)
    os.pwrite(fd, bytes([byte ^ 1 << bit]), at)


def text_bytes(path: Path) -> set[int]:
    """Return the places of all bytes of a segment's schemas and channels, frames left out."""
    return set(_texts(path.read_bytes()))


def _texts(data: bytes) -> Iterator[int]:
    for opcode, offset, length in frames(data, len(mcap.MAGIC), len(data)):
        if opcode in _TEXTS:
            yield from range(offset + mcap.FRAME.size, offset + length)


GARBAGE_BYTES = 200
APPEND_AFTER_CUTS = 8
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
        if is_last and (not in_head or turn % APPEND_AFTER_CUTS == 0):
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
