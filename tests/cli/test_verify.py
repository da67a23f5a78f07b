"""`verify` as a user types it: exit codes, what is printed, and that nothing is written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from semmap_log.store.reading.segment_scan import open_segment
from tests.store.eventful import contents, eventful_log, flip
from tests.verbs import ran


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return eventful_log(tmp_path_factory.mktemp("original") / "log")


@pytest.fixture
def log(original: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy to spoil; the folder above is where commands run."""
    import shutil

    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(original, tmp_path / "log"))


def test_a_good_log_in_a_line_with_its_head(log: Path, capsys) -> None:
    """What was read, the hash, and what to do with it; 80 columns are enough."""
    head = json.loads(ran(capsys, "info", "log", "--json")[1])["head"]

    code, out, err = ran(capsys, "verify", "log")

    lines = out.splitlines()
    assert (0, "") == (code, err)
    assert lines[0].startswith("log: good; 13 events in 11 commits, 0.1 MB in 3 files")
    assert f"head {head}" == lines[1]
    assert "semmap-log verify log --head HASH" in out
    assert all(len(line) <= 80 for line in lines)


def test_damage_says_where_what_and_what_to_do(log: Path, capsys) -> None:
    """Exit code 4; file, byte and events of each place."""
    file = log / "log_000001.mcap"
    chunk = open_segment(file).chunks[1]
    flip(file, chunk.data_offset + 40)

    code, out, _ = ran(capsys, "verify", "log")

    assert 4 == code
    assert "log: damaged" in out
    assert f"damage  log_000001.mcap, byte {chunk.offset}, event 6 lost" in out
    assert "its CRC says" in out
    assert "semmap-log recover log" in out
    assert all(len(line) <= 80 for line in out.splitlines())


def test_json_is_one_document(log: Path, capsys) -> None:
    """The same, for machines."""
    file = log / "log_000001.mcap"
    flip(file, open_segment(file).chunks[1].data_offset + 40)

    code, out, _ = ran(capsys, "verify", "log", "--json")

    said = json.loads(out)
    (finding,) = said["findings"]
    assert (4, "damaged") == (code, said["verdict"]) == (said["exit_code"], said["verdict"])
    assert (3, 10, 12) == (said["segments"], said["commits"], said["events"])
    assert ("chunk", "damage", "log_000001.mcap", [6, 6]) == tuple(
        finding[key] for key in ("kind", "severity", "file", "events")
    )


def test_the_head_that_was_kept(log: Path, capsys) -> None:
    """Still there, gone, or not a hash at all."""
    head = json.loads(ran(capsys, "verify", "log", "--json")[1])["head"]
    ran(capsys, "observe", "log", "front", "open")

    grown = ran(capsys, "verify", "log", "--head", head)
    other = ran(capsys, "verify", "log", "--head", "00" * 31 + "01")
    wrong = ran(capsys, "verify", "log", "--head", head[:-1])

    assert 0 == grown[0]
    assert "contains the given head, and 1 event after it" in grown[1]
    assert 4 == other[0]
    assert "its tail was cut" in " ".join(other[1].split())
    assert 2 == wrong[0]
    assert "64 hexadecimal digits" in wrong[2]


def test_torn_and_absent_and_unreadable(log: Path, original: Path, capsys) -> None:
    """3 and nothing to do, 5, and for a format of tomorrow 1."""
    file = log / "log_000000.mcap"
    end = open_segment(file).chunks[-1].offset
    file.write_bytes(file.read_bytes()[: end + 9])

    torn = ran(capsys, "verify", file)
    absent = ran(capsys, "verify", "nolog")

    assert 3 == torn[0]
    assert "torn tail" in torn[1]
    assert "To do: nothing." in torn[1]
    assert (5, "nolog: no such log: expected a folder, or one .mcap file\n") == absent[:2]


@pytest.mark.slow
def test_flipped_bits_by_the_command(log: Path) -> None:
    """A sample of places, by real processes: 4 each time."""
    file = log / "log_000002.mcap"
    whole = file.read_bytes()
    codes = []
    for at in (3, 60, 400, 9_000, len(whole) // 2, len(whole) - 300, len(whole) - 3):
        flip(file, at, at % 8)
        command = [sys.executable, "-m", "semmap_log", "verify", str(log)]
        codes.append(subprocess.run(command, check=False, capture_output=True).returncode)
        file.write_bytes(whole)

    assert [4] * 7 == codes


@pytest.mark.slow
def test_nothing_is_written_and_no_permission_to_is_needed(log: Path) -> None:
    """As nobody, on files and a folder that may only be read: no lock file, no byte changed."""
    (log / ".lock").unlink()
    before = contents(log)
    for path in (*log.iterdir(), log, *log.parents):
        if path.is_relative_to(log.parents[1]):
            path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        done = _as_nobody(log)
    finally:
        for path in (log, *log.parents):
            if path.is_relative_to(log.parents[1]):
                path.chmod(0o755)

    assert (0, b"") == (done.returncode, done.stderr)
    assert before == contents(log)


def _as_nobody(log: Path) -> subprocess.CompletedProcess[bytes]:
    """Verify in a process that may read but not write, for root too."""
    drop = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"] if os.geteuid() == 0 else []
    return subprocess.run(
        [*drop, sys.executable, "-m", "semmap_log", "verify", str(log)],
        check=False,
        capture_output=True,
    )


@pytest.mark.slow
def test_a_disk_that_does_not_give_some_bytes(log: Path, tmp_path: Path) -> None:
    """A read error of the disk is a finding with its place, not a dead process."""
    import shutil

    if shutil.which("strace") is None:
        pytest.skip("strace injects the read error, and is not installed")
    file = log / "log_000001.mcap"
    command = [
        "strace", "-qq", "-f", "-o", str(tmp_path / "trace"), "-P", str(file),
        "-e", "trace=preadv2", "-e", "inject=preadv2:error=EIO:when=2..5",
        sys.executable, "-m", "semmap_log", "verify", str(log), "--json",
    ]  # fmt: skip

    done = subprocess.run(command, check=False, capture_output=True)

    if b"ptrace" in done.stderr.lower() and not done.stdout:
        pytest.skip("strace may not trace here")
    said = json.loads(done.stdout)
    assert 4 == done.returncode, done.stderr
    unreadable = [f for f in said["findings"] if f["kind"] == "unreadable"]
    assert ["log_000001.mcap"] == [f["file"] for f in unreadable]
    assert 13 == said["events"] + sum(
        f["events"][1] - f["events"][0] + 1 for f in said["findings"][:2] if f["events"]
    )
