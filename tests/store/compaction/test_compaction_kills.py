"""Killed at any point: the log as it was or as it will be, never neither, never double."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import semmap_log as sl
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.store.logs import digest_of_records, files_of, segment_files, write_log

CALLS = ("fsync", "renameat", "unlinkat")
"""By which a compaction changes what is on the disk."""


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A log of three closed segments."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", 300)
        yield write_log(tmp_path_factory.mktemp("kills") / "log", 850)


@pytest.fixture(scope="module")
def compacted(original: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What becomes of it when nobody disturbs."""
    log = tmp_path_factory.mktemp("whole") / "log"
    shutil.copytree(original, log)
    compact(log, keep_s=0)
    return files_of(log)


@pytest.fixture
def log(original: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(original, tmp_path / "log"))


def check(log: Path, original: Path, compacted: dict[str, bytes]) -> int:
    """Check all that must hold after a kill; return how many leftovers there were."""
    reader = LogReader(log)
    assert digest_of_records(original) == digest_of_records(log)
    check_listing(log, {segment.path.name for segment in reader.segments})

    compact(log, keep_s=0)

    assert compacted == files_of(log)
    with sl.append(log) as opened:
        opened.add_door()
    return len(reader.leftovers)


def check_listing(log: Path, segments: set[str]) -> None:
    """Check that metadata.yaml lists no file that is missing, and none that lies in another."""
    said: Any = yaml.safe_load((log / "metadata.yaml").read_text())
    listed = said["rosbag2_bagfile_information"]["relative_file_paths"]
    assert len(listed) == len(set(listed))
    assert set(listed) <= segments


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
def test_killed_before_each_change(
    original: Path, compacted: dict[str, bytes], tmp_path: Path, call: str
) -> None:
    """A real SIGKILL in front of the n-th fsync, rename, unlink, for each n that there is."""
    if shutil.which("strace") is None:
        pytest.skip("strace is not installed: no kill in front of a chosen system call")
    kills = leftovers = 0
    while True:
        log = Path(shutil.copytree(original, tmp_path / str(kills) / "log"))
        done = strace_compact(log, f"inject={call}:signal=KILL:when={kills + 1}")
        if "ptrace" in done.stderr:
            pytest.skip(f"strace may not trace here: {done.stderr.strip()[:200]}")
        if done.returncode == 0:
            break
        assert -signal.SIGKILL == done.returncode, done.stderr
        kills += 1

        leftovers += check(log, original, compacted)

    assert compacted == files_of(log)
    assert {"fsync": 5, "renameat": 2, "unlinkat": 2}[call] <= kills
    assert bool(leftovers) == (call in {"fsync", "unlinkat"})


def strace_compact(log: Path, fault: str) -> subprocess.CompletedProcess[str]:
    """Compact in a process of its own, with a fault that strace puts in its way."""
    calls = ",".join(CALLS)
    strace = ["strace", "-f", "-qq", "-o", os.devnull, "-e", f"trace={calls}", "-e", fault]
    return subprocess.run(
        [*strace, sys.executable, "-m", "semmap_log", "compact", "--free-now", str(log)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
def test_an_error_of_the_disk_leaves_a_whole_log(
    original: Path, compacted: dict[str, bytes], tmp_path: Path, call: str
) -> None:
    """EIO from the n-th fsync, rename, unlink: exit code 1, the log is whole, and again."""
    if shutil.which("strace") is None:
        pytest.skip("strace is not installed: no error from a chosen system call")
    failures = 0
    while True:
        log = Path(shutil.copytree(original, tmp_path / str(failures) / "log"))
        done = strace_compact(log, f"inject={call}:error=EIO:when={failures + 1}")
        if "ptrace" in done.stderr:
            pytest.skip(f"strace may not trace here: {done.stderr.strip()[:200]}")
        if done.returncode == 0:
            break
        failures += 1
        assert (1, True) == (done.returncode, "Input/output error" in done.stderr), done.stderr
        assert "Traceback" not in done.stderr

        check(log, original, compacted)

    assert failures > 0
    assert segment_files(log)
