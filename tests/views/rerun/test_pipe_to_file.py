"""A pipe into a file: all of it, or an error, and nobody waits for ever."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from semmap_log.views.rerun.file import piped_to


@pytest.fixture
def small_files() -> Iterator[None]:
    """No file may grow beyond 100 kB, as on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    signal.signal(signal.SIGXFSZ, handler)


def test_every_byte_arrives(tmp_path: Path) -> None:
    """More than a pipe holds goes through, in order."""
    data = os.urandom(3_000_000)

    with piped_to(tmp_path / "x") as pump, Path(pump.inlet).open("wb") as inlet:
        inlet.write(data)

    assert data == (tmp_path / "x").read_bytes()


@pytest.mark.usefixtures("small_files")
def test_a_full_disk_is_an_error_and_not_a_standstill(tmp_path: Path) -> None:
    """The writer's bytes are drained to the last; then the system's error comes."""
    with (
        pytest.raises(OSError, match="File too large"),
        piped_to(tmp_path / "x") as pump,
        Path(pump.inlet).open("wb") as inlet,
    ):
        inlet.write(bytes(3_000_000))


@pytest.mark.usefixtures("small_files")
def test_the_error_is_known_before_the_end(tmp_path: Path) -> None:
    """`check` lets a long conversion stop early."""

    def fill() -> None:
        with piped_to(tmp_path / "x") as pump:
            with Path(pump.inlet).open("wb") as inlet:
                inlet.write(bytes(3_000_000))
            while True:
                pump.check()

    with pytest.raises(OSError, match="File too large"):
        fill()


def test_an_error_of_the_writers_own_stays_the_error(tmp_path: Path) -> None:
    """The pump is closed on the way out."""
    with pytest.raises(RuntimeError, match="ours"), piped_to(tmp_path / "x"):
        raise RuntimeError("ours")
