"""What is told of doors before they were added: said at once, and how it is put right."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import learn
from semmap_log.cli import main
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, Retracted
from semmap_log.core.model.moments import parse_instant
from semmap_log.errors import DoorExistsError, DoorRemovedError, EarlyEventsWarning
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.importing.present_log import backdate
from semmap_log.log.door_log.read_log import open_any
from semmap_log.log.replay.state import state_at
from tests.conftest import SteadyClock

Run = Callable[..., tuple[int, str, str]]

LAST_WEEK = "2026-02-20T08:00Z"
"""The steady clock begins on 2026-03-01."""


def _ns(text: str) -> int:
    return parse_instant(text, tz="UTC")


def _told(log: sl.DoorLogWriter, door: DoorId, count: int = 6) -> None:
    """Tell of last week, each hour: CLOSED, OPEN, CLOSED, OPEN …, without warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EarlyEventsWarning)
        for hour in range(count):
            state = "open" if hour & 1 else "closed"
            log.observe(door, state, accuracy=0.9, at=f"2026-02-20T{8 + hour:02}:00Z")


@pytest.fixture
def log(tmp_path: Path, clock: SteadyClock) -> Iterator[sl.DoorLogWriter]:
    with sl.create(tmp_path / "office", tz="UTC", clock=clock) as log:
        yield log


def test_it_is_said_at_once_and_again_when_it_is_much_more(log: sl.DoorLogWriter) -> None:
    """The first event, then the tenth, then the end: not a line for each of a million."""
    front = log.add_door(name="front")
    side = log.add_door()

    with pytest.warns(EarlyEventsWarning) as told:  # noqa: PT031 - over all of it
        for hour in range(12):
            log.observe((front, side)[hour & 1], "open", at=f"2026-02-20T{8 + hour:02}:00")
        log.observe(front, "open")
        log.close()

    texts = [str(each.message) for each in told]
    assert 3 == len(texts)
    assert texts[0].startswith("1 event of 1 door (front), from 2026-02-20 08:00:00+00:00 on, ")
    assert texts[1].startswith("10 events of 2 doors (front, door 2), from ")
    assert texts[2].startswith("12 events of 2 doors")
    assert texts[0].endswith(f"semmap-log import {log.path} --since-ever")
    assert {__file__} == {each.filename for each in told}  # where the call is, not inside of ours


def test_it_is_said_of_a_door_that_came_after_others_were_seen(log: sl.DoorLogWriter) -> None:
    """When doors were added is looked up once as long as none comes; the next one counts, too."""
    seen = {"state": DoorState.OPEN, "happened_ns": _ns("2026-02-15")}
    first = log.add_door(at="2026-02-10")
    log.append([DoorObserved(door_id=first, **seen)])

    second = log.add_door(at="2026-02-20")
    with pytest.warns(EarlyEventsWarning, match="door 2"):
        log.append([DoorObserved(door_id=door, **seen) for door in (first, second)])


def test_nothing_is_said_of_what_counts(log: sl.DoorLogWriter) -> None:
    """Events after the adding, requests, and events without a time."""
    door = log.add_door(at=LAST_WEEK)
    with warnings.catch_warnings():
        warnings.simplefilter("error", EarlyEventsWarning)
        log.observe(door, "open", at=LAST_WEEK)
        log.observe(door, "open")
        log.request(door, "open", at="2026-02-01")
        log.append([DoorAdded(door_id=DoorId(2)), DoorObserved(door_id=DoorId(2),
                                                               state=DoorState.OPEN)])  # fmt: skip
        log.close()

    assert {} == log.early_events().counts


def test_updates_and_words_are_told_of_as_sightings_are(log: sl.DoorLogWriter) -> None:
    """Whatever says something of a door, in a commit of its own or among others."""
    door = log.add_door()

    with pytest.warns(EarlyEventsWarning, match="^1 event of 1 door"):
        log.update_door(door, state="open", at=LAST_WEEK)
    log.annotate(door, "floor", "oak", at=LAST_WEEK)
    seen = DoorObserved(door_id=DoorId(2), state=DoorState.OPEN, happened_ns=_ns(LAST_WEEK))
    log.append([DoorAdded(door_id=DoorId(2)), seen])
    with pytest.warns(EarlyEventsWarning, match="^3 events of 2 doors"):
        log.close()

    assert {1: 2, 2: 1} == log.early_events().counts


