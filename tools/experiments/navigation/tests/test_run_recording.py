"""A run in rerun's viewer: what is drawn at a moment is what the two logs say then."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from navigation.records import START_NS, Outcome, RunKey
from navigation.runs import Run, read_run
from navigation.tests.corridor import DOORS, drive
from navigation.tests.test_experiment_tables import run as run_verb
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import RobotPose
from semmap_log.core.model.moments import Moment
from semmap_log.views.palette import DEFAULT, packed
from tests.views.rerun.some_logs import Drawn

OFF = 1
"""rerun's `AggregationPolicy.Off`."""

pytestmark = pytest.mark.viewer


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Drawn]:
    """Return a run, and what was drawn of it."""
    out = tmp_path_factory.mktemp("run")
    drive(out, goals=40)
    folder = RunKey("corridor", "map", "fixed", 1).folder(out)
    run_verb("rerun", str(folder), "--to", str(out / "run.rrd"))
    return read_run(folder), Drawn(out / "run.rrd")


def value(drawn: Drawn, path: str, component: str, at_ns: int) -> Any:
    return drawn.latest(path, component, at_ns)


def test_doors_have_the_colours_of_both_logs(drawn: tuple[Run, Drawn]) -> None:
    """
    World and belief, at the start and the end of each goal; a disc where they differ.
    """
    run, picture = drawn
    differ = 0
    for at_ns in [ns for goal in run.goals for ns in (goal.sent_ns, goal.ended_ns)]:
        states = [log.replay(at=Moment(ns=at_ns)).doors for log in (run.world, run.belief)]
        for door in DOORS:
            for name, doors in zip(("world", "belief"), states, strict=True):
                colour = value(picture, f"/map/{name}/{door}", "LineStrips2D:colors", at_ns)
                assert colour == [packed(DEFAULT.of_state(DoorState(doors[door].state)))]
            is_wrong = states[0][door].state != states[1][door].state
            shown = value(picture, f"/map/wrong/{door}", "Points2D:positions", at_ns)
            assert bool(shown) == is_wrong
            differ += is_wrong
    assert differ


def test_goals_are_where_and_how_they_ended(drawn: tuple[Run, Drawn]) -> None:
    """
    In the lane, on the plan and in words.
    """
    run, picture = drawn
    for goal in run.goals:
        (place,) = value(picture, "/map/goal", "Points2D:positions", goal.sent_ns)
        assert place == pytest.approx([goal.x, goal.y], abs=1e-4)
        assert value(picture, "/goals", "StateChange:state", goal.sent_ns) == [goal.outcome.value]
        (words,) = value(picture, "/events", "TextLog:text", goal.ended_ns)
        assert f"goal {goal.number} {goal.outcome.value.replace('_', ' ')}" in words


def test_the_curves_count(drawn: tuple[Run, Drawn]) -> None:
    """
    Doors wrong as the logs differ; goals driven to in vain up to the last.
    """
    run, picture = drawn
    in_vain = [goal for goal in run.goals if goal.outcome is Outcome.AFTER_DRIVING]

    curve = "/count/goals\\ driven\\ to\\ in\\ vain"
    assert [len(in_vain)] == value(picture, curve, "Scalars:scalars", run.end_ns)
    assert [0] == value(picture, curve, "Scalars:scalars", START_NS)


def test_curves_are_drawn_as_they_are(drawn: tuple[Run, Drawn]) -> None:
    """
    A door that was wrong for less than a pixel is no half door until the end of the run.
    """
    _, picture = drawn
    for curve in ("doors\\ wrong\\ in\\ the\\ map", "goals\\ driven\\ to\\ in\\ vain"):
        policy = "SeriesLines:aggregation_policy"
        assert picture.statics[f"/count/{curve}", policy] == [OFF]


def test_every_pose_is_drawn(drawn: tuple[Run, Drawn]) -> None:
    """
    In chunks that the viewer takes.
    """
    run, picture = drawn
    poses = sum(map(len, run.belief.batches(kinds=[RobotPose])))

    assert poses > 10
    assert poses == len(picture.rows("/map/robot", "Arrows2D:origins"))
    assert picture.most_rows <= 4096


@pytest.mark.parametrize("setup", ["no_map", "no_map_star"])
def test_a_robot_without_map_believes_nothing(setup: str, tmp_path: Path) -> None:
    """
    The world's doors are drawn, and no others.
    """
    drive(tmp_path, "no_map", goals=12)
    folder = RunKey("corridor", "no_map", "fixed", 1).folder(tmp_path)
    folder.parent.rename(tmp_path / "corridor" / setup)
    moved, rrd = tmp_path / "corridor" / setup / "fixed-1", tmp_path / "run.rrd"
    run_verb("rerun", str(moved), "--to", str(rrd))

    picture = Drawn(rrd)

    assert value(picture, "/map/world/1", "LineStrips2D:colors", START_NS)
    assert not any("belief" in path or "/wrong" in path for path in picture.entities)
