"""Files longer than what is kept of them: verified the same, whatever the window."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

from semmap_log.log.replay.maintenance import verify
from semmap_log.store.verification import file_place, pieces
from semmap_log.store.verification.file_place import DiskFile, FileBytes, Vanished
from tests.store.eventful import eventful_log

DATA = random.Random(4).randbytes(50_000)


@pytest.mark.parametrize("window", [1, 97, 4096, 2**22])
def test_slices_are_those_of_bytes(
    window: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Forwards, backwards and behind the end; what was sliced stays."""
    monkeypatch.setattr(file_place, "WINDOW_BYTES", window)
    (tmp_path / "file").write_bytes(DATA)
    rng = random.Random(1)
    with (tmp_path / "file").open("rb") as opened:
        file = FileBytes(tmp_path / "file", DiskFile(opened.fileno()))
        kept = file[3:700]
        for _ in range(100):
            start, end = rng.randrange(60_000), rng.randrange(60_000)
            assert DATA[start:end] == file[start:end]
        assert DATA[-37:] == file[len(DATA) - 37 :]
        assert DATA[3:700] == kept
        assert [] == file.unreadable
        longer = FileBytes(tmp_path / "file", DiskFile(opened.fileno()))
        os.truncate(tmp_path / "file", 40_000)
        with pytest.raises(Vanished):
            longer[30_000:50_000]


@pytest.mark.slow
@pytest.mark.parametrize("window", [64, 333])
def test_a_log_is_verified_the_same_in_any_window(
    window: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whole, live, and with garbage in its midst, behind which chunks are found by their bytes."""
    log = eventful_log(tmp_path / "log", copy=tmp_path / "live")
    damaged = eventful_log(tmp_path / "damaged", per_segment=100)
    (file,) = damaged.glob("*.mcap")
    data = bytearray(file.read_bytes())
    data[20_000:20_100] = bytes(100)
    data[-9000:-8990] = bytes(10)
    file.write_bytes(data)
    right = [verify(path) for path in (log, tmp_path / "live", damaged)]
    monkeypatch.setattr(file_place, "WINDOW_BYTES", window)
    monkeypatch.setattr(pieces, "WINDOW_BYTES", window)

    assert [0, 0, 4] == [found.exit_code for found in right]
    assert right == [verify(path) for path in (log, tmp_path / "live", damaged)]
