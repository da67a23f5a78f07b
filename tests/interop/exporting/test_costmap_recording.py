"""A log's costmap over time in a bag: what a player shows is what a replay gives."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.costmap_2d.costs import to_occupancy
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at
from semmap_log.errors import CostmapError, FormatError, OutputError
from semmap_log.interop.exporting.costmap_files import Which, record_costmap
from tests.conftest import SteadyClock
from tests.interop.formats.bags.played import played, seen_by_rviz
from tests.views.rerun.some_logs import SECOND, START, restless_log, room, small_log

OPTIONS = CostmapOptions(level=1, inflate_m=0.2)
FLOOR = room(1)


@pytest.mark.parametrize("name", ["x.mcap", "x.bag", "x"])
@pytest.mark.parametrize("which", ["master", "door"])
def test_at_any_moment_rviz_shows_what_a_replay_gives(
    name: str, which: Which, tmp_path: Path
) -> None:
    """The last grid with its updates is the costmap of that moment, cell for cell."""
    log = restless_log(tmp_path / "log", seed=1)
    rng = random.Random(1)

    done = record_costmap(log, tmp_path / name, OPTIONS, which=which, floor=FLOOR)

    messages = played(tmp_path / name)
    assert (len(messages), True) == (done.grids + done.updates, done.updates > 50)
    moments = sorted(rng.randrange(START, log.end_ns() + 1) for _ in range(30))
    shown = {at_ns: cells.copy() for at_ns, cells in seen_by_rviz(messages)}
    for moment in moments:
        at_ns = max(time for time in shown if time <= moment)
        costmap = costmap_at(log, OPTIONS, at=moment, floor=FLOOR)
        costs = costmap.master.costs if which == "master" else costmap.layer.costs
        np.testing.assert_array_equal(to_occupancy(costs), shown[at_ns])


def test_a_part_begins_with_the_costmap_as_it_was(tmp_path: Path) -> None:
    """The first grid stands at `since`; nothing is later than `until`."""
    log = small_log(tmp_path / "log")
    since, until = START + 900 * SECOND, START + 2000 * SECOND

    record_costmap(log, tmp_path / "x.mcap", since=since, until=until)

    messages = played(tmp_path / "x.mcap")
    expected = to_occupancy(costmap_at(log, at=since).master.costs)
    np.testing.assert_array_equal(expected, messages[0].cells)
    assert since == messages[0].at_ns
    assert messages[-1].at_ns <= until


def test_a_wrong_question_leaves_no_file(tmp_path: Path) -> None:
    """Nothing to draw, a name that tells no bag, the log's own folder."""
    sl.create(tmp_path / "empty", tz="UTC", clock=SteadyClock(START)).close()
    log = small_log(tmp_path / "log")
    before = {path.name for path in (tmp_path / "log").iterdir()}

    with pytest.raises(CostmapError, match="nothing to draw"):
        record_costmap(sl.read(tmp_path / "empty"), tmp_path / "x.mcap")
    with pytest.raises(FormatError, match="unknown extension for a new bag"):
        record_costmap(log, tmp_path / "x.zip")
    with pytest.raises(OutputError, match="own folder"):
        record_costmap(log, tmp_path / "log" / "x.mcap")

    assert before == {path.name for path in (tmp_path / "log").iterdir()}
    assert {"empty", "log"} == {path.name for path in tmp_path.iterdir()}


def test_progress_goes_up_to_the_end(tmp_path: Path) -> None:
    """It is told how much of the time has been gone through."""
    log = restless_log(tmp_path / "log", seed=2)
    told: list[tuple[int, int]] = []

    record_costmap(
        log,
        tmp_path / "x.mcap",
        OPTIONS,
        floor=FLOOR,
        progress=lambda *shares: told.append(shares),
    )

    assert sorted(told) == told
    (first, total), (last, _) = told[0], told[-1]
    assert (0, True) == (first, 0.9 * total < last <= total)
