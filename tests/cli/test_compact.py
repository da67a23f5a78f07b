"""`semmap-log compact`, as a user types it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.writing import segment_chain
from tests.live.ros.running import DEADLINE_S
from tests.store.logs import digest_of_records, segment_files, write_log
from tests.verbs import Verb


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three closed segments of many small chunks."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 100)
    return write_log(tmp_path / "office", 250)


@pytest.fixture
def run(run_verb: Verb) -> Verb:
    """Run the verb; return its exit code, stdout and stderr."""
    return partial(run_verb, "compact")


def test_before_and_after_are_printed(log: Path, run: Verb) -> None:
    """Segments, bytes and bytes an event; what it says is what there is."""
    before = sum(path.stat().st_size for path in segment_files(log))

    code, out, err = run(log, "--free-now")

    after = sum(path.stat().st_size for path in segment_files(log))
    assert (0, "") == (code, err)
    assert "closed segments   3 -> 1" in out
    assert f"{before:,} -> {after:,}" in out
    assert f"{before / 250:.1f} -> {after / 250:.1f} (250 events)" in out


def test_json(log: Path, run: Verb) -> None:
    """One document, with every figure and what became what."""
    code, out, _ = run(log, "--json", "--free-now")

    said = json.loads(out)
    assert 0 == code
    assert (3, 1, 250) == (said["segments_before"], said["segments_after"], said["events"])
    assert sum(path.stat().st_size for path in segment_files(log)) == said["bytes_after"]
    assert round(said["bytes_after"] / 250, 2) == said["bytes_per_event_after"]
    assert [
        {
            "files": ["office_000000.mcap", "office_000001.mcap", "office_000002.mcap"],
            "into": "office_000000.mcap",
        }
    ] == said["steps"]


def test_what_was_merged_stays_for_copies_under_way(log: Path, run: Verb) -> None:
    """How many files, and their bytes, and when they go; with --free-now they go at once."""
    parts = segment_files(log)[1:]
    size = sum(path.stat().st_size for path in parts)

    _, out, _ = run(log)
    _, again, _ = run(log, "--json")

    assert f"2 merged files, {size:,} bytes, stay for an hour" in out
    assert (2, size) == (json.loads(again)["merged_files"], json.loads(again)["merged_bytes"])
    assert all(path.exists() for path in parts)
    run(log, "--free-now")
    assert [log / "office_000000.mcap"] == segment_files(log)


def test_a_second_time_there_is_nothing_to_do(log: Path, run: Verb) -> None:
    """And nothing is written."""
    run(log)
    files = {path: path.stat().st_ino for path in log.iterdir()}

    code, out, _ = run(log)

    assert (0, True) == (code, "nothing to do" in out)
    assert files == {path: path.stat().st_ino for path in log.iterdir()}


def test_dry_run_writes_nothing(log: Path, run: Verb) -> None:
    """It names what would be done, even while somebody is writing and nothing may be written."""
    before = {path.name: path.read_bytes() for path in log.iterdir()}

    code, out, _ = run(log, "--dry-run")
    _, unmerged, _ = run(log, "--dry-run", "--no-merge")
    _, as_json, _ = run(log, "--dry-run", "--json", "--no-merge")

    assert 0 == code
    assert "would merge 3 segments, office_000000.mcap to office_000002.mcap" in out
    assert "3 -> 1" in out
    assert "would compress office_000001.mcap" in unmerged
    assert (True, None) == (json.loads(as_json)["dry_run"], json.loads(as_json)["bytes_after"])
    assert 3 == len(json.loads(as_json)["steps"])
    assert before == {path.name: path.read_bytes() for path in log.iterdir()}


def test_without_merging(log: Path, run: Verb) -> None:
    """Each file stays one, and becomes smaller."""
    sizes = [path.stat().st_size for path in segment_files(log)]

    run(log, "--no-merge")

    smaller = [path.stat().st_size for path in segment_files(log)]
    assert 3 == len(smaller)
    assert all(new < old for new, old in zip(smaller, sizes, strict=True))


def test_not_while_somebody_writes(log: Path, run: Verb) -> None:
    """Exit code 1, one line that says who; the files stay."""
    with sl.append(log, compact=False):
        before = {path.name: path.read_bytes() for path in segment_files(log)}
        code, out, err = run(log)
        after = {path.name: path.read_bytes() for path in segment_files(log)}

    assert (1, "") == (code, out)
    assert f"process {os.getpid()} is writing" in err
    assert before == after


def test_damage_is_named_and_left(log: Path, run: Verb) -> None:
    """Exit code 1, the file and the byte; no file is changed."""
    path = segment_files(log)[1]
    chunk = open_segment(path).chunks[20]
    data = bytearray(path.read_bytes())
    data[chunk.data_offset + 50] ^= 1
    path.write_bytes(data)
    before = {path.name: path.read_bytes() for path in log.glob("*.mcap")}

    code, _, err = run(log)

    assert (1, True) == (code, f"{path}: damaged at byte {chunk.offset}" in err)
    assert before == {path.name: path.read_bytes() for path in log.glob("*.mcap")}


def test_a_log_without_events(tmp_path: Path, run: Verb) -> None:
    """There are no bytes an event to tell of."""
    sl.create(tmp_path / "log", tz="UTC").close()

    code, out, _ = run(tmp_path / "log")
    _, as_json, _ = run(tmp_path / "log", "--json")

    assert (0, False) == (code, "bytes an event" in out)
    assert (0, None) == (
        json.loads(as_json)["events"],
        json.loads(as_json)["bytes_per_event_after"],
    )


def test_a_log_that_is_live(tmp_path: Path, run: Verb) -> None:
    """Whose writer was killed in its first segment: nothing is closed, so nothing is done."""
    (path,) = segment_files(write_log(tmp_path / "log", 5))
    segment = open_segment(path)
    path.write_bytes(bytes(segment.source.read(0, segment.valid_end)))

    code, out, _ = run(tmp_path / "log")

    assert (0, True) == (code, "nothing to do; closed segments: 0" in out)


@pytest.mark.slow
@pytest.mark.parametrize("delay_s", [0.0, 0.02, 0.05, 0.1])
def test_ctrl_c_leaves_the_whole_log(tmp_path: Path, delay_s: float) -> None:
    """A real process, a real SIGINT: afterwards the same records, no temporary file, and again."""
    log = write_log(tmp_path / "log", 3000, per_commit=20)
    before = digest_of_records(log)
    process = subprocess.Popen(
        [sys.executable, "-m", "semmap_log", "compact", str(log)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + DEADLINE_S
    while process.poll() is None and not list(log.glob(".*.tmp")):
        assert time.monotonic() < deadline
        time.sleep(0.001)

    time.sleep(delay_s)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=DEADLINE_S)

    # Of a process that has done its work and is ending, the signal makes an end: 130 to a shell.
    assert process.returncode in {0, 130, -signal.SIGINT}, err
    assert b"Traceback" not in err
    assert before == digest_of_records(log)
    assert [] == list(log.glob(".*.tmp"))
    subprocess.run([sys.executable, "-m", "semmap_log", "compact", log], check=True)
    assert before == digest_of_records(log)
