"""Hostile files: bounded memory, bounded work, plain errors."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.running import faults, is_tried


@pytest.mark.slow
def test_no_file_of_a_stranger_takes_the_machine(tmp_path: Path) -> None:
    """
    Bombs and lies in bags, texts, pictures, and logs of ours.
    """
    is_tried(faults("bombs", 40, tmp_path), at_least=40)
