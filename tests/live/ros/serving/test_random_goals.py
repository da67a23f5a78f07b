"""Random goals: the server does what a dictionary would."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from itertools import count

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.model.doors import Door
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver
from tests.live.ros.serving.door_servers import events_in
from tests.live.ros.serving.goals import DOOR, FIELDS, goal_of

NAN, INF = math.nan, math.inf

_ids = st.sampled_from([0, 1, 2, 3, 4, 2**32, 2**64 - 1])
_numbers = st.sampled_from([0.0, 1.0, -1.5, 0.25, NAN, INF, -INF, 1.2])
_texts = st.sampled_from(["OPEN", "CLOSED", "UNKNOWN", "ajar", "", "open"])
_values = {"pos_x": _numbers, "pos_y": _numbers, "pos_theta": _numbers, "width": _numbers,
           "door_state": _texts, "prob_open": _numbers, "prob_closed": _numbers}  # fmt: skip
_goals = st.one_of(
    st.tuples(st.just("AddDoor"), st.fixed_dictionaries(_values)),
    st.tuples(
        st.just("UpdateDoor"),
        st.fixed_dictionaries({"door_id": _ids, **dict.fromkeys(FIELDS, st.booleans()), **_values}),
    ),
    st.tuples(st.just("RemoveDoor"), st.fixed_dictionaries({"door_id": _ids})),
    st.tuples(
        st.just("AddDoor"), st.fixed_dictionaries({**_values}).map(lambda some: {**some, **DOOR})
    ),
)


class Model:
    """The thesis's server as a dictionary: what the booleans and the doors ought to be."""

    def __init__(self) -> None:
        self.doors: dict[int, dict[str, object]] = {}
        self.used = 0

    def run(self, action: str, values: dict[str, object]) -> bool:
        if action == "AddDoor":
            if not _is_good(values, list(FIELDS)):
                return False
            self.used += 1
            self.doors[self.used] = {name: values[name] for name in DOOR}
            self._mend(self.doors[self.used])
            return True
        if values["door_id"] not in self.doors:
            return False
        if action == "RemoveDoor":
            del self.doors[values["door_id"]]
            return True
        flags = [flag for flag in FIELDS if values[flag]]
        if not _is_good(values, flags):
            return False
        names = [name for flag in flags for name in FIELDS[flag][1]]
        given = {name: values[name] for name in names
                 if not (name.startswith("prob") and math.isnan(values[name]))}  # fmt: skip
        door = self.doors[values["door_id"]]
        door.update(given)
        self._mend(door)
        return True

    @staticmethod
    def _mend(door: dict[str, object]) -> None:
        known = str(door["door_state"]).upper()
        door["door_state"] = known if known in {"OPEN", "CLOSED"} else "UNKNOWN"


def _is_good(values: dict[str, object], flags: list[str]) -> bool:
    def is_share(value: float) -> bool:
        return math.isnan(value) or 0 <= value <= 1

    rules = {
        "change_pos": all(math.isfinite(values[name]) for name in ("pos_x", "pos_y", "pos_theta")),
        "change_width": math.isfinite(values["width"]) and values["width"] >= 0,
        "change_open": True,
        "change_prob_open": is_share(values["prob_open"]),
        "change_prob_closed": is_share(values["prob_closed"]),
    }
    return all(rules[flag] for flag in flags)


def _as_values(door: Door) -> dict[str, object]:
    return {"pos_x": door.x, "pos_y": door.y, "pos_theta": door.theta, "width": door.width,
            "door_state": door.state.name, "prob_open": door.prob_open,
            "prob_closed": door.prob_closed}  # fmt: skip


_numbered: Callable[[], int] = count().__next__


@settings(max_examples=60, deadline=None)
@given(st.lists(_goals, max_size=12))
def test_random_goals_do_what_a_dictionary_would(
    tmp_path_factory: pytest.TempPathFactory, goals: list[tuple[str, dict[str, object]]]
) -> None:
    """Each boolean is true to what the log says, and an aborted goal has a text and no event."""
    path = tmp_path_factory.mktemp("model") / "log"
    sl.create(path, tz="UTC", durability="none").close()
    server = DoorServer(lambda: sl.append(path, durability="none"), DoorSaver(None, path))
    model = Model()

    for action, values in goals:
        before = events_in(server)
        expected = model.run(action, values)
        outcome = server.run(goal_of(action, f"goal {_numbered()}", **values))

        (result,) = outcome.result.values()
        assert (expected, expected) == (outcome.succeeded, bool(result))
        assert expected or (outcome.text and before == events_in(server))

    server.close()
    doors = {int(i): _as_values(door) for i, door in sl.read(path).replay().doors.items()}
    assert json.dumps(model.doors, sort_keys=True) == json.dumps(doors, sort_keys=True)