def test_columns_are_told_as_events_are(log: sl.DoorLogWriter) -> None:
    """The same count, of the same doors, for a commit of columns and for the whole log."""
    doors = [log.add_door(), log.add_door(at=LAST_WEEK), log.add_door()]
    begin = _ns(LAST_WEEK)
    times = [begin + hour * 3600 * 10**9 for hour in range(-3, 3)]
    batch = sl.EventBatch.of(
        DoorObserved, door_id=doors * 2, state=DoorState.OPEN, happened_ns=times
    )

    with pytest.warns(EarlyEventsWarning, match=r"^5 events of 3 doors \(door 1, door 2, door 3\)"):
        log.append(batch)

    assert {1: 2, 2: 1, 3: 2} == log.early_events().counts


def test_an_import_says_it(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """A door CSV about doors that a building brought a week later."""
    log.add_door(name="front")
    rows = tmp_path / "history.csv"
    rows.write_text("timestamp,door,state,accuracy\n" + "".join(
        f"2026-02-20T{8 + i:02}:00:00Z,{door},OPEN,0.9\n"
        for i in range(5) for door in ("front", "new")
    ))  # fmt: skip

    with pytest.warns(EarlyEventsWarning, match=r"^5 events of 1 door \(front\)"):
        import_file(log, rows, ImportOptions(new_doors=True))


def test_info_flags_it_until_it_is_put_right(log: sl.DoorLogWriter) -> None:
    """With the line that does it."""
    door = log.add_door(name="front")
    _told(log, door)
    (warning,) = open_any(log.path).summary().warnings
    assert warning.startswith("6 events of 1 door (front), from 2026-02-20 08:00:00+00:00 on")
    assert warning.endswith("--since-ever")

    backdate(log, _ns("2026-02-01"))

    assert [] == open_any(log.path).summary().warnings


def test_a_door_is_there_since_an_earlier_time(log: sl.DoorLogWriter) -> None:
    """What was told of then counts now, for every question; what was known before stays known."""
    door = log.add_door(
        x=1, y=2, theta=0, width=1, state="open", prob_open=0.7, name="front", actor="survey"
    )
    _told(log, door)
    before_ns, added_ns = log.now_ns(), log.entry(0).happened_ns
    was = log.replay()[door]

    done = backdate(log, _ns("2026-02-01"), note=sl.Note(reason="it was always there"))

    assert ("doors: 1 that the log has, there since 2026-02-01 00:00:00+00:00",) == (
        done.plan.summary
    )
    now = log.replay()[door]
    assert (was.state, was.name, was.pose, was.prob_open) == (now.state, now.name, now.pose,
                                                              now.prob_open)  # fmt: skip
    then = log.replay(at="2026-02-20T09:30")[door]
    assert (DoorState.OPEN, "front", 1.0) == (then.state, then.name, then.x)
    assert then.prob_open != then.prob_open  # it came with the adding, and is of that time
    assert {} == dict(log.replay(at="2026-02-20T09:30", known_at=before_ns).doors)
    assert {} == dict(log.replay(at="2026-01-31").doors)
    timeline = log.timeline(door)
    assert [0, 2, 1, 2, 1, 2, 1] == timeline.state.tolist()
    assert added_ns > timeline.start_ns[-1]  # the state that it was added with is the last one's
    assert 6 == len(learn(log, at="2026-02-21").evidence.door(door, _ns("2026-02-21")).seen_ns)
    hidden = [entry.number for entry in log.history(door) if entry.retracted]
    assert [0, 1] == hidden
    again = [entry for entry in log.history(door, kinds=[DoorAdded]) if not entry.retracted]
    assert ["it was always there"] == [entry.reason for entry in again]


def test_the_answer_is_the_same_without_keyframes(tmp_path: Path, clock: SteadyClock) -> None:
    """A keyframe that rests on the retracted adding is not used."""
    path = tmp_path / "office"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EarlyEventsWarning)
        with sl.create(path, tz="UTC", clock=clock) as log:
            door = log.add_door(name="front")
            _told(log, door)
    with sl.append(path, clock=clock) as log:  # its segment begins with a keyframe
        backdate(log, _ns("2026-02-01"))
    with sl.append(path, clock=clock) as log:
        log.observe(door, "closed")

    reader = sl.read(path)._reader
    for at_ns in (None, _ns("2026-02-20T09:30")):
        with_them = state_at(reader, at_ns=at_ns).door_map()
        without = state_at(reader, at_ns=at_ns, uses_keyframes=False).door_map()
        assert repr(with_them) == repr(without)  # NaN equals nothing
        assert {door} == set(with_them.doors)


