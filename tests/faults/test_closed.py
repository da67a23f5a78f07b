"""Closed files damaged: every answer is right, or an error."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.running import faults, is_tried


@pytest.mark.slow
def test_every_verb_says_what_is_so_or_that_it_cannot(tmp_path: Path) -> None:
    """Cut, zeroed, missing, swapped, of a diverged copy, of another day; and what lies beside."""
    is_tried(faults("closed", 30, tmp_path), at_least=30)
