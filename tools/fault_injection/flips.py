"""One bit, anywhere in a log, turned over: detected, or harmless."""

from __future__ import annotations

import os
import random
from collections.abc import Generator, Iterator
from functools import partial
from pathlib import Path

from mcap.opcode import Opcode

from fault_injection.fault import Outcome, Plan
from fault_injection.judging import copy_of
from fault_injection.sample import make_sample
from fault_injection.subject import Subject
from semmap_log.store import records as mcap
from semmap_log.store.record_scan import frames

_TEXTS = (Opcode.SCHEMA, Opcode.CHANNEL)

APPEND_AFTER = 16
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
            if turn % APPEND_AFTER == 0:
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