def test_what_is_told_of_that_very_moment_counts(log: sl.DoorLogWriter) -> None:
    """Of two events of one time the later number would win, and be the adding."""
    door = log.add_door()
    _told(log, door)

    backdate(log, _ns(LAST_WEEK))

    assert DoorState.CLOSED is log.replay(at=LAST_WEEK)[door].state
    assert {} == log.early_events().counts


def test_it_can_be_moved_again(log: sl.DoorLogWriter) -> None:
    """To a still earlier time; a door that was there by then is left alone."""
    door = log.add_door(name="front")
    _told(log, door)
    assert backdate(log, _ns("2026-02-20T10:00")).plan.count
    assert 2 == len(log.early_events())

    assert backdate(log, _ns("2026-02-10")).plan.count
    assert 0 == backdate(log, _ns("2026-02-15")).plan.count

    assert [door] == list(log.replay(at="2026-02-10").doors)
    assert 1 == sum(not entry.retracted for entry in log.history(door, kinds=[DoorAdded]))


def test_an_id_is_used_again_for_a_correction_only(log: sl.DoorLogWriter) -> None:
    """Retracted and told again in one commit, at an earlier time; nothing else."""
    log.add_door(at="2026-02-20")
    added = DoorAdded(door_id=DoorId(1), happened_ns=_ns("2026-02-10"))
    taken_back = Retracted(first_event=0, last_event=0)

    with pytest.raises(DoorExistsError):
        log.append([added])
    for later in (_ns("2026-02-21"), None):
        with pytest.raises(DoorRemovedError, match="with its id and an earlier time"):
            log.append([taken_back, DoorAdded(door_id=DoorId(1), happened_ns=later)])
    with pytest.raises(DoorExistsError):
        log.append([taken_back, added, added])
    assert 1 == log.append([taken_back, added]).first_event
    log.retract(2)
    with pytest.raises(DoorRemovedError, match="never used twice"):
        log.append([added])


BUILDING = """
name: house
levels:
  L1:
    elevation: 0.0
    measurements:
      - [0, 1, {distance: [3, 4.0]}]
    vertices:
      - [0.0, 0.0, 0.0, ""]
      - [20.0, 0.0, 0.0, ""]
      - [40.0, 0.0, 0.0, ""]
    doors:
      - [0, 1, {name: [1, front], type: [1, hinged], motion_axis: [1, left],
                motion_degrees: [3, 90.0], motion_direction: [2, 1]}]
      - [1, 2, {name: [1, side], type: [1, hinged], motion_axis: [1, left],
                motion_degrees: [3, 90.0], motion_direction: [2, 1]}]
    walls:
      - [0, 1, {alpha: [3, 1.0], texture_name: [1, default], texture_scale: [3, 1.0]}]
"""


def _building(folder: Path) -> Path:
    path = folder / "house.building.yaml"
    path.write_text(BUILDING)
    return path


@pytest.mark.parametrize("is_there", [False, True], ids=["new", "imported before"])
def test_a_building_since(log: sl.DoorLogWriter, tmp_path: Path, *, is_there: bool) -> None:
    """
    Doors, names, level and floor plan from that time on, whether they are new or a correction.
    """
    path = _building(tmp_path)
    if is_there:
        import_file(log, path)
    options = ImportOptions(since_ns=_ns("2026-02-01"))

    assert import_file(log, path, options).first_event is not None

    assert import_file(log, path, options).known_before
    then = log.replay(at="2026-02-01")
    assert ["front", "side"] == [door.name for door in then.doors.values()]
    assert ["L1"] == [level.name for level in then.levels.values() if level.floor_map_event]
    assert log.floor_map(1, at="2026-02-01") is not None
    assert {} == dict(log.replay(at="2026-01-31").doors)
    assert {1, 2} == log.replay().doors.keys()


