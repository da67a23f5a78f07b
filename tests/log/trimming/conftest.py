"""What the tests of trimming share: copies of a log, and a bucket."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest

from tests.bucket import bucket, environment

__all__ = ["bucket", "environment"]


@pytest.fixture
def copies(original: Path, tmp_path: Path) -> Iterator[Path]:
    """Copies of the log that a module calls `original`, each in a folder of its own."""
    return (Path(shutil.copytree(original, tmp_path / str(i) / "log")) for i in count())
