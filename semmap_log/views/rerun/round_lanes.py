"""Patrol rounds into a rerun recording: a lane a robot, which says what it was driving for.

Along `happened` a round lasts from its start to its end as they are known today; along `recorded`
and `event` as far as the log had learnt of them, what was taken back later included.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.retraction import in_ranges
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.folds.patrol_rounds import ROUND_KINDS, Round, rounds
from semmap_log.core.model.events import PatrolFinished, PatrolStarted
from semmap_log.views.excerpt.door_rows import RecordingEdge
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.drawable import drawable_name, unique_parts
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import EVENT, HAPPENED, RECORDED, RowWriter, rgba
from semmap_log.views.rerun.scene import Scene

ROUNDS = "rounds"

ROW = np.dtype([("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"), ("label", "i8")])
NO_ROUND = ""
"""A gap in the lane."""

Value = tuple[RecordingEdge, str]
"""From when on a lane says what."""


@dataclass(frozen=True, slots=True)
class Lane:
    """What a robot was driving for, over time."""

    robot: str
    happened: Sequence[Value]
    recorded: Sequence[Value]


def round_lanes(excerpt: Excerpt, scene: Scene) -> list[Lane]:
    """Return a lane for each robot that drove a round within a recording, by name."""
    by_patrol: dict[int, list[HistoryEntry]] = defaultdict(list)
    for entry in excerpt.log.history(kinds=ROUND_KINDS):
        by_patrol[_number_of(entry)].append(entry)
    happened = _on_happened(by_patrol.values(), scene)
    recorded = _on_recorded(by_patrol, excerpt, scene)
    unnamed = excerpt.log.info.robot or "robot"
    lanes = [Lane(robot or unnamed, happened.get(robot, []), recorded.get(robot, []))
             for robot in sorted(happened.keys() | recorded.keys())]  # fmt: skip
    return [lane for lane in lanes if any(said for _, said in (*lane.happened, *lane.recorded))]


def write_rounds(writer: RowWriter, lanes: Sequence[Lane], palette: Palette) -> None:
    """Write all lanes."""
    parts = unique_parts(((n, lane.robot) for n, lane in enumerate(lanes, start=1)), "robot")
    for place, lane in enumerate(lanes, start=1):
        path = (ROUNDS, parts[place])
        labels = sorted({said for _, said in (*lane.happened, *lane.recorded)} - {NO_ROUND})
        colours = rgba([palette.robot] * len(labels))
        writer.static(path, rr.StateConfiguration(values=labels, labels=labels, colors=colours))
        for values, timelines in ((lane.happened, [HAPPENED]), (lane.recorded, [RECORDED, EVENT])):
            _write(writer, path, values, timelines)


def _write(
    writer: RowWriter, path: tuple[str, ...], values: Sequence[Value], timelines: Sequence[str]
) -> None:
    rows = np.zeros(len(values), ROW)
    for place, (edge, _) in enumerate(values):
        rows[place] = (edge.number, edge.folds_ns, edge.recorded_ns, place)

    def states(part: NDArray[np.void]) -> Sequence[Any]:
        return list(rr.StateChange.columns(state=[values[i][1] for i in part["label"].tolist()]))

    writer.rows(path, rows, states, timelines)


@dataclass(slots=True)
class _Driving:
    """Who drives which rounds, as time goes on; keeps what the lanes say."""

    scene: Scene
    said: dict[str, list[Value]] = field(default_factory=lambda: defaultdict(list))
    _rounds: dict[str, dict[int, Round]] = field(default_factory=lambda: defaultdict(dict))

    def set(
        self, edge: RecordingEdge, patrol: int, driven: Round | None, robots: Iterable[str]
    ) -> None:
        """Let a round be driven from then on; None: no longer, or not at all.

        Args:
            edge: When.
            patrol: Its number.
            driven: The round.
            robots: Those of whom it may have been.
        """
        for robot in {*robots, *([driven.actor] if driven else [])}:
            self._rounds[robot].pop(patrol, None)
            if driven is not None and driven.actor == robot:
                self._rounds[robot][patrol] = driven
            latest = max(self._rounds[robot].values(), key=_start, default=None)
            self._say(edge, robot, NO_ROUND if latest is None else _label(latest))

    def _say(self, edge: RecordingEdge, robot: str, label: str) -> None:
        begin, values = self.scene.begin, self.said[robot]
        edge = RecordingEdge(max(edge.folds_ns, begin.folds_ns), max(edge.number, begin.number),
                    max(edge.recorded_ns, begin.recorded_ns))  # fmt: skip
        if values and values[-1][0] == edge:
            values.pop()
        if label != (values[-1][1] if values else NO_ROUND):
            values.append((edge, label))


def _on_happened(
    entries: Iterable[Sequence[HistoryEntry]], scene: Scene
) -> Mapping[str, list[Value]]:
    found = [one for of_patrol in entries for one in rounds(of_patrol)]
    driving = _Driving(scene)
    turns = [(one.start_ns, 1, one) for one in found if one.start_ns is not None]
    turns += [(one.end_ns, 0, one) for one in found if one.end_ns is not None]
    for ns, starts, one in sorted(turns, key=lambda turn: turn[:2]):
        over = one.end_ns is not None and one.end_ns <= ns
        if ns <= scene.end.folds_ns:
            driven = one if starts and not over else None
            driving.set(RecordingEdge(ns, 0, ns), one.patrol, driven, [one.actor])
    return driving.said


def _on_recorded(
    by_patrol: Mapping[int, Sequence[HistoryEntry]], excerpt: Excerpt, scene: Scene
) -> Mapping[str, list[Value]]:
    driving = _Driving(scene)
    for edge, patrol in _learnings(by_patrol, excerpt):
        if edge.number <= scene.end.number:
            entries = by_patrol[patrol]
            known = next(iter(rounds(_known(entries, excerpt, edge.number))), None)
            is_driven = known is not None and known.start_ns is not None and known.end_ns is None
            robots = {entry.actor for entry in entries}
            driving.set(edge, patrol, known if is_driven else None, robots)
    return driving.said


def _learnings(
    by_patrol: Mapping[int, Sequence[HistoryEntry]], excerpt: Excerpt
) -> list[tuple[RecordingEdge, int]]:
    """Return when the log learnt something of which patrol, in that order."""
    known = excerpt.retractions
    learnt = [(RecordingEdge(e.folds_ns, e.number, e.recorded_ns), patrol)
              for patrol, entries in by_patrol.items() for e in entries]  # fmt: skip
    numbers = {e.number: patrol for patrol, entries in by_patrol.items() for e in entries}
    placed = np.array(sorted(numbers), np.int64)
    for number, (first, last) in zip(known.numbers, known.ranges, strict=True):
        hit = placed[slice(*np.searchsorted(placed, [first, last + 1]))]
        if len(hit):
            ns = excerpt.log.event(number).recorded_ns
            learnt += [(RecordingEdge(ns, number, ns), numbers[n]) for n in hit.tolist()]
    return sorted(learnt, key=lambda one: one[0].number)


def _known(
    entries: Sequence[HistoryEntry], excerpt: Excerpt, number: int
) -> Iterator[HistoryEntry]:
    """Yield what was known of a patrol up to an event, as if nothing was taken back since."""
    numbers = np.array([entry.number for entry in entries], np.int64)
    hidden = in_ranges(numbers, excerpt.retractions.up_to(number).ranges)
    for entry, is_hidden in zip(entries, hidden.tolist(), strict=True):
        if entry.number <= number and not is_hidden:
            yield replace(entry, retracted=False)


def _number_of(entry: HistoryEntry) -> int:
    assert isinstance(entry.event, (PatrolStarted, PatrolFinished))
    return entry.event.patrol


def _label(driven: Round) -> str:
    return drawable_name(driven.label, f"round {driven.patrol}")


def _start(driven: Round) -> tuple[int, int]:
    return driven.start_ns or 0, driven.patrol
