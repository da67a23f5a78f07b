"""The table of beliefs."""

from __future__ import annotations

import io
from pathlib import Path

from rich.console import Console

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.core.model.events import LevelAdded
from semmap_log.views.belief_table import belief_table


def printed(path: Path, *names: str) -> str:
    """Return the table of a log with a door of each name, each on a level of its own."""
    with sl.create(path, tz="UTC") as log:
        for level, name in enumerate(names, start=1):
            log.append([LevelAdded(level=level, name=f"L{level}")])
            log.add_door(name=name, level=level, at="2026-03-01T00:00Z")
    out = io.StringIO()
    Console(file=out, width=80).print(belief_table(probabilities(sl.read(path)), tz="UTC"))
    return out.getvalue()


def test_levels_are_shown_where_names_do_not_tell_them(tmp_path: Path) -> None:
    """Two doors called front need the column; L1_front and L2_front leave more room for names."""
    assert "level" in printed(tmp_path / "a", "front", "front")
    assert "level" not in printed(tmp_path / "b", "L1_front", "L2_front")


def test_a_forecast_of_nothing_is_not_carried_over(tmp_path: Path) -> None:
    """Of doors never seen nothing is said at all."""
    shown = printed(tmp_path / "a", "front")

    assert "UNKNOWN, never seen: front" in shown
    assert "carried over" not in shown
