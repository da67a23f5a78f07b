"""`make_recordings.py`: the same seed gives the recordings that ship."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zstandard

import semmap_log as sl
from tests.test_recordings import RECORDINGS, messages

MADE_WITH_ZSTD = (1, 5, 7)
"""Another version may pack the floor plans into other bytes."""


def make(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    tool = RECORDINGS.parent / "tools" / "experiments" / "make_recordings.py"
    return subprocess.run(
        [sys.executable, tool, *arguments], capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_tool_remakes_the_office(tmp_path: Path, shared_data: Path) -> None:
    """The same seed gives the same bytes; with another zstd, the same records."""
    done = make("--only", "office", "--out", tmp_path, "--maps", shared_data / "maps")

    assert done.returncode == 0, done.stderr
    assert (RECORDINGS / "office.expected.json").read_bytes() == (
        tmp_path / "office.expected.json"
    ).read_bytes()
    shipped, remade = (sorted(folder.glob("office/*.mcap")) for folder in (RECORDINGS, tmp_path))
    assert [path.name for path in shipped] == [path.name for path in remade]
    for old, new in zip(shipped, remade, strict=True):
        assert messages(old) == messages(new)
        if zstandard.ZSTD_VERSION == MADE_WITH_ZSTD:
            assert old.read_bytes() == new.read_bytes()


@pytest.mark.slow
def test_tool_remakes_the_scans(tmp_path: Path, shared_data: Path) -> None:
    """The same recipe gives the same messages, the same truth and the same doors.

    Sines differ in their last digit from processor to processor, and so do poses made of them.
    """
    done = make("--only", "office_scans", "--out", tmp_path, "--maps", shared_data / "maps")

    assert done.returncode == 0, done.stderr
    for name in ("office_scans.truth.json", "office_scans.doors.jsonl"):
        assert (RECORDINGS / name).read_bytes() == (tmp_path / name).read_bytes()
    old, new = (messages(folder / "office_scans.mcap") for folder in (RECORDINGS, tmp_path))
    assert [one[:-1] for one in old] == [one[:-1] for one in new]
    for (topic, *_, data), (*_, remade) in zip(old, new, strict=True):
        assert data == remade or (topic in POSES and _is_near(data, remade)), topic


POSES = {"/tf", "/amcl_pose"}


def _is_near(one: bytes, other: bytes) -> bool:
    """Tell whether two CDR messages are equal but for the last digits of their numbers."""
    end = 4 + (len(one) - 4) // 8 * 8
    both = [np.frombuffer(data[4:end], np.float64) for data in (one, other)]
    return one[end:] == other[end:] and np.allclose(*both, rtol=0, atol=1e-9, equal_nan=True)


@pytest.mark.slow
def test_another_seed_is_another_day(tmp_path: Path, shared_data: Path) -> None:
    """Another seed makes another recording, which is whole as well."""
    done = make(
        "--only", "office", "--seed", "2", "--out", tmp_path, "--maps", shared_data / "maps"
    )

    assert done.returncode == 0, done.stderr
    assert sl.read(RECORDINGS / "office").info.log_id != sl.read(tmp_path / "office").info.log_id


def test_missing_plans_are_named(tmp_path: Path) -> None:
    """Without the plans the tool says what it wants, and makes nothing."""
    done = make("--out", tmp_path / "out", "--maps", tmp_path)

    assert done.returncode == 1
    assert "office.building.yaml: expected the Open-RMF plan" in done.stderr
    assert "--maps" in done.stderr
    assert not (tmp_path / "out").exists()
