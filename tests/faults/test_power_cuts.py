"""Real power cuts on real file systems: the short form of `tools/faults.py power`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.running import faults, is_tried


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "cuts"), [("power-ext4", 3), ("power-xfs", 1)])
def test_what_was_acknowledged_survives_a_power_cut(kind: str, cuts: int, tmp_path: Path) -> None:
    """The file system is shut down at a random moment while two logs are written."""
    said = faults(kind, cuts, tmp_path)

    is_tried(said, at_least=cuts)
