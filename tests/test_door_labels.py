"""What doors are called in messages where a plain name would be a riddle."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.folds.door_index import labels_of
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, LevelAdded
from semmap_log.errors import EarlyEventsWarning


def log_of(path: Path, *doors: tuple[int, str | None]) -> sl.DoorLog:
    """Make a log of unplaced doors, each on a level and with a name, ids from 1 on."""
    with sl.create(path, tz="UTC") as log:
        log.append([LevelAdded(level=n, name=f"L{n}") for n in (1, 2)])
        for number, (level, name) in enumerate(doors, 1):
            door_id = DoorId(number)
            log.append([DoorAdded(door_id=door_id, level=level, prob_open=0.9, prob_closed=0.9)])
            if name is not None:
                log.append([DoorAnnotated(door_id=door_id, key="name", value=name)])
    return sl.read(path)


def test_a_name_that_several_bear_has_its_level_before_it(tmp_path: Path) -> None:
    """As commands take it; the id behind it where even that is not enough."""
    log = log_of(
        tmp_path / "log",
        (1, "front"),
        (2, "front"),
        (1, "side"),
        (1, None),
        (1, "back"),
        (1, "back"),
    )

    labels = labels_of(log.replay())

    assert {
        1: "L1/front", 2: "L2/front", 3: "side", 5: "L1/back (id 5)", 6: "L1/back (id 6)",
    } == labels  # fmt: skip
    assert [1, 2] == [log.resolve_any_door(labels[DoorId(n)]) for n in (1, 2)]


def test_a_log_names_removed_doors_too(tmp_path: Path) -> None:
    """A removed door's name makes no other one ambiguous: it is not in the map."""
    log_of(tmp_path / "log", (1, "front"), (2, "front"))
    with sl.append(tmp_path / "log") as log:
        log.remove_door(2)

    assert {1: "front", 2: "front"} == sl.read(tmp_path / "log").door_labels()


def test_warnings_say_which_of_two_doors_is_meant(tmp_path: Path) -> None:
    """Of probabilities that cannot be, and of events that came before their door."""
    log = log_of(tmp_path / "log", (1, "front"), (2, "front"))

    said = log.summary().warnings

    assert ["L1/front", "L2/front"] == [text.partition(":")[0] for text in said]
    with sl.append(tmp_path / "log") as writer, pytest.warns(EarlyEventsWarning) as told:
        writer.observe(2, "open", at="2020-01-01")
    assert "1 event of 1 door (L2/front), from 2020-01-01" in str(told[0].message)


@pytest.mark.parametrize("verb", [["costmap", "out.pgm"], ["export", "out.geojson"]], ids=str)
def test_what_is_left_out_is_told_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: list[str]
) -> None:
    """Doors without a place, on two levels."""
    log_of(tmp_path / "log", (1, "front"), (2, "front"))
    with sl.append(tmp_path / "log") as log:
        log.add_door(level=1, x=1.0, y=1.0, theta=0.0, width=1.0)
    level = ["--level", "L1"] if verb[0] == "costmap" else []

    with pytest.raises(SystemExit, match=r"^0$"):
        main([verb[0], str(tmp_path / "log"), str(tmp_path / verb[1]), *level])
    said = capsys.readouterr()

    assert "L1/front" in said.err
    assert "L2/front" in said.err


def test_notes_below_probabilities_tell_doors_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Which of the two was never seen."""
    log_of(tmp_path / "log", (1, "front"), (2, "front"))
    with sl.append(tmp_path / "log") as log:
        log.observe(1, "open")

    with pytest.raises(SystemExit, match=r"^0$"):
        main(["probabilities", str(tmp_path / "log")])

    assert "UNKNOWN, never seen: L2/front\n" in capsys.readouterr().err
