"""A log exported as a bag, and imported into a new log: the same doors at the same moments."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.model.doors import DoorMap, reduced
from semmap_log.core.model.events import RobotPose
from semmap_log.interop.exporting.log_files import record_bag
from tests.interop.exporting.lively import lively_log
from tests.interop.formats.bags.played import played


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x.mcap", "x.bag", "x"])
def test_what_was_exported_comes_back(name: str, tmp_path: Path) -> None:
    """At the time of each message and between them, as far as the thesis's message can say it."""
    log = lively_log(tmp_path / "log", seed=1)
    record_bag(log, tmp_path / name)
    sl.create(tmp_path / "new", tz="UTC").close()

    with pytest.raises(SystemExit) as ended:
        main(["import", str(tmp_path / "new"), str(tmp_path / name)])

    new = sl.read(tmp_path / "new")
    times = sorted({message.at_ns for message in played(tmp_path / name)})
    assert not ended.value.code
    assert len(times) > 100
    for at_ns in [*times, *((a + b) // 2 for a, b in pairwise(times))]:
        assert _said(log.replay(at=at_ns)) == _said(new.replay(at=at_ns))
    assert _poses(log) == _poses(new)


def _said(doors: DoorMap) -> str:
    """Return what a DoorMap says of these doors; as text, or no NaN would equal another."""
    return str([
        (door.door_id, door.x, door.y, door.theta, door.width, reduced(door.state), door.prob_open,
         door.prob_closed)
        for door in doors.doors.values() if door.is_placed
    ])  # fmt: skip


def _poses(log: sl.DoorLog) -> list[Any]:
    entries = log.history(kinds=[RobotPose])
    found = [(e.happened_ns, round(e.event.x, 9), round(e.event.y, 9)) for e in entries]
    return sorted(found)
