"""Commands with ids, of every kind: what an earlier version stored of them must be known again.

`tests/golden/sent_commands` holds them as an earlier version stored them, and its answers.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Any

import numpy as np

import semmap_log as sl
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorUpdated, FloorMap, LevelAdded
from semmap_log.core.model.meaning import Changed

ROUND = sl.Note(actor="robot", source="camera", reason="round 4", correlation="4")
DAY_NS = 1_772_323_200 * 10**9
"""2026-03-01, UTC."""


def _floor() -> FloorMap:
    cells = np.array([[0, 100, -1], [0, 0, 100]], np.int8)
    return FloorMap(
        level=1, resolution=0.05, origin_x=-1.0, origin_y=2.0, origin_theta=0.3, cells=cells
    )


COMMANDS: tuple[Callable[[sl.DoorLogWriter, bytes], Any], ...] = (
    lambda log, i: log.append([LevelAdded(level=1, name="ground", elevation=0.0)], command_id=i),
    lambda log, i: log.append([_floor()], note=sl.Note(actor="survey"), command_id=i),
    lambda log, i: log.add_door(command_id=i),
    lambda log, i: log.add_door(
        x=1.0, y=2.5, theta=0.25, width=0.9, level="ground", state="closed", prob_open=0.25,
        prob_closed=0.75, name="front", at=DAY_NS, actor="survey", command_id=i,
    ),
    lambda log, i: log.add_door(
        door_id=sl.DoorId(7), x=2, y=2, theta=0, width=1, level=1, name="side",
        at="2026-03-01T00:00", reason="new", command_id=i,
    ),
    lambda log, i: log.update_door("front", state="open", command_id=i),
    lambda log, i: log.update_door(
        "ground/front", x=1.5, y=2.0, theta=0.5, level=1, width=0.8, state=sl.DoorState.CLOSED,
        prob_open=0.5, prob_closed=0.5, at=datetime(2026, 3, 1, 1), source="tape", command_id=i,
    ),
    lambda log, i: log.observe("front", "open", command_id=i),
    lambda log, i: log.observe(
        2, sl.DoorState.CLOSED, accuracy=0.9, accuracy_open=0.8, accuracy_closed=0.95,
        opening=0.125, at="1h ago", actor="robot", source="laser", reason="round 4",
        correlation="4", command_id=i,
    ),
    lambda log, i: log.observe(np.uint32(2), np.uint8(1), accuracy=np.float32(0.75), command_id=i),
    lambda log, i: log.annotate("front", "kind", "sliding", command_id=i),
    lambda log, i: log.annotate("front", "name", "main", at=DAY_NS + 1, command_id=i),
    lambda log, i: log.request("main", "open", actor="guard", command_id=i),
    lambda log, i: log.passed(2, command_id=i),
    lambda log, i: log.passed("main", passed=False, waited_s=3.5, command_id=i),
    lambda log, i: log.start_patrol(reason="night", command_id=i),
    lambda log, i: log.finish_patrol(command_id=i),
    lambda log, i: log.start_patrol(command_id=i),
    lambda log, i: log.retract(7, command_id=i),
    lambda log, i: log.retract(8, 9, reason="the laser was dirty", command_id=i),
    lambda log, i: log.remove_door("side", command_id=i),
    lambda log, i: log.append(
        [
            DoorObserved(door_id=sl.DoorId(2), state=sl.DoorState.OPEN, accuracy_open=0.75),
            DoorUpdated(door_id=sl.DoorId(2), changed=Changed.STATE, state=sl.DoorState.CLOSED),
        ],
        note=ROUND, command_id=i,
    ),
    lambda log, i: log.append(
        sl.EventBatch.of(DoorObserved, door_id=[1, 2], state=1, happened_ns=DAY_NS + 5),
        command_id=i,
    ),
    lambda log, i: log.append(
        (event for event in [DoorAdded(door_id=sl.DoorId(9))]), content=bytes(range(16)),
        command_id=i,
    ),
    lambda log, i: log.append_made(
        lambda: [DoorAdded(door_id=sl.DoorId(10))], note=ROUND,
        content=bytes(16), command_id=i,
    ),
    lambda log, i: log.remove_door("main", at="now", command_id=i),
)  # fmt: skip
"""Each sends one command with the id that it is given, and returns the answer."""


def send(log: sl.DoorLogWriter) -> list[Any]:
    """Send all of them, in order; return the answers: doors, numbers, and where they are stored."""
    return [
        _plain(command(log, bytes([number]) * 16)) for number, command in enumerate(COMMANDS, 1)
    ]


def _plain(answer: Any) -> Any:
    """Return an answer without whether it was given before."""
    if isinstance(answer, tuple):
        return tuple(map(_plain, answer))
    if hasattr(answer, "commit"):
        return answer.first_event, answer.count, answer.poses, answer.commit.hash.hex()
    return int(answer)
