"""A file that ends too early, at every byte: bare, or with what a disk puts behind its end."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import semmap_log as sl
from fault_injection.flips import is_live
from fault_injection.judging import Judge, Tally, Verdict, WrongAnswerError, contents, copy_of
from semmap_log.log.scan import open_segment

GARBAGE_BYTES = 200


def cut_everywhere(log: Path, judge: Judge, *, seed: int = 0, step: int = 1) -> Tally:
    """Cut every segment at every byte, with each kind of tail in turn, and read.

    A segment that others follow may not be shortened unseen. Of the last one, whole commits are
    left: exactly those that lie before the cut. (Its head was synced before it got its name: cut
    there, it may as well be refused.)

    Args:
        log: An undamaged log, its last segment live or closed.
        judge: Who knows what it says; of as many commits back as the last segment has.
        seed: Which garbage.
        step: Only every n-th byte, beginning anywhere.
    """
    tally, dice = Tally(), random.Random(seed)
    with copy_of(log) as copy:
        files = sorted(copy.glob("*.mcap"))
        for path in files:
            whole = path.read_bytes()
            ends = _commit_ends(path) if path == files[-1] else []
            for size in range(dice.randrange(step), len(whole), step):
                kind, tail = _tail(dice, tally.tried)
                path.write_bytes(whole[:size] + tail)
                missing = sum(end > size for end in ends[1:])
                tally.count(
                    f"{path.name} cut at {size} {kind}",
                    lambda p=path, m=missing: judge.judge(
                        copy, p.name, may_lose=m, only=judge.quick
                    ),
                )
            path.write_bytes(whole)
    return tally


def cut_and_append(
    log: Path, judge: Judge, *, seed: int = 0, step: int = 1, start: int = 0
) -> Tally:
    """Cut the last segment and open the log to append: exactly the whole commits are left.

    Args:
        log: An undamaged log.
        judge: Who knows what it says; of as many commits back as the last segment has.
        seed: Which garbage.
        step: Only every n-th byte.
        start: The first byte to cut at.
    """
    tally, dice = Tally(), random.Random(seed)
    last = sorted(log.glob("*.mcap"))[-1]
    whole, ends = last.read_bytes(), _commit_ends(last)
    for size in range(start + dice.randrange(step), len(whole), step):
        with copy_of(log) as copy:
            kind, tail = _tail(dice, tally.tried)
            (copy / last.name).write_bytes(whole[:size] + tail)
            missing = sum(end > size for end in ends[1:])
            tally.count(
                f"{last.name} cut at {size} {kind}, appending",
                lambda c=copy, m=missing, h=size < ends[0]: _recover(c, judge, m, in_head=h),
            )
    return tally


def _recover(log: Path, judge: Judge, missing: int, *, in_head: bool) -> Verdict:
    """Open to append twice: the first keeps what is whole, the second changes nothing more."""
    verdict = judge.judge_appending(log, may_lose=missing)
    if verdict is Verdict.REFUSED:
        if not in_head:
            raise WrongAnswerError("a torn tail that is not repaired")
        return verdict
    before = contents(log)
    sl.append(log).close()
    if before != contents(log):
        raise WrongAnswerError("a second opening changed files that the first had left in order")
    return verdict


def _commit_ends(path: Path) -> list[int]:
    """Return where the keyframe's chunk ends, then where each commit's last chunk does."""
    from semmap_log.log.form import COMMIT_CHANNEL, KEYFRAME_CHANNEL
    from semmap_log.log.pages import Page

    segment = open_segment(path)
    ends = []
    for chunk in segment.chunks:
        heads = Page(chunk.records(segment.file), 0, path).heads
        if heads["channel_id"][-1] in (COMMIT_CHANNEL, KEYFRAME_CHANNEL):
            ends.append(chunk.offset + chunk.length)
    return ends


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
