"""Rows of a CSV without an accuracy: what an import says of them, and what makes them sightings."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorObserved
from semmap_log.interop.formats.files.door_table import form_of
from semmap_log.interop.importing.importing import Imported, ImportOptions, import_file

ROWS = "timestamp,door,state,accuracy\n" + "".join(
    f"2026-03-{day:02}T{hour:02}:00,gate,{'open' if hour % 2 else 'closed'},\n"
    for day in (2, 3, 9)
    for hour in range(8, 18)
)


def _take(path: Path, text: str = ROWS, holds: int = 3, **options: object) -> Imported:
    (path / "hub.csv").write_text(text)
    with sl.create(path / "log", tz="UTC", holds=holds) as log:
        return import_file(log, path / "hub.csv", ImportOptions(**options))


def _seen_s(path: Path) -> float:
    """Return for how long the gate's state was known."""
    gate = sl.read(path / "log").timeline("gate")
    return float((gate.duration_ns - gate.not_seen_ns).sum()) / 1e9


def _says_how_long_states_hold(found: Imported) -> bool:
    return any("--accuracy 0.9" in text for text in found.plan.summary)


def test_an_import_says_that_their_states_hold(tmp_path: Path) -> None:
    """Of a file that gives no accuracy at all: it may be of sensors that report each change."""
    assert _says_how_long_states_hold(_take(tmp_path))


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (ROWS, {"holds": 0}),
        (ROWS, {"accuracy": 0.9}),
        (ROWS.replace("8:00,gate,closed,", "8:00,gate,closed,0.9"), {}),
        ("2026-03-01 10:00:02 D001 OPEN\n", {"form": form_of(preset="casas")}),
    ],
    ids=["nothing lapses", "all are sightings", "updates of a log's own export", "a contact"],
)
def test_it_does_not_where_that_is_clear(tmp_path: Path, text: str, options: dict) -> None:
    """Nor where it makes no difference."""
    assert not _says_how_long_states_hold(_take(tmp_path, text, **options))


def test_with_the_accuracy_of_all_they_lapse(tmp_path: Path) -> None:
    """A week without a row is not known, where it was before."""
    (tmp_path / "set").mkdir()
    _take(tmp_path / "set")

    _take(tmp_path, accuracy=0.9)

    assert _seen_s(tmp_path / "set") > 7 * 86_400 > 3 * 86_400 > _seen_s(tmp_path)
    sightings = sl.read(tmp_path / "log").batches(kinds=(DoorObserved,))
    seen = [batch[DoorObserved]["accuracy_open"].tolist() for batch in sightings]
    assert {0.9} == {value for values in seen for value in values}


def test_another_accuracy_is_another_import(tmp_path: Path) -> None:
    """The same one is the same."""
    _take(tmp_path, accuracy=0.9)

    with sl.append(tmp_path / "log") as log:
        again = [
            import_file(log, tmp_path / "hub.csv", ImportOptions(accuracy=accuracy))
            for accuracy in (0.9, 0.8)
        ]

    assert [True, False] == [each.known_before for each in again]
