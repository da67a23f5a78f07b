"""Sectors that cannot be read, and files that get shorter: errors, never signals."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.running import faults, is_tried


@pytest.mark.slow
def test_unreadable_sectors_end_nobody(tmp_path: Path) -> None:
    """On a file system whose image was cut; wants root and a loop device."""
    is_tried(faults("sectors-unreadable", 8, tmp_path), at_least=8)


@pytest.mark.slow
def test_a_file_that_shrinks_ends_nobody(tmp_path: Path) -> None:
    """Under open readers, and under each verb; once, or over and over."""
    is_tried(faults("sectors-shrinking", 10, tmp_path), at_least=10)
