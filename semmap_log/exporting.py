"""A log's state or events as a file for other programs: written whole, or not at all."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semmap_log.door_log import DoorLog
from semmap_log.doors import DoorMap, DoorState
from semmap_log.errors import FormatError, OutputError
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorUpdated,
    EventBatch,
)
from semmap_log.formats.door_csv import Sighting, dump_door_csv
from semmap_log.formats.event_json import event_to_json
from semmap_log.formats.thesis_yaml import dump_thesis_yaml
from semmap_log.log.disk import whole_file
from semmap_log.projections.history import history
from semmap_log.replay import Scope, visible_batches

WRITABLE = ".yaml (the thesis's door database), .csv (states), .jsonl (events), .rrd (rerun)"


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written."""

    what: str
    """In words, such as `3 doors`."""
    left_out: tuple[str, ...] = ()


def export(
    log: DoorLog, out: Path, scope: Scope = Scope(), *, default_prob: float | None = None
) -> Exported:
    """Write a file whose name tells its format; an old file of that name is replaced at once.

    Args:
        log: Where from.
        out: The file.
        scope: The moment of the state, or up to which events count.
        default_prob: Thesis YAML: for doors without probabilities.

    Raises:
        FormatError: The name tells no format.
        CommandError: The format cannot hold a door; the message says what to do.
        OutputError: The file cannot be written; what was there is whole.
    """
    writers: dict[str, Callable[[Path], Exported]] = {
        ".yaml": lambda path: _thesis_yaml(log, path, scope, default_prob),
        ".yml": lambda path: _thesis_yaml(log, path, scope, default_prob),
        ".csv": lambda path: _csv(log, path, scope),
        ".jsonl": lambda path: _event_lines(log, path, scope),
        ".rrd": lambda path: _rrd(log, path, scope),
    }
    writer = writers.get(out.suffix.lower())
    if writer is None:
        raise FormatError(out, f"its name tells no format that can be exported; known: {WRITABLE}.")
    try:
        with whole_file(out) as temporary:
            return writer(temporary)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"{out}: could not be written: {error.strerror}. What was there before "
                          "is as it was.") from error  # fmt: skip


def door_map_of(log: DoorLog, scope: Scope) -> DoorMap:
    """Return the doors of a scope."""
    from semmap_log.replay import replay

    state = replay(log.reader, scope)
    return state.door_map(at_ns=scope.at_ns, known_at_ns=scope.known_at_ns)


def _thesis_yaml(log: DoorLog, path: Path, scope: Scope, default_prob: float | None) -> Exported:
    door_map = door_map_of(log, scope)
    text, left_out = dump_thesis_yaml(door_map, default_prob=default_prob)
    path.write_text(text, encoding="utf-8")
    return Exported(f"{len(door_map.doors) - len(left_out)} doors", tuple(left_out))


def _event_lines(log: DoorLog, path: Path, scope: Scope) -> Exported:
    batches = visible_batches(log.reader, scope)
    count = 0
    with path.open("w", encoding="utf-8") as file:
        for entry in history(batches, log.commits(), log.reader.retractions()):
            said = {name: getattr(entry, name)
                    for name in ("actor", "source", "reason", "correlation")}  # fmt: skip
            shown = event_to_json(entry.recorded, note=said)
            file.write(json.dumps(shown, ensure_ascii=False, allow_nan=False) + "\n")
            count += 1
    return Exported(f"{count} events")


def _csv(log: DoorLog, path: Path, scope: Scope) -> Exported:
    rows = _state_rows(log, scope)
    with path.open("w", encoding="utf-8") as file:
        file.writelines(dump_door_csv(rows.in_order(), tz=log.info.timezone))
    left_out = (
        (f"{rows.unequal} sightings have two accuracies; their mean is written",)
        if rows.unequal
        else ()
    )
    return Exported(f"{len(rows.happened)} rows", left_out)


def _rrd(log: DoorLog, path: Path, scope: Scope) -> Exported:
    from semmap_log.views.rerun_recording import save_rrd

    until = None if scope.at_ns is None else scope.at_ns + 1
    summary = save_rrd(log, path, until=until)
    return Exported(f"{summary.events} events")


class _StateRows:
    """Every event that says a door's state, as columns."""

    def __init__(self) -> None:
        self.happened: list[int] = []
        self.number: list[int] = []
        self.door: list[int] = []
        self.state: list[int] = []
        self.accuracy: list[float] = []
        self.unequal = 0
        self.names: dict[int, str] = {}

    def apply(self, batch: EventBatch) -> None:
        """Take the states that a batch says."""
        if DoorAdded in batch:
            rows = batch[DoorAdded]
            self._take(batch, DoorAdded, rows["state"] != DoorState.UNKNOWN, rows["state"])
        if DoorUpdated in batch:
            rows = batch[DoorUpdated]
            self._take(batch, DoorUpdated, (rows["changed"] & int(Changed.STATE)) != 0, rows["state"])
        if DoorObserved in batch:
            rows = batch[DoorObserved]
            mean = (rows["accuracy_open"] + rows["accuracy_closed"]) / 2
            self.unequal += int(np.count_nonzero(rows["accuracy_open"] != rows["accuracy_closed"]))
            self._take(batch, DoorObserved, np.ones(len(rows), np.bool_), rows["state"], mean)
        if DoorPassed in batch:
            rows = batch[DoorPassed]
            states = np.full(len(rows), int(DoorState.OPEN))
            self._take(batch, DoorPassed, rows["passed"], states, np.ones(len(rows)))

    def _take(self, batch, kind, chosen, states, accuracies=None) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
        where = batch.where(kind)[chosen]
        self.happened += batch.folds_ns[where].tolist()
        self.number += batch.number[where].tolist()
        self.door += batch[kind]["door_id"][chosen].tolist()
        self.state += states[chosen].tolist()
        nothing = np.full(len(where), np.nan)
        self.accuracy += (nothing if accuracies is None else accuracies[chosen]).tolist()

    def in_order(self) -> Iterator[Sighting]:
        """Yield the rows by happened time, then event number."""
        for i in np.lexsort((self.number, self.happened)).tolist():
            name = self.names.get(self.door[i], str(self.door[i]))
            yield Sighting(self.happened[i], name, DoorState(self.state[i]), self.accuracy[i])


def _state_rows(log: DoorLog, scope: Scope) -> _StateRows:
    rows = _StateRows()
    for batch in visible_batches(log.reader, scope):
        rows.apply(batch)
    door_map = door_map_of(log, scope)
    named = [door for door in door_map.doors.values() if door.name]
    for door in named:
        name = door.name or ""
        alone = sum(other.name == name for other in named) == 1
        rows.names[door.door_id] = (
            name if alone else f"{door_map.level_name(door.level)}/{name}"
        )
    return rows
