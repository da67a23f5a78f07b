"""`export --markers` as a person types it: the bag, what is said of it, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorAdded
from tests.conftest import SteadyClock
from tests.interop.formats.bags.marked import doors_in, shown_after
from tests.interop.formats.bags.played import Played, played
from tests.verbs import Refuses, Verb
from tests.views.rerun.some_logs import SECOND, START, small_log


@pytest.fixture
def run(run_verb: Verb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Verb:
    """Run a verb beside a log `office` with two doors."""
    monkeypatch.chdir(tmp_path)
    small_log(tmp_path / "office")

    return run_verb


@pytest.mark.parametrize("bag", ["day.mcap", "day.bag", "day"])
@pytest.mark.parametrize("flag_first", [True, False])
def test_a_bag_of_markers_and_what_is_in_it(run: Verb, bag: str, flag_first: bool) -> None:
    """Before or behind the file's name, --markers writes it; each topic is counted."""
    arguments = ["--markers", bag] if flag_first else [bag, "--markers"]

    code, out, err = run("export", "office", *arguments)

    assert (0, "") == (code, out)
    told = (
        f"{bag}: 1 on /map, 5 on /semmap/doors, 6 on /lta_semantic_map_door_db, "
        "10 on /semmap/robot_pose, 11 on /semmap/events, "
    )
    assert err.startswith(told)
    assert {"front", "door 2"} == {
        door.label for door in doors_in(shown_after(m.message for m in _doors(bag)[1:2])).values()
    }


def _doors(bag: str) -> list[Played]:
    return [message for message in played(Path(bag)) if message.topic == "/semmap/doors"]


@pytest.mark.parametrize("bag", ["day.mcap", "day.bag", "day"])
def test_a_bag_without_markers_holds_what_a_robot_would_have_published(run: Verb, bag: str) -> None:
    """The thesis's DoorMap, the floor plan and the poses, each once; the name alone tells that."""
    code, out, err = run("export", "office", bag)

    assert (0, "") == (code, out)
    assert err.startswith(
        f"{bag}: 1 on /map, 6 on /lta_semantic_map_door_db, 10 on /semmap/robot_pose, "
    )
    assert {"/map", "/lta_semantic_map_door_db", "/semmap/robot_pose"} == {
        message.topic for message in played(Path(bag))
    }


def test_a_part_in_other_colours_and_with_probabilities(run: Verb) -> None:
    """--since and --until, --palette, --every and --default-prob."""
    code, _, _ = run(
        "export", "office", "part.mcap", "--markers", "--since", f"@{START // SECOND + 60}",
        "--until", f"@{START // SECOND + 1900}", "--palette", "colour-blind", "--every", "900",
        "--default-prob", "0.5",
    )  # fmt: skip

    messages = played(Path("part.mcap"))
    (first, *_, last) = _doors("part.mcap")
    assert 0 == code
    assert {(0xE6, 0x6B, 0x00), (0xF0, 0xE4, 0x42)} == {
        door.colour for door in doors_in(shown_after([first.message])).values()
    }
    assert [1] == list(doors_in(shown_after([last.message])))
    assert {START + 60 * SECOND} == {m.at_ns for m in messages[:3]}
    databases = [m.message for m in messages if m.topic == "/lta_semantic_map_door_db"]
    assert 0.5 == databases[0].door_db[1].prob_open


def test_doors_without_a_place_are_named(run: Verb, tmp_path: Path) -> None:
    """The first three of them."""
    with sl.create(tmp_path / "sensors", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=sl.DoorId(number)) for number in (1, 2, 3, 4)])

    code, _, err = run("export", "sensors", "x.mcap", "--markers")

    assert 0 == code
    assert "left out: 4 without a place: door 1, door 2, door 3, …" == err.splitlines()[0]


def test_many_changes_are_thinned_out_and_that_is_said(
    run: Verb, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And how to have all of them."""
    monkeypatch.setattr("semmap_log.interop.exporting.stream.MOST_DOORS_SENT", 6)

    code, _, err = run("export", "office", "x.mcap", "--markers")

    assert 0 == code
    assert "many changes: all doors come at most every 3600 s; --every 0: at each." in err


def test_what_means_nothing_is_refused(run: Verb, tmp_path: Path, refuses: Refuses) -> None:
    """With the way out, and without a file."""
    before = set(tmp_path.rglob("*"))

    refuses("""
        export office x.zip
        export office x.yaml --markers
        export office x.mcap --markers --at 12:00
        export office x --known-at 12:00
        export office x.bag --event 3
        export office x.yaml --palette default
        export office x.mcap --palette default
        export office x.yaml --since 12:00
        export office x.jsonl --every 1
        export office x.mcap --markers --every -1
        export office x.mcap --markers --every 1e300
        export office x.mcap --markers --every nan
        export office x.mcap --markers --default-prob 2
        export office office/x.mcap --markers
    """)

    assert before == set(tmp_path.rglob("*"))
