"""A join is a last-writer register of each field, in whatever order its logs are given."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.fleet.join.joined_logs import write_definition
from semmap_log.fleet.join.joining_logs import defined
from tests.fleet.join.some_robots import START_NS, SetClock, a_robot, events_of

STEP_NS = 10**6
FOR_EVER = 2**63
NAMES = ("a", "b", "c")
ROBOTS = ("r0", "r1", "r2")

deeds = st.tuples(
    st.integers(1, 4),
    st.sampled_from(["see", "see", "see", "move", "remove", "retract"]),
    st.sampled_from(NAMES),
    st.sampled_from(["open", "closed"]),
    st.integers(0, 3),
)
"""Steps since the last one, what is done, to which door, the state, and how late it is told."""
robots = st.tuples(
    st.integers(0, 3),
    st.sets(st.sampled_from(NAMES), min_size=1),
    st.lists(deeds, max_size=12),
    st.sampled_from([None, 0.0, 10.0]),
)
"""When it begins, the doors that it knows, what it does, and where its map lies (dx)."""
fleets = st.lists(robots, min_size=1, max_size=3)


@dataclass
class Told:
    """What one robot told: plain Python's record of it."""

    log_id: str
    moves_by: float | None
    events: list[dict[str, Any]] = field(default_factory=list)


def robot_logs(folder: Path, fleet: list[Any]) -> dict[str, Told]:
    """Make the logs, and note beside each what was done."""
    found = {}
    for name, (begin, doors, its_deeds, moves_by) in zip(ROBOTS, fleet, strict=False):
        clock = SetClock(START_NS + begin * STEP_NS)
        with a_robot(folder / name, clock=clock) as log:
            told = found[name] = Told(log.info.log_id, moves_by)
            clock.now_ns += STEP_NS  # the log itself was made a moment before
            live, added_ns, sights = {}, {}, []
            for i, door in enumerate(sorted(doors)):
                live[door] = log.add_door(x=float(i), y=0.0, theta=0.0, width=1.0, name=door)
                added_ns[door] = clock.now_ns
                told.events.append(_event("add", door, clock.now_ns, clock.now_ns, x=float(i)))
                clock.now_ns += STEP_NS
            for wait, what, door, state, late in its_deeds:
                clock.now_ns += wait * STEP_NS
                at = max(clock.now_ns - late * STEP_NS, added_ns.get(door, 0) + 1)
                if what == "retract" and sights:
                    event, number = sights.pop()
                    log.retract(number)
                    event["hidden_from"] = clock.now_ns
                elif door not in live or what == "retract":
                    continue
                elif what == "see":
                    log.observe(live[door], state, at=at)
                    told.events.append(_event("see", door, at, clock.now_ns, state=state.upper()))
                    sights.append((told.events[-1], log.last_event()))
                elif what == "move":
                    log.update_door(live[door], x=float(wait), y=0.0, theta=0.0, at=at)
                    told.events.append(_event("move", door, at, clock.now_ns, x=float(wait)))
                elif what == "remove":
                    log.remove_door(live.pop(door))
                    told.events.append(_event("remove", door, clock.now_ns, clock.now_ns))
    return found


def _event(what: str, door: str, at: int, recorded: int, **values: Any) -> dict[str, Any]:
    return {"what": what, "door": door, "at": at, "recorded": recorded,
            "hidden_from": None, **values}  # fmt: skip


