"""Sectors that cannot be read: an answer is right, or an error with the place; never a signal."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import CorruptLogError, UnreadableLogError
from semmap_log.log.replay.maintenance import recover_into, verify
from semmap_log.store.compaction import compact
from semmap_log.store.reading.segment_scan import numbers_of, open_segment
from tests.bad_disk import BLOCK, bad_disk
from tests.store.eventful import eventful_log

CLOSED, LIVE = "log_000000.mcap", "log_000003.mcap"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of closed segments and a live one."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "made").mkdir()
    made = eventful_log(folder / "made" / "log", per_segment=4)
    with sl.append(made, compact=False) as log:
        for turn in range(40):
            log.observe("front", "open" if turn % 2 else "closed")
        shutil.copytree(made, folder / "log")
    shutil.rmtree(folder / "made")
    assert [CLOSED, LIVE] == sorted(path.name for path in (folder / "log").glob("*.mcap"))[::3]
    return folder / "log"


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *map(str, command)], check=False, capture_output=True, text=True
    )


def answers(log: Path, whole: Path) -> list[tuple[str, str, str]]:
    """Return question, whether it is an answer or an error, and its text."""
    done = run("tests.store.asking", log, whole)
    assert 0 == done.returncode, done.stderr
    return [tuple(one) for one in json.loads(done.stdout)]


def blocks_of(whole: Path, name: str) -> range:
    return range(-(-(whole / name).stat().st_size // BLOCK))


def events_in(whole: Path, name: str, block: int) -> set[int]:
    """Return the numbers of the events whose chunks lie in a block."""
    segment = open_segment(whole / name)
    lost = set[int]()
    for row, first, end in zip(segment.chunks.rows, *numbers_of(segment), strict=True):
        begin = int(row["offset"])
        if begin < (block + 1) * BLOCK and begin + int(row["length"]) > block * BLOCK:
            lost |= set(range(int(first), int(end)))
    return lost


def told(log: Path) -> list[str]:
    """Return all events of a log, as texts without their numbers."""
    return [
        f"{recorded.happened_ns} {recorded.event!r}"
        for batch in sl.read(log)._reader.batches()
        for recorded in batch
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", [CLOSED, LIVE])
def test_each_block_of_a_file(whole: Path, name: str, tmp_path: Path) -> None:
    """Answers are as they were or name the place; verify names it too."""
    right = {question: text for question, _, text in answers(whole, whole)}
    everything = told(whole)
    assert len(blocks_of(whole, name)) >= 7
    for block in blocks_of(whole, name):
        image = tmp_path / f"{block}.img"
        with bad_disk(whole, image, {name: [block]}) as log:
            for question, kind, text in answers(log, whole):
                if kind == "answer":
                    assert right[question] == text, (block, question)
                else:
                    wanted = rf"{name}: cannot be read at byte (\d+): Input/output error; all such"
                    place = re.search(wanted, text)
                    assert place, text
                    assert block == int(place[1]) // BLOCK

            found = verify(log).findings

            places = [(f.path, f.offset) for f in found if f.kind == "unreadable"]
            assert [(log / name, block * BLOCK)] == places
            assert not {"torn", "shortened", "foreign"} & {f.kind for f in found}, block
            made = recover_into(log, tmp_path / f"new{block}")
        assert made.log is not None
        assert 0 == verify(made.log).exit_code
        lost = events_in(whole, name, block)
        kept = [text for number, text in enumerate(everything) if number not in lost]
        if not any("Retracted" in everything[number] for number in lost):
            kept = [text for text in kept if "Retracted" not in text or not lost]
        assert kept == [t for t in told(made.log) if "LogExported" not in t and (
            "Retracted" not in t or not lost)], block  # fmt: skip
        image.unlink()


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    ["history", "tail", "diff event:1 event:9", "compact", "observe front open", "recover",
     "retain --thin 1s"],
)  # fmt: skip
def test_every_verb_ends_with_a_code(whole: Path, command: str, tmp_path: Path) -> None:
    """A file of which nothing can be read but its head and its end: no verb dies of a signal."""
    verb, *arguments = command.split()
    blocks = list(blocks_of(whole, CLOSED))[1:-1]
    with bad_disk(whole, tmp_path / "disk.img", {CLOSED: blocks}) as log:
        done = run("semmap_log", verb, log, *arguments)

        assert done.returncode == (4 if verb in ("verify", "recover") else 1), done.stderr
        assert "Traceback" not in done.stderr
        assert CLOSED in done.stdout + done.stderr
        said = " ".join((done.stdout + done.stderr).split())
        assert re.search(r"byte \d+", said) or verb == "recover", said


@pytest.mark.parametrize("place", [0, 1, 3, -1])
def test_a_writer_refuses_what_it_cannot_read(whole: Path, place: int, tmp_path: Path) -> None:
    """The last segment, to go on with: nothing is written, and nothing in place of it."""
    block = blocks_of(whole, LIVE)[place]
    with bad_disk(whole, tmp_path / "disk.img", {LIVE: [block]}) as log:
        before = {path.name: path.stat() for path in log.glob("*.mcap*")}

        with pytest.raises(UnreadableLogError, match=f"{LIVE}: cannot be read at byte ") as told:
            sl.append(log)

        assert block == told.value.offset // BLOCK
        after = {path.name: path.stat() for path in log.glob("*.mcap*")}
        assert [(name, s.st_ino, s.st_size, s.st_mtime_ns) for name, s in before.items()] == [
            (name, s.st_ino, s.st_size, s.st_mtime_ns) for name, s in after.items()
        ]


def test_a_bad_block_is_no_end_of_a_compaction(whole: Path, tmp_path: Path) -> None:
    """The segment stays as it is, and the error names the place."""
    with bad_disk(whole, tmp_path / "disk.img", {CLOSED: [4]}) as log:
        before = (log / CLOSED).stat()

        with pytest.raises(CorruptLogError, match="byte 16384"):
            compact(log, keep_s=0)

        assert before.st_ino == (log / CLOSED).stat().st_ino


@pytest.mark.slow
def test_recovering_in_place(whole: Path, tmp_path: Path) -> None:
    """The new log takes the place of the old one, whose files are kept as far as they can be."""
    with bad_disk(whole.parent, tmp_path / "disk.img", {f"log/{CLOSED}": [4]}) as folder:
        done = run("semmap_log", "recover", folder / "log", "--yes")

        assert 0 == done.returncode, done.stderr
        assert 0 == verify(folder / "log").exit_code
        assert (folder / "log" / "damaged-1" / CLOSED).exists()
