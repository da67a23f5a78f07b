"""Lines that cannot be stored are refused by their numbers; whatever comes, the others are stored.

Other tests of `record`, as a process: `tests/cli/test_record.py`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.commits import MOST_NOTE_CHARACTERS
from semmap_log.core.texts import MOST_CHARACTERS
from semmap_log.errors import FormatError
from semmap_log.live.ros.line_recorder import MAX_LINE_BYTES, LineAnswer, LineRecorder

GOOD = b'{"kind": "DoorObserved", "door": "front", "state": "OPEN"}\n'
POSE = b'{"kind": "RobotPose", "x": 1, "y": 2, "theta": 0}\n'
FLOOR = (
    b'{"kind": "FloorMap", "origin_x": 0, "origin_y": 0, "width": 1, "height": 1,'
    b' "cells_zlib_base64": "eJxjAAAAAQAB", "resolution": %s}\n'
)
KEYS = 45_000


@pytest.fixture
def office(tmp_path: Path) -> Path:
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(name="front")
    return tmp_path / "office"


def _note(key: bytes, text: bytes) -> bytes:
    return GOOD.replace(b"}", b', "' + key + b'": "' + text + b'"}')


def _noted(office: Path, lines: bytes) -> list[LineAnswer]:
    """Return the answers to some lines from a file."""
    answers: list[LineAnswer] = []
    file = office.with_suffix(".jsonl")
    file.write_bytes(lines)
    with file.open("rb") as source, sl.append(office, durability="flush") as log:
        LineRecorder(log, answers.append).run(source.fileno())
    return answers


def _events(office: Path) -> list[str]:
    """Return the kinds of all events behind the door's own two, read again from the disk."""
    return [type(entry.event).__name__ for entry in sl.read(office).history()][2:]