def register(told: dict[str, Told], at: float, known: float) -> dict[str, tuple[str, float | None]]:
    """Return (state, x) of each door that is there: the last writer's, by plain sorting."""
    reference = min(told, key=lambda r: (told[r].events[0]["recorded"], told[r].log_id))
    knowers: dict[str, set[str]] = {}
    rows = []
    for robot, its in told.items():
        shift = its.moves_by if its.moves_by is not None else (0.0 if robot == reference else None)
        for place, event in enumerate(its.events):
            knowers.setdefault(event["door"], set()).add(robot)
            stamp = (min(event["at"], event["recorded"]), event["recorded"], its.log_id, place)
            rows.append((stamp, robot, shift, event))
    rows.sort(key=lambda row: row[0])
    found: dict[str, tuple[str, float | None]] = {}
    gone: set[str] = set()
    last_add = {row[3]["door"] if len(knowers[row[3]["door"]]) > 1 else (row[1], row[3]["door"]):
                row[0] for row in rows if row[3]["what"] == "add"}  # fmt: skip
    for stamp, robot, shift, event in rows:
        shared = len(knowers[event["door"]]) > 1
        key: Any = event["door"] if shared else (robot, event["door"])
        name = event["door"] if shared or len(told) == 1 else f"{robot}/{event['door']}"
        if (
            stamp[0] > at
            or event["recorded"] > known
            or (event["hidden_from"] or math.inf) <= min(known, FOR_EVER)
        ):
            continue
        state, x = found.get(name, ("UNKNOWN", None))
        if event["what"] == "see":
            state = event["state"]
        elif event["what"] in ("add", "move") and shift is not None:
            x = event["x"] + shift
        elif event["what"] == "remove" and stamp > last_add[key]:
            gone.add(name)
        found[name] = state, x
    return {name: value for name, value in found.items() if name not in gone}


def joined(folder: Path, told: dict[str, Told], order: list[str]) -> sl.DoorLog:
    frames = {r: (told[r].moves_by, 0.0, 0.0) for r in told if told[r].moves_by is not None}
    return sl.join({robot: folder / robot for robot in order}, frames=frames)  # type: ignore[arg-type]


def answer(log: sl.DoorLog, at: int | None, known: int | None) -> dict[str, Any]:
    doors = log.replay(
        at=None if at is None else f"@{at / 10**9:.9f}",
        known_at=None if known is None else f"@{known / 10**9:.9f}",
    ).doors
    return {
        str(door.name): (door.state.name, None if math.isnan(door.x) else round(door.x, 6))
        for door in doors.values()
    }


@settings(max_examples=15, deadline=None)
@given(fleets, st.integers(0, 40), st.integers(12, 40))
def test_each_field_is_the_last_writer_s(fleet: list[Any], at: int, known: int) -> None:
    """At every moment, with all that is known and with what was known then."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        told = robot_logs(folder, fleet)
        log = joined(folder, told, list(told))
        at_ns, known_ns = (START_NS + n * STEP_NS + STEP_NS // 2 for n in (at, known))

        assert register(told, math.inf, math.inf) == answer(log, None, None)
        assert register(told, at_ns, math.inf) == answer(log, at_ns, None)
        assert register(told, math.inf, known_ns) == answer(log, None, known_ns)
        assert register(told, at_ns, known_ns) == answer(log, at_ns, known_ns)


@settings(max_examples=15, deadline=None)
@given(fleets, st.randoms(use_true_random=False))
def test_order_and_copies_mean_nothing(fleet: list[Any], random: Any) -> None:
    """Commutes, idempotent: the very same events, numbers and times."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        told = robot_logs(folder, fleet)
        plain = {robot: folder / robot for robot in told}
        expected = events_of(sl.join(plain))
        shuffled = random.sample(list(plain.values()), len(plain))

        assert expected == events_of(sl.join(shuffled))
        assert expected == events_of(sl.join([*shuffled, *plain.values()]))


@settings(max_examples=10, deadline=None)
@given(fleets.filter(lambda fleet: len(fleet) > 1), st.randoms(use_true_random=False))
def test_joins_of_joins_are_the_join_of_all(fleet: list[Any], random: Any) -> None:
    """Associative, where all brackets name one reference: else the inner one's own is kept."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        plain = [folder / robot for robot in robot_logs(folder, fleet)]
        expected = events_of(sl.join(plain, reference="r0"))
        shuffled = random.sample(plain, len(plain))
        inside = random.randint(1, len(plain))
        inner = folder / "inner.join.json"
        write_definition(inner, defined(shuffled[:inside], frames={}))

        joined_again = sl.join([*shuffled[inside:], inner], reference="r0")

        assert expected == events_of(joined_again)


@settings(max_examples=15, deadline=None)
@given(robots)
def test_one_log_alone_is_itself(robot: Any) -> None:
    """Its doors, numbers and times."""
    with tempfile.TemporaryDirectory() as made:
        robot_logs(Path(made), [robot])

        alone = sl.join([Path(made) / "r0"]).replay()
        assert repr(sl.read(Path(made) / "r0").replay()) == repr(alone)
