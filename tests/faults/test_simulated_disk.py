"""Crash states of a simulated disk: the short form of `tools/faults.py disk`, and its model."""

from __future__ import annotations

import os
import random
import stat
from pathlib import Path

import pytest
from fault_injection.disk_model import SECTOR, Disk
from fault_injection.shim import Call, Entry

import semmap_log as sl
from tests.faults.running import faults, is_tried

MAGIC = b"\x89MCAP0\r\n"
O_CREAT = os.O_CREAT


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_whatever_a_disk_keeps(tmp_path: Path) -> None:
    """
    Unsynced writes lost, torn, reordered, names and renames undone, at any call, at all levels.
    """
    said = faults("disk", 150, tmp_path)

    is_tried(said, at_least=150)


def test_what_a_footer_stands_for_is_on_the_disk_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A power cut may keep a file's last sector alone."""
    synced: list[bytes] = []
    fsync = os.fsync

    def watched(fd: int) -> None:
        if stat.S_ISREG(os.fstat(fd).st_mode):
            synced.append(Path(f"/proc/self/fd/{fd}").read_bytes())
        fsync(fd)

    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        monkeypatch.setattr(os, "fsync", watched)

    closed = (tmp_path / "log" / "log_000000.mcap").read_bytes()
    assert MAGIC == closed[-len(MAGIC) :]
    assert [closed[: -len(MAGIC)], closed] == synced[:2]


def _watch_syncs(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Return what is synced from now on."""
    synced: list[Path] = []
    fsync = os.fsync

    def watched(fd: int) -> None:
        synced.append(Path(f"/proc/self/fd/{fd}").readlink())
        fsync(fd)

    monkeypatch.setattr(os, "fsync", watched)
    return synced


def test_the_name_of_a_log_that_was_half_made_is_synced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who made it was killed before that; what the next writer acknowledges must not go with it."""
    whole = sl.create(tmp_path / "other", tz="UTC")
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "log_000000.mcap").write_bytes(
        (tmp_path / "other" / "other_000000.mcap").read_bytes()
    )
    whole.close()
    synced = _watch_syncs(monkeypatch)
    with sl.append(tmp_path / "log") as log:
        log.add_door()

    assert tmp_path in synced


def test_a_closed_segment_is_synced_by_the_next_writer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who closed it may have been killed just before; what comes behind it must not be cut off."""
    sl.create(tmp_path / "log", tz="UTC").close()
    synced = _watch_syncs(monkeypatch)
    with sl.append(tmp_path / "log"):
        assert [tmp_path / "log" / "log_000000.mcap"] == synced


def _open(path: str, fd: int) -> Entry:
    return Entry(Call.OPEN, fd, O_CREAT, path, "", b"")


def _write(fd: int, offset: int, data: bytes) -> Entry:
    return Entry(Call.WRITE, fd, offset, "", "", data)


def _on(call: Call, fd: int) -> Entry:
    return Entry(call, fd, 0, "", "", b"")


def _rename(source: str, target: str) -> Entry:
    return Entry(Call.RENAME, -1, 0, source, target, b"")


def _left(*entries: Entry) -> list[object]:
    """Return every content that the model draws after these calls."""
    disk = Disk("/r")
    for entry in entries:
        disk.take(entry)
    drawn = [disk.crashed(random.Random(seed)) for seed in range(400)]
    return [tree for i, tree in enumerate(drawn) if tree not in drawn[:i]]


def test_the_model_keeps_what_was_synced() -> None:
    """A file and its name, each once it is synced itself, and then for certain."""
    written = (_open("/r/a", 3), _write(3, 0, b"x"), _on(Call.FDATASYNC, 3))
    folder = (Entry(Call.LOOK, 4, 0, "/r", "", b""), _on(Call.FSYNC, 4))

    without_name, with_name = _left(*written), _left(*written, *folder)

    assert sorted([{}, {"a": b"x"}], key=str) == sorted(without_name, key=str)
    assert [{"a": b"x"}] == with_name


def test_the_model_tears_what_was_not() -> None:
    """Each sector is there or not, in any order, and the size may be ahead of the data."""
    old, new = b"o" * SECTOR, b"n" * SECTOR
    folder = (Entry(Call.LOOK, 4, 0, "/r", "", b""), _on(Call.FSYNC, 4))
    first = (_open("/r/a", 3), _write(3, 0, old), _on(Call.FSYNC, 3), *folder)

    left = _left(*first, _write(3, SECTOR, new), _write(3, 2 * SECTOR, new))

    hole = bytes(SECTOR)
    for data in (old, old + new, old + hole, old + hole + new, old + new + hole, old + hole + hole):
        assert {"a": data} in left
    assert all(tree["a"].startswith(old) for tree in left)


def test_the_model_undoes_renames() -> None:
    """A rename that was not followed by a sync of the folder happened, or not."""
    folder = (Entry(Call.LOOK, 4, 0, "/r", "", b""), _on(Call.FSYNC, 4))
    first = (_open("/r/a", 3), _write(3, 0, b"old"), _on(Call.FSYNC, 3), *folder)

    left = _left(*first, _open("/r/b", 5), _write(5, 0, b"new"), _rename("/r/b", "/r/a"))

    assert {"a": b"old"} in left
    assert {"a": b"new"} in left
    assert {"a": b""} in left
    assert {"a": b"old", "b": b""} in left
