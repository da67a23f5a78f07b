"""What a run leaves: two logs, whole or none, the same bytes each time."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from navigation.records import START_NS, Outcome, RunError, RunKey, RunRecorder
from navigation.runs import find_runs, read_run, second_of
from navigation.tests.corridor import CLOSED, DOORS, OPEN, drive, plan
from navigation.wrong_beliefs import wrong_doors, wrong_share
from semmap_log.core.model.events import DoorObserved, DoorUpdated, RobotPose
from semmap_log.log import verify

KEY = RunKey("corridor", "map", "fixed", 1)


def begun(out: Path) -> RunRecorder:
    return RunRecorder(out, KEY, plan(), {}, states=dict.fromkeys(DOORS, OPEN))


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_run_read_back_is_what_the_drive_counted(tmp_path: Path) -> None:
    """
    Outcomes in their order, times to the nanosecond, figures and parameters.
    """
    tally = drive(tmp_path, goals=40, near_m=3.0)

    run = read_run(KEY.folder(tmp_path))

    assert tally.outcomes == [goal.outcome for goal in run.goals]
    assert len(set(tally.outcomes)) == 3
    took_s = [goal.took_s for goal in run.goals if goal.outcome is Outcome.REACHED]
    assert tally.took_s == pytest.approx(took_s, abs=1e-8)
    assert (run.end_ns - START_NS) / 1e9 == pytest.approx(tally.end_s, abs=1e-8)
    assert list(range(1, 41)) == [goal.number for goal in run.goals]
    assert {"near_m": 3.0, "building": "corridor", "seed": 1}.items() <= run.parameters.items()
    assert {"free"} == {goal.kind for goal in run.goals}
    assert all(goal.figures["path_m"] >= 0 for goal in run.goals)


def test_the_map_is_wrong_where_the_drive_says_so(tmp_path: Path) -> None:
    """
    At each goal by the difference of the two logs, and over all time by their lanes.
    """
    tally = drive(tmp_path, goals=40)
    run = read_run(KEY.folder(tmp_path))

    found = [(at_s, set(wrong_doors(run, START_NS + round(at_s * 1e9)))) for at_s, _ in tally.wrong]

    assert tally.wrong == found
    assert any(doors for _, doors in found)
    whole_s = len(DOORS) * (tally.end_s - tally.begin_s)
    assert wrong_share(run) == pytest.approx(tally.wrong_s / whole_s, rel=1e-9)


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    """
    Ids, clocks and compressed segments included; another seed gives others.
    """
    for name, seed in (("one", 1), ("two", 1), ("other", 2)):
        drive(tmp_path / name, seed=seed, goals=10)

    one, two, other = (files(tmp_path / name) for name in ("one", "two", "other"))

    assert one == two
    assert any(name.endswith(".mcap") for name in one)
    assert not set(one.values()) & {b for name, b in other.items() if name.endswith(".mcap")}


def test_both_logs_are_sound_and_begin_alike(tmp_path: Path) -> None:
    """
    Same doors, same states, same parameters.
    """
    drive(tmp_path, goals=10)
    world, belief = (sl.read(KEY.folder(tmp_path) / name) for name in ("world", "belief"))

    doors = world.replay(event=7).doors
    assert dict.fromkeys(DOORS, OPEN) == {door: doors[door].state for door in doors}
    assert not verify(world.path).findings
    assert not verify(belief.path).findings
    first, second = next(world.commits()), next(belief.commits())
    assert first.note == second.note
    assert first.recorded_ns == second.recorded_ns < START_NS + 10


def test_each_log_has_an_id_of_its_own(tmp_path: Path) -> None:
    """
    World and belief, of each seed, and of other options.
    """
    for out, seed, near_m in ((tmp_path, 1, 3.0), (tmp_path, 2, 3.0), (tmp_path / "x", 1, 1.0)):
        drive(out, seed=seed, goals=2, near_m=near_m)

    ids = [sl.read(path.parent).info.log_id for path in tmp_path.rglob("*_000000.mcap")]

    assert 6 == len(ids) == len(set(ids))


def test_doors_that_changed_together_are_one_commit(tmp_path: Path) -> None:
    """
    Recorded when they changed, not when the next ones did.
    """
    with begun(tmp_path) as recorder:
        for at_s, door in ((5.0, 1), (5.0, 2), (905.0, 3)):
            recorder.door_changed(at_s, DOORS[door - 1], CLOSED)

    log = sl.read(KEY.folder(tmp_path) / "world")
    changes = list(log.history(kinds=[DoorUpdated]))
    assert [5.0, 5.0, 905.0] == [second_of(entry.happened_ns) for entry in changes]
    assert all(0 <= entry.recorded_ns - entry.happened_ns < 10**6 for entry in changes)
    assert [2, 1] == [commit.count for commit in log.commits()][1:]


def test_events_are_recorded_when_they_happened(tmp_path: Path) -> None:
    """
    A sighting counts from its own moment on, not from the end of its goal.
    """
    drive(tmp_path, goals=40)
    log = sl.read(KEY.folder(tmp_path) / "belief")

    seen = list(log.history(kinds=[DoorObserved]))

    assert seen
    assert all(0 <= entry.recorded_ns - entry.happened_ns < 10**6 for entry in seen)
    assert {"door_sensor"} == {entry.source for entry in seen}


def test_poses_are_kept_where_the_robot_moved_or_turned(tmp_path: Path) -> None:
    """
    A step below a quarter of a metre adds up; a turn over a full circle is none.
    """
    with begun(tmp_path) as recorder:
        for t, (x, theta) in enumerate(
            [(0, 0), (0.2, 0), (0.3, 0), (0.3, math.tau), (0.3, -0.1), (0.3, math.tau - 0.3)]
        ):
            recorder.pose(t, x, 0.0, theta)

    log = sl.read(KEY.folder(tmp_path) / "belief")
    (poses,) = [batch[RobotPose] for batch in log.batches(kinds=[RobotPose])]
    assert [(0, 0), (0.3, 0), (0.3, pytest.approx(math.tau - 0.3))] == [
        (pose["x"], pose["theta"]) for pose in poses
    ]


def test_a_run_that_fails_leaves_nothing(tmp_path: Path) -> None:
    """
    And what a killed one left is in nobody's way.
    """
    left = KEY.folder(tmp_path).with_name(".making_fixed-1")
    (left / "world").mkdir(parents=True)
    (left / "world" / "world_000000.mcap").write_bytes(b"half")

    with pytest.raises(RunError, match="comes after"), begun(tmp_path) as recorder:
        recorder.goal_sent(-1.0, 1, 0.0, 0.0)

    assert not files(tmp_path)
    with pytest.raises(RunError, match="found none"):
        find_runs(tmp_path)
    drive(tmp_path, goals=3)
    assert [KEY.folder(tmp_path)] == find_runs(tmp_path)


def test_a_run_that_is_being_made_is_none(tmp_path: Path) -> None:
    """
    Other runs may be read meanwhile.
    """
    with begun(tmp_path) as recorder:
        recorder.goal_sent(0.0, 1, 0.0, 0.0)
        with pytest.raises(RunError, match="found none"):
            find_runs(tmp_path)

    assert [KEY.folder(tmp_path)] == find_runs(tmp_path)


def test_a_goal_that_was_never_sent_cannot_end(tmp_path: Path) -> None:
    """
    The run and the goal are named.
    """
    with begun(tmp_path) as recorder:
        recorder.goal_ended(1.0, 7, "reached", {})

    with pytest.raises(RunError, match="fixed-1: goal 7 ended, but was never sent"):
        read_run(KEY.folder(tmp_path))


def test_a_run_that_is_there_is_not_run_again(tmp_path: Path) -> None:
    """
    Nor is it removed.
    """
    drive(tmp_path, goals=3)
    before = files(tmp_path)

    with pytest.raises(RunError, match="there already"):
        begun(tmp_path)

    assert before == files(tmp_path)


def test_time_does_not_run_backwards(tmp_path: Path) -> None:
    """
    Over both logs; NaN is no time either.
    """
    with begun(tmp_path) as recorder:
        recorder.door_changed(5.0, DOORS[0], CLOSED)
        for t in (4.9, math.nan):
            with pytest.raises(RunError, match="comes after second 5"):
                recorder.pose(t, 0.0, 0.0, 0.0)


def test_a_goal_without_end_is_none(tmp_path: Path) -> None:
    """
    The run was stopped; what was known of it stays in the log.
    """
    with begun(tmp_path) as recorder:
        recorder.goal_sent(0.0, 1, 0.0, 0.0)
        recorder.goal_ended(1.0, 1, "reached", {})
        recorder.goal_sent(1.0, 2, 0.0, 0.0)

    assert Counter({Outcome.REACHED: 1}) == Counter(
        goal.outcome for goal in read_run(KEY.folder(tmp_path)).goals
    )


def test_an_unknown_outcome_is_refused(tmp_path: Path) -> None:
    """
    Before it is written.
    """
    with begun(tmp_path) as recorder:
        recorder.goal_sent(0.0, 1, 0.0, 0.0)
        with pytest.raises(ValueError, match="lost"):
            recorder.goal_ended(1.0, 1, "lost", {})


@pytest.mark.parametrize(
    ("key", "problem"),
    [
        (("", "map", "fixed", 1), "building"),
        (("office", "a/b", "fixed", 1), "setup"),
        (("office", "map", ".fixed", 1), "series"),
        (("office", "map", "fixed", -1), "seed"),
    ],
)
def test_a_key_names_a_folder(key: tuple[str, str, str, int], problem: str) -> None:
    """
    Whatever else is refused, by its part.
    """
    with pytest.raises(RunError, match=problem):
        RunKey(*key)


def test_keys_are_read_from_folders() -> None:
    """
    Also with a minus in a name.
    """
    key = RunKey("office", "map_star", "as-fixed", 12)

    assert key == RunKey.of(key.folder(Path("out")))
    with pytest.raises(RunError, match="expected a folder"):
        RunKey.of(Path("out/office/map/fixed"))


def test_other_logs_are_no_runs(tmp_path: Path) -> None:
    """
    The message says whose first commit was found.
    """
    folder = KEY.folder(tmp_path)
    folder.mkdir(parents=True)
    for name in ("world", "belief"):
        with sl.create(folder / name, tz="UTC") as log:
            log.add_door(actor="survey")

    with pytest.raises(RunError, match="survey"):
        read_run(folder)


@dataclass
class Told:
    """A goal as somebody tells of it."""

    outcome: Outcome
    took_s: float
    pause_s: float
    steps: int
    sees: bool
    figures: dict[str, float]


SECONDS = st.floats(0, 1e5, allow_subnormal=False)
TOLD = st.builds(
    Told, st.sampled_from(Outcome), SECONDS, SECONDS, st.integers(0, 3), st.booleans(),
    st.dictionaries(st.sampled_from(["drove_s", "path_m"]), st.floats(0, 1e9)),
)  # fmt: skip


@given(told=st.lists(TOLD, max_size=6), ends=st.booleans())
@settings(max_examples=20)
def test_whatever_is_told_of_goals_is_read_back(told: list[Told], *, ends: bool) -> None:
    """
    However they end, whatever is seen on the way; the last may have no end.
    """
    with TemporaryDirectory() as folder:
        with begun(Path(folder)) as recorder:
            at_s, sent_ns = 0.0, []
            for number, goal in enumerate(told, start=1):
                at_s += goal.pause_s
                sent_ns.append(START_NS + round(at_s * 1e9))
                recorder.goal_sent(at_s, number, number / 3, -1.0, kind="free")
                for step in range(goal.steps):
                    recorder.pose(at_s, float(step), 0.0, 0.0)
                if goal.sees:
                    recorder.sighted(at_s, DOORS[0], CLOSED)
                at_s += goal.took_s
                if number < len(told) or ends:
                    recorder.goal_ended(at_s, number, goal.outcome, goal.figures)
        goals = read_run(KEY.folder(Path(folder))).goals

    expected = told if ends else told[:-1]
    assert [goal.outcome for goal in expected] == [goal.outcome for goal in goals]
    assert [goal.figures for goal in expected] == [goal.figures for goal in goals]
    assert sent_ns[: len(goals)] == [goal.sent_ns for goal in goals]
    assert [(number / 3, -1.0) for number in range(1, len(goals) + 1)] == [
        (goal.x, goal.y) for goal in goals
    ]
