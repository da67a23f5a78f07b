"""A log whose folder is moved, exchanged, copied over, or planted with traps."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.running import faults, is_tried


@pytest.mark.slow
def test_no_file_outside_is_changed_and_no_loss_is_kept_quiet(tmp_path: Path) -> None:
    """All scenarios several times over, and traps for all that writes."""
    is_tried(faults("folders", 100, tmp_path), at_least=100)
