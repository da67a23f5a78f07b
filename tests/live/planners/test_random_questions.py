"""Random actions and questions: the oracle does what a dictionary would, and so does its log."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

import semmap_log as sl
from tests.live.planners.asker import Asker

DOORS = range(1, 5)
_doors = st.integers(0, 5)
_shares = st.sampled_from([0.0, 1.0, 0.25, 1.5, -1.0])
_steps = st.lists(
    st.tuples(st.sampled_from(["SET_DOOR_OPEN", "SET_DOOR_CLOSED", "REMOVE_DOOR"]), _doors,
              st.none())
    | st.tuples(st.sampled_from(["SET_OPEN_PROBABILITY", "SET_CLOSED_PROBABILITY"]), _doors,
                _shares),
    max_size=12,
)  # fmt: skip


class Model:
    """The doors as a dictionary: state, P(open), P(closed)."""

    def __init__(self) -> None:
        self.doors: dict[int, list[object]] = {i: ["UNKNOWN", None, None] for i in DOORS}

    def act(self, name: str, door: int, share: float | None) -> str:
        if door not in self.doors or not (share is None or 0 <= share <= 1):
            return "NIL"
        if name == "REMOVE_DOOR":
            del self.doors[door]
        elif share is None:
            self.doors[door][0] = name.removeprefix("SET_DOOR_")
        else:
            self.doors[door][1 + (name == "SET_CLOSED_PROBABILITY")] = share
        return "T"

    def answers(self) -> dict[str, str]:
        found = {}
        for i in DOORS:
            state, p_open, p_closed = self.doors.get(i, ["GONE", None, None])
            found[f"DOOR_OPEN DOOR_{i}"] = "T" if state == "OPEN" else "NIL"
            found[f"DOOR_STATE_KNOWN DOOR_{i}"] = "T" if state in ("OPEN", "CLOSED") else "NIL"
            found[f"PROBABILITY_DOOR_OPEN DOOR_{i}"] = "NIL" if p_open is None else repr(p_open)
            found[f"PROBABILITY_DOOR_CLOSED DOOR_{i}"] = (
                "NIL" if p_closed is None else repr(p_closed)
            )
        closed = [i for i, (state, *_) in self.doors.items() if state == "CLOSED"]
        found["GET_CLOSED_DOOR"] = f"DOOR_{min(closed)}" if closed else "NIL"
        return found


@given(_steps)
def test_a_planner_is_answered_as_by_a_dictionary(
    steps: list[tuple[str, int, float | None]],
) -> None:
    """After each action; at the end, of each moment before, by event; and by the next server."""
    with tempfile.TemporaryDirectory() as folder:
        path, model = Path(folder) / "log", Model()
        with sl.create(path, tz="UTC", durability="none") as log:
            for _ in DOORS:
                log.add_door()
        ask, after = Asker(path), {}
        for name, door, share in steps:
            words = f"{name} DOOR_{door}" + ("" if share is None else f" {share}")
            assert model.act(name, door, share) == ask(words)
            now = model.answers()
            assert now == {each: ask(each) for each in now}
            after[ask.doors.door_map().event] = now
        for event, then in after.items():
            assert then == {each: ask(f"{each} event:{event}") for each in then}
            assert then == {each: ask(f"BELIEVED {each} AT event:{event}") for each in then}
        ask.close()
        again = Asker(path)
        assert model.answers() == {each: again(each) for each in model.answers()}
        again.close()