def test_states_of_a_door_database_stay_of_their_time(
    log: sl.DoorLogWriter, tmp_path: Path
) -> None:
    """That a door was there in January tells not that it was open then."""
    path = tmp_path / "doors.yaml"
    path.write_text(
        "1:\n  position: {x: 1.0, y: 2.0, theta: 0.0}\n  width: 0.9\n  status: OPEN\n"
        "  open_prob: 0.7\n  closed_prob: 0.3\n"
    )
    import_file(log, path, ImportOptions(since_ns=_ns("2026-01-01"), at_ns=_ns("2026-02-01")))

    (then,) = log.replay(at="2026-01-15").doors.values()
    (now,) = log.replay().doors.values()
    assert (DoorState.UNKNOWN, 1.0) == (then.state, then.x)
    assert (DoorState.OPEN, 0.7, _ns("2026-02-01")) == (now.state, now.prob_open, now.last_seen_ns)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a verb beside `house.building.yaml`, with lines on standard input."""
    monkeypatch.chdir(tmp_path)
    _building(tmp_path)

    def run(*arguments: object, lines: str = "") -> tuple[int, str, str]:
        code = 0
        with (tmp_path / "lines").open("w+") as stdin:
            stdin.write(lines)
            stdin.seek(0)
            monkeypatch.setattr("sys.stdin", stdin)
            try:
                main([str(argument) for argument in arguments])
            except SystemExit as left:
                code = left.code if isinstance(left.code, int) else 1
        return (code, *capsys.readouterr())

    return run


LINES = "".join(
    json.dumps({"kind": "DoorObserved", "door": "front", "state": state,
                "happened": f"2026-02-20T{hour:02}:00:00Z"}) + "\n"
    for hour, state in ((8, "OPEN"), (9, "CLOSED"))
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.filterwarnings("default::semmap_log.errors.EarlyEventsWarning")
@pytest.mark.usefixtures("terminal")
def test_from_the_warning_to_the_right_answer(run: Run) -> None:
    """A building, last week's sightings, the line that the warning tells."""
    run("init", "office", "--tz", "UTC")
    assert 0 == run("import", "office", "house.building.yaml")[0]
    code, _, err = run("record", "office", lines=LINES)
    assert 0 == code
    assert "2 events of 1 door (front)" in err
    assert "2 events of 1 door (front)" in " ".join(run("info", "office")[1].split())
    line = err.rpartition("semmap-log import ")[2].splitlines()[0].split()

    code, out, err = run("import", *line)

    assert (0, "") == (code, err)
    assert "1 that the log has, there since 2026-02-20 07:59:59+00:00" in out
    assert "nothing looks wrong" in run("info", "office")[1]
    rows = json.loads(run("timeline", "office", "front", "--json")[1])
    assert ["UNKNOWN", "OPEN", "CLOSED"] == [row["state"] for row in rows["intervals"]]
    code, out, _ = run("import", "office", "--since-ever")
    assert (0, True) == (code, "nothing to do" in out)
    assert 0 == run("verify", "office")[0]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--since", "2026-01-01", "--since-ever"], 2, "give one of the two"),
        ([], 2, "give at least one file"),
        (["--since", "2200-01-01"], 1, "expected a time up to now"),
        (["--since", "event:0"], 1, "--since: expected a time, got an event number"),
        (["history.csv", "--at", "event:0"], 1, "--at: expected a time, got an event number"),
        (["-"], 2, "standard input is what `record` reads"),
        (["history.csv", "--since", "2026-01-01"], 1, "its events say when they were"),
        (["--since-ever", "--dry-run"], 2, "shows what a file would bring"),
    ],
)
def test_what_makes_no_sense_is_refused(
    run: Run, arguments: list[str], code: int, message: str
) -> None:
    """Before anything is written."""
    run("init", "office", "--tz", "UTC")

    got, _, err = run("import", "office", *arguments)

    assert (code, True) == (got, message in " ".join(err.replace("│", " ").split()))
    assert -1 == sl.read("office").replay().event


def test_a_log_without_events_knows_no_ever(run: Run) -> None:
    """It says so, and what to do."""
    run("init", "office", "--tz", "UTC")

    code, _, err = run("import", "office", "house.building.yaml", "--since-ever")

    assert 0 == code
    assert "the log has no events yet" in err