NUL, SURROGATE = b"a\\u0000b", b"\\ud800"
BAD: dict[str, tuple[bytes, str]] = {
    **{
        f"NUL in {key}": (_note(key.encode(), NUL), f"{key}: expected text without NUL characters")
        for key in ("actor", "source", "reason", "correlation")
    },
    "half a pair in reason": (_note(b"reason", SURROGATE), "reason: expected text that UTF-8"),
    "NUL in a door's name": (GOOD.replace(b"front", NUL), "door: expected text without NUL"),
    "too long a note": (_note(b"reason", b"x" * (MOST_NOTE_CHARACTERS + 1)), "Note: expected at"),
    "too long a line": (b'{"kind": "' + b"x" * MAX_LINE_BYTES + b"\n", "expected at most 8388608"),
    "a long zone": (_note(b"timezone", b"x" * 10**6), "No time zone 'xxx"),
    "not UTF-8": (GOOD.replace(b"front", b"\xff"), "expected UTF-8 text, got byte 0xff"),
    "a number without end": (GOOD.replace(b'"front"', b"9" * 5000), "at most 400 digits"),
    "lists without end": (b"[" * 10**6 + b"\n", "values nested without end"),
    "no float32": (FLOOR % b"1e300", "expected a finite number of metres above 0 that a float32"),
    "0 as a float32": (FLOOR % b"1e-300", "expected a finite number of metres above 0 that a"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_line_is_named_and_the_lines_after_it_are_stored(office: Path, name: str) -> None:
    """Whatever is bad in it; in the order of the lines, in a message that a person can read."""
    bad, expected = BAD[name]

    first, refused, last = _noted(office, GOOD + bad + GOOD)

    assert ["DoorObserved", "DoorObserved"] == _events(office)
    assert (1, 2, 3) == (first.line, refused.line, last.line)
    assert (2, None, 3) == (first.event, refused.event, last.event)
    assert expected in refused.error
    assert len(refused.error) <= MOST_CHARACTERS


@pytest.mark.parametrize(
    "words", ['"states": "a\\nb,c", "blocks": "c"', '"states": "a,b", "blocks": "\\n"']
)
def test_a_class_whose_words_have_line_breaks_leaves_a_log_that_is_read(
    office: Path, words: str
) -> None:
    """Also by the lines after it, and after a keyframe."""
    line = f'{{"kind": "ClassDefined", "class_name": "dock", "geometry": "point", {words}}}\n'
    assert ["", ""] == [each.error for each in _noted(office, line.encode() + GOOD)]

    assert sl.read(office).replay().classes["dock"].words in (("a b", "c"), ("a", "b"))


def test_a_reader_that_fails_loses_nothing_that_was_read(office: Path) -> None:
    """The pose that waits for a next line, which never comes."""
    terminal, end = os.openpty()
    os.write(end, POSE + GOOD + POSE)
    os.close(end)
    answers: list[LineAnswer] = []

    with sl.append(office) as log, pytest.raises(FormatError, match="standard input: cannot be"):
        LineRecorder(log, answers.append).run(terminal)

    os.close(terminal)
    assert [(1, 2), (2, 3), (3, 4)] == [(each.line, each.event) for each in answers]
    assert ["RobotPose", "DoorObserved", "RobotPose"] == _events(office)


@pytest.mark.parametrize("error", [BrokenPipeError, KeyboardInterrupt, RuntimeError])
def test_whatever_ends_it_the_lines_that_were_read_are_stored(
    office: Path, error: type[BaseException]
) -> None:
    """Here the one who hears the answers, in the midst of them."""
    source, sink = os.pipe()
    os.write(sink, GOOD + b"bad\n" + GOOD + POSE)
    os.close(sink)

    def answer(_: LineAnswer) -> None:
        raise error

    with os.fdopen(source), sl.append(office) as log, pytest.raises(error):
        LineRecorder(log, answer).run(source)

    assert ["DoorObserved", "DoorObserved", "RobotPose"] == _events(office)


def test_the_first_bad_line_ends_a_strict_run(office: Path) -> None:
    """What stands before it is stored, what stands after it is not."""
    source, sink = os.pipe()
    os.write(sink, POSE + _note(b"reason", NUL) + GOOD)
    os.close(sink)
    answers: list[LineAnswer] = []

    with os.fdopen(source), sl.append(office) as log:
        LineRecorder(log, answers.append, strict=True).run(source)

    assert {(1, 2), (2, None)} == {(each.line, each.event) for each in answers}
    assert ["RobotPose"] == _events(office)


CHILD = """
import resource, sys
resource.setrlimit(resource.RLIMIT_CPU, (10, 10))
import semmap_log as sl
from semmap_log.live.ros.line_recorder import LineRecorder
with sl.append(sys.argv[1]) as log:
    LineRecorder(log, lambda answer: print(answer.line, answer.error or answer.event)).run(0)
"""
"""It takes under a second; what copies the line again for each piece of it takes minutes."""


def _fed(office: Path, write: Callable[[int], None]) -> tuple[int, str]:
    """Return the exit code and the answers of a process that is fed by a pipe."""
    with subprocess.Popen(
        [sys.executable, "-c", CHILD, office], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        text=True,
    ) as child:  # fmt: skip
        assert child.stdin is not None
        assert child.stdout is not None
        write(child.stdin.fileno())
        child.stdin.close()
        return child.wait(), child.stdout.read()


@pytest.mark.slow
def test_an_enormous_line_costs_what_reading_it_costs(office: Path) -> None:
    """A gigabyte without an end, then a good line."""

    def write(fd: int) -> None:
        for _ in range(2**10):
            os.write(fd, b"x" * 2**20)
        os.write(fd, b"\n" + GOOD)

    assert (0, "1 expected at most 8388608 bytes, got a longer line.\n2 2\n") == _fed(office, write)


def test_a_key_that_comes_twice_among_many_is_found_at_once(office: Path) -> None:
    """A line of 45,000 keys, the last one twice: to look for each among all others takes 12 s."""
    keys = ",".join(f'"{i}":0' for i in [*range(KEYS), KEYS - 1])

    code, said = _fed(office, lambda fd: (os.write(fd, f"{{{keys}}}\n".encode()), None)[1])

    assert (0, f"1 key '{KEYS - 1}' is there twice; keep one of them\n") == (code, said)
