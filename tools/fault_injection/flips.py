"""One bit, anywhere in a log, turned over: detected, or harmless."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from pathlib import Path

from fault_injection.judging import Judge, Tally, copy_of
from mcap.opcode import Opcode
from semmap_log.log import records as mcap
from semmap_log.log.chunks import frames

_TEXTS = (Opcode.SCHEMA, Opcode.CHANNEL)


def flip_bits(
    log: Path, judge: Judge, *, seed: int = 0, bits: int = 8, text_bits: int = 1, step: int = 1
) -> Tally:
    """Flip bits of every segment, one at a time, and ask what the log says.

    Args:
        log: An undamaged log.
        judge: Who knows what it says.
        seed: Which bits are chosen where not all are.
        bits: How many of the eight bits of a byte.
        text_bits: The same for bytes of schemas and channels: nine tenths of a small segment.
        step: Only every n-th byte, beginning anywhere.
    """
    tally, dice = Tally(), random.Random(seed)
    with copy_of(log) as copy:
        files = sorted(copy.glob("*.mcap"))
        for path in files:
            may_lose = int(path == files[-1] and is_live(path))
            texts = _text_bytes(path)
            for at in range(dice.randrange(step), path.stat().st_size, step):
                is_text = at in texts
                for bit in dice.sample(range(8), text_bits if is_text else bits):
                    with flipped(path, at, bit):
                        only = judge.quick if is_text else judge.some(tally.tried)
                        tally.count(
                            f"{path.name} byte {at} bit {bit}",
                            lambda p=path, o=only: judge.judge(
                                copy, p.name, may_lose=may_lose, only=o
                            ),
                        )
    return tally


def flip_bits_and_append(log: Path, judge: Judge, *, seed: int = 0, times: int = 300) -> Tally:
    """Flip random bits, one at a time, and open the log for appending.

    Args:
        log: An undamaged log.
        judge: Who knows what it says.
        seed: Which bits.
        times: How many; half of them in the last segment.
    """
    tally, dice = Tally(), random.Random(seed)
    names = sorted(path.name for path in log.glob("*.mcap"))
    for turn in range(times):
        name = names[-1] if turn % 2 else dice.choice(names)
        with copy_of(log) as copy:
            path = copy / name
            may_lose = int(name == names[-1] and is_live(path))
            whole = [at for at in range(path.stat().st_size) if turn % 8 == 0] or _no_texts(path)
            at, bit = dice.choice(whole), dice.randrange(8)
            with path.open("r+b") as file:
                _turn_over(file.fileno(), at, bit)
            tally.count(
                f"{name} byte {at} bit {bit}, appending",
                lambda n=name, c=copy, m=may_lose: judge.judge_appending(c, n, may_lose=m),
            )
    return tally


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


def is_live(path: Path) -> bool:
    """Tell whether a segment has no footer."""
    return not path.read_bytes().endswith(mcap.MAGIC)


def _turn_over(fd: int, at: int, bit: int) -> None:
    (byte,) = os.pread(fd, 1, at)
    os.pwrite(fd, bytes([byte ^ 1 << bit]), at)


def _no_texts(path: Path) -> list[int]:
    return sorted(set(range(path.stat().st_size)) - _text_bytes(path))


def _text_bytes(path: Path) -> set[int]:
    """Return the places of all bytes of a segment's schemas and channels, frames left out."""
    return set(_texts(path.read_bytes()))


def _texts(data: bytes) -> Iterator[int]:
    for opcode, offset, length in frames(data, len(mcap.MAGIC), len(data)):
        if opcode in _TEXTS:
            yield from range(offset + mcap.FRAME.size, offset + length)
