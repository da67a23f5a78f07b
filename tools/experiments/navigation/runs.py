"""Runs as their logs tell them: the goals, and how they ended."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import semmap_log as sl
from navigation.records import PROGRAM, START_NS, Outcome, RunError, RunKey
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.model.events import PatrolFinished, PatrolStarted


@dataclass(frozen=True)
class Goal:
    """A place that the robot was sent to."""

    number: int
    x: float
    y: float
    kind: str
    """What is there, such as `free` or `occupied`."""
    sent_ns: int
    ended_ns: int
    outcome: Outcome
    figures: Mapping[str, Any]
    """What else the run told of it, such as `drove_s` and `path_m`."""

    @property
    def took_s(self) -> float:
        """How long the robot had it as its goal."""
        return (self.ended_ns - self.sent_ns) / 1e9


@dataclass(frozen=True)
class Run:
    """A run, read from its two logs."""

    folder: Path
    key: RunKey
    parameters: Mapping[str, Any]
    """All that it was made with."""
    goals: tuple[Goal, ...]
    """Those that ended, in the order in which they did."""

    @property
    def begin_ns(self) -> int:
        """When the first goal was sent."""
        return min(goal.sent_ns for goal in self.goals)

    @property
    def end_ns(self) -> int:
        """When the last goal ended."""
        return max(goal.ended_ns for goal in self.goals)

    @cached_property
    def world(self) -> sl.DoorLog:
        """How the doors were."""
        return sl.read(self.folder / "world")

    @cached_property
    def belief(self) -> sl.DoorLog:
        """What the robot believed, and did."""
        return sl.read(self.folder / "belief")


def find_runs(out: Path) -> list[Path]:
    """Return the folders of the runs below a folder, in the order of their keys.

    Raises:
        RunError: There is none.
    """
    found = {
        path.parent
        for path in out.rglob("belief")
        if (path.parent / "world").is_dir() and not path.parent.name.startswith(".")
    }
    if not found:
        raise RunError(
            f"{out}: expected runs in BUILDING/SETUP/SERIES-SEED, found none; "
            "to make some: python tools/experiments/navigation_experiment.py run"
        )
    return sorted(found, key=RunKey.of)


def read_run(folder: Path) -> Run:
    """Return the run that lies in a folder.

    Raises:
        RunError: Its logs are not those of a run.
        SemmapError: They cannot be read.
    """
    for name in ("world", "belief"):
        if not any((folder / name).glob("*.mcap")):
            raise RunError(f"{folder}: expected a run, which has the logs world and belief; "
                           f"there is no log {name}.")  # fmt: skip
    log = sl.read(folder / "belief")
    return Run(folder, RunKey.of(folder), _parameters(folder, log), tuple(_goals(folder, log)))


def _parameters(folder: Path, log: sl.DoorLog) -> Mapping[str, Any]:
    first = log.find_commit(0)
    if first is None or first.note.actor != PROGRAM:
        raise RunError(
            f"{folder}: expected a first commit by {PROGRAM}, got {first and first.note}."
        )
    return _told(folder, first.note.reason)


def _goals(folder: Path, log: sl.DoorLog) -> Iterator[Goal]:
    sent: dict[int, HistoryEntry] = {}
    for entry in log.history(kinds=(PatrolStarted, PatrolFinished)):
        event = entry.event
        if isinstance(event, PatrolStarted):
            sent[event.patrol] = entry
        elif isinstance(event, PatrolFinished):
            if event.patrol not in sent:
                raise RunError(f"{folder}: goal {event.patrol} ended, but was never sent.")
            yield _goal(folder, event.patrol, sent.pop(event.patrol), entry)


def _goal(folder: Path, number: int, sent: HistoryEntry, ended: HistoryEntry) -> Goal:
    place = _told(folder, sent.reason)
    figures = {**_told(folder, ended.reason)}
    for name in ("x", "y", "kind"):  # where nothing was seen on the way, both are in one note
        figures.pop(name, None)
    try:
        outcome = Outcome(figures.pop("outcome"))
        return Goal(
            number, place["x"], place["y"], place["kind"], sent.happened_ns, ended.happened_ns,
            outcome, figures,
        )  # fmt: skip
    except (KeyError, ValueError) as error:
        raise RunError(
            f"{folder}: goal {number}: {error!r} in {sent.reason} {ended.reason}."
        ) from error


def _told(folder: Path, note: str) -> dict[str, Any]:
    try:
        told = json.loads(note)
    except ValueError:
        told = None
    if not isinstance(told, dict):
        raise RunError(f"{folder}: expected a JSON object in a note, got {note!r}.")
    return told


def second_of(ns: int) -> float:
    """Return the second of its run that a moment is."""
    return (ns - START_NS) / 1e9
