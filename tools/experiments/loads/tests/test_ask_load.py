"""`ask_load.py` on a few doors: every figure is there, every answer right; times are not
judged.
"""

from __future__ import annotations

from pathlib import Path

import ask_load
import pytest


@pytest.mark.slow
def test_all_figures_are_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """
    One line each.
    """
    monkeypatch.chdir(tmp_path)
    few = [
        "--doors",
        "20",
        "--questions",
        "50",
        "--actions",
        "16",
        "--least",
        "0",
        "--flooded",
        "3",
    ]

    assert 0 == ask_load.main(few)

    said = capsys.readouterr().out
    assert 19 == len(said.splitlines())
    assert "wrong" not in said
    assert [] == list(tmp_path.iterdir())
