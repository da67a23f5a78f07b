"""A log that does not lie on a disk of ours is verified as one that does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from semmap_log.errors import LogAccessError, LogError
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.verification.file_place import DiskPlace
from tests.store.eventful import eventful_log
from tests.store.reading.far_segments import FarFile, FarPlace


def _flipped(file: Path, at: int) -> None:
    data = bytearray(file.read_bytes())
    data[at] ^= 1
    file.write_bytes(data)


@pytest.mark.parametrize("where", [None, 300, -5000, -2000, -60, -30], ids=str)
def test_what_is_found_is_the_same(where: int | None, tmp_path: Path) -> None:
    """A bit in a head, in a chunk, in what closing wrote, or none."""
    log = eventful_log(tmp_path / "log")
    if where is not None:
        _flipped(sorted(log.glob("*.mcap"))[1], where)

    found = verify(log)

    assert (where is None) == (not found.findings)
    assert found.moved(log, Path("far/log")) == verify(FarPlace(log))


def test_a_missing_segment_and_one_that_was_cut_are_found(tmp_path: Path) -> None:
    """What the mark and metadata.yaml tell is had from that place, too."""
    log = eventful_log(tmp_path / "log")
    files = sorted(log.glob("*.mcap"))
    files[-1].unlink()
    files[0].write_bytes(files[0].read_bytes()[:-100])

    found = verify(log)

    assert 4 == found.exit_code
    assert found.moved(log, Path("far/log")) == verify(FarPlace(log))


def test_a_file_that_is_exchanged_at_every_look_is_told(tmp_path: Path) -> None:
    """It is begun anew some times; then the place is named."""
    log = eventful_log(tmp_path / "log")
    opened: list[Path] = []

    class Restless(FarPlace):
        @contextmanager
        def opened(self, file: Path) -> Iterator[FarFile]:
            opened.append(file)
            with super().opened(file) as found:
                found.identity = len(opened)
                yield found

    with pytest.raises(LogError, match=r"^far/log: its files change faster than"):
        verify(Restless(log))


def test_a_place_that_fails_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the file that could not be opened, and by nothing else."""
    log = eventful_log(tmp_path / "log")

    def refused(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(DiskPlace, "opened", refused)

    with pytest.raises(LogAccessError, match=r"_000000.mcap"):
        verify(log)
