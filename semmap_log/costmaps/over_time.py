"""A level's costmap over time: one after the other of a log's past, or live beside a writer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from semmap_log.batches.event_batch import EventBatch
from semmap_log.costmap_2d.grid import CellWindow
from semmap_log.costmaps.level_costmap import (
    Costmap,
    CostmapOptions,
    Point,
    costmap_at,
    ends_of,
    geometry_of,
    level_drawn,
)
from semmap_log.domain.doors import DoorMap
from semmap_log.domain.events import POSE_KINDS, SETTING_KINDS, FloorMap, Retracted
from semmap_log.domain.keywords import knows_keywords
from semmap_log.door_log.door_log import DoorLog, Time
from semmap_log.replay.replay import Scope


@dataclass(frozen=True, slots=True)
class CostmapFrame:
    """A moment at which the costmap changed."""

    at_ns: int
    """Happened time; live, when the commit was recorded."""
    event: int
    """Number of the last event in it."""
    windows: Sequence[CellWindow]
    """Where cells of the master may have changed."""
    costmap: Costmap
    """To look at: it goes on with the next frame."""


@knows_keywords
def costmap_frames(
    log: DoorLog,
    options: CostmapOptions = CostmapOptions(),
    *,
    since: Time = None,
    until: Time = None,
    floor: FloorMap | None = None,
) -> Iterator[CostmapFrame]:
    """Yield the costmap at `since`, then at each later moment at which something changed.

    What counts is what was true, with all that is known today: late events come in their place.

    Args:
        log: Where the doors are from.
        options: Which level, and what is drawn how.
        since: Default: before the first event.
        until: The last moment; default: the log's end.
        floor: As for `costmap_at`; the log's own is that of the last moment.

    Raises:
        CostmapError: As for `costmap_at`.
        UnknownLevelError: As for `costmap_at`.
    """
    first_ns, end_ns = log.instant(since), log.instant(until)
    first_ns = _first_ns(log) if first_ns is None else first_ns
    end_ns = log.end_ns() if end_ns is None else end_ns
    state = log.state_in(log.scope(at=first_ns))
    doors = log.replay(at=end_ns)
    level = level_drawn(options, doors)
    floor = floor or log.floor_of(doors, level)
    later = list(log.batches(first_ns + 1, end_ns + 1, kinds=SETTING_KINDS))
    points = [*ends_of(state.door_map(), level), *_places(later, level, state.door_map())]
    costmap = Costmap(state, geometry_of(floor, points, level, options), floor, level, options)
    yield CostmapFrame(first_ns, state.event, [costmap.geometry.whole], costmap)
    for at_ns, batches in _in_order(later):
        windows = costmap.advance(batches)
        if windows:
            yield CostmapFrame(at_ns, state.event, windows, costmap)


@knows_keywords
def costmap_live(
    log: DoorLog,
    options: CostmapOptions = CostmapOptions(),
    *,
    floor: FloorMap | None = None,
    poll_s: float = 0.1,
    stop: Callable[[], bool] | None = None,
) -> Iterator[CostmapFrame]:
    """Yield the costmap of now, then one for each commit that changes it, while another writes.

    What a retraction takes back is gone with the retraction's commit. The grid stays as it is at
    the beginning; a floor map that is logged later is drawn when this is called anew.

    Args:
        log: Where the doors are from; it stays as it was opened.
        options: Which level, and what is drawn how.
        floor: As for `costmap_at`.
        poll_s: How long to wait before looking again, when nothing was new.
        stop: Asked before each look; once it says yes, what is there then is the end.

    Raises:
        CostmapError: As for `costmap_at`.
        UnknownLevelError: As for `costmap_at`.
        LogError: As for `DoorLog.follow`.
    """
    costmap = costmap_at(log, options, floor=floor)
    known = costmap.doors
    yield CostmapFrame(known.latest_ns, known.event, [costmap.geometry.whole], costmap)
    for followed in log.follow(known.event, poll_s=poll_s, stop=stop):
        commit, batch = followed.commit, followed.batch
        if Retracted in batch:
            windows = costmap.show(log.opened_anew().state_in(Scope(event=commit.last_event)))
        else:
            windows = costmap.advance([batch])
        if windows:
            yield CostmapFrame(commit.recorded_ns, commit.last_event, windows, costmap)


def _in_order(batches: list[EventBatch]) -> Iterator[tuple[int, list[EventBatch]]]:
    """Yield the events of each happened time, times ascending: halves, and halves of them."""
    times = np.unique(np.concatenate([batch.folds_ns for batch in batches] or [np.empty(0, "i8")]))
    if len(times) < 2:
        yield from [(int(at_ns), batches) for at_ns in times]
        return
    middle = times[len(times) // 2]
    for chosen in (np.less, np.greater_equal):
        half = (batch.select(chosen(batch.folds_ns, middle)) for batch in batches)
        yield from _in_order([batch for batch in half if len(batch)])


def _first_ns(log: DoorLog) -> int:
    """Return a moment just before the first event that draws something; of none, the log's end."""
    firsts = (int(batch.folds_ns.min()) for batch in log.batches(kinds=SETTING_KINDS))
    return min(firsts, default=log.end_ns() + 1) - 1


def _places(batches: Sequence[EventBatch], level: int, before: DoorMap) -> Iterator[Point]:
    """Yield points around all places on a level to which events bring doors.

    How wide a door is then may be told elsewhere: the widest of all is taken.
    """
    kinds = [(batch, kind) for batch in batches for kind in POSE_KINDS]
    told = [batch[kind] for batch, kind in kinds if kind in batch]
    widths = [door.width for door in before.doors.values()]
    for rows in told:
        widths += rows["width"].tolist()
    widest = max((width for width in widths if not math.isnan(width)), default=0.0)
    for rows in told:
        places = rows[(rows["level"] == level) & np.isfinite(rows["x"] + rows["y"])]
        for x, y in zip(places["x"].tolist(), places["y"].tolist(), strict=True):
            yield x - widest, y - widest
            yield x + widest, y + widest
