"""What the tests of the commands share: a stdout that is a terminal."""

from __future__ import annotations

import pytest


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let tables be drawn, 80 columns wide and without colours, as people see them."""
    monkeypatch.setattr("semmap_log.cli.printer.is_for_people", lambda: True)
    monkeypatch.setenv("COLUMNS", "80")
