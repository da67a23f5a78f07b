"""Doors that a bag's scans show and a log does not have: proposed, and added on request."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.proposing.proposals import Proposal, proposals_of
from semmap_log.analysis.scans.proposing.swept_cells import KeptScans, ends_of
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId, next_door_id
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, Event, FloorMap
from semmap_log.interop.importing.importing import ImportOptions, mapping_of
from semmap_log.interop.importing.scan_topics import placed_scans, with_scans
from semmap_log.interop.topics.lasers.door_places import places_of
from semmap_log.log import DoorLog, DoorLogWriter

METHOD = "wall-gaps"
"""How doors are found: part of the source of those that are added."""
WALL = 65
"""A floor plan's cells from this value on are wall."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ProposedDoors:
    """Doors that a bag shows besides those of the log."""

    proposals: Sequence[Proposal]
    """Best first."""
    lasers: Sequence[str]
    scans: int
    """That have a place on the map."""
    first_ns: int
    """Of the first of them."""
    walls: dict[int, Floats]
    """Level -> (n, 2) m: the middles of its wall cells, where it has a floor plan."""
    ends: dict[int, Floats]
    """Level -> (n, 2) m: where beams ended, some of them; to be drawn."""

    @property
    def source(self) -> str:
        """What the commit of those that are added names: the lasers and the method."""
        return f"scan:{','.join(self.lasers)} {METHOD}"


def propose_doors(
    log: DoorLog, path: Path, options: ImportOptions, progress: Progress | None = None
) -> ProposedDoors:
    """Return the doors that a bag's scans show and the log does not have; nothing is written.

    Args:
        log: Its doors as they are now, and its floor plans.
        path: The bag.
        options: Which lasers are read, and how.
        progress: Called with (messages read, messages in all).

    Raises:
        FormatError: The bag cannot be read, or no scan of it has a place on the map.
        CommandError: An option that is not about bags.
    """
    mapping = with_scans(path, mapping_of(path, options), options.scan)
    kept = KeptScans()
    kept.take(each.scan for each in placed_scans(path, log, mapping, progress=progress))
    door_map = log.replay()
    doors = places_of(door_map.doors.values())
    by_level = defaultdict(list)
    for scan in kept.scans:
        by_level[scan.level].append(scan)
    walls = {
        level: walls_of(floor)
        for level in by_level
        if (floor := log.floor_of(door_map, level)) is not None
    }
    found: list[Proposal] = []
    for level, scans in by_level.items():
        found += proposals_of(scans, doors, walls.get(level))
    return ProposedDoors(
        sorted(found, key=lambda each: -each.score),
        sorted({scan.laser for scan in kept.scans}),
        kept.taken,
        min(scan.stamp_ns for scan in kept.scans),
        walls,
        {level: np.concatenate([ends_of(s) for s in scans]) for level, scans in by_level.items()},
    )


def walls_of(floor: FloorMap) -> Floats:
    """Return the middles of a floor plan's wall cells: (n, 2) m, frame `map`."""
    rows, columns = np.nonzero(floor.cells >= WALL)
    along, up = (columns + 0.5) * floor.resolution, (rows + 0.5) * floor.resolution
    c, s = np.cos(floor.origin_theta), np.sin(floor.origin_theta)
    return np.stack(
        [floor.origin_x + c * along - s * up, floor.origin_y + s * along + c * up], axis=1
    )


def append_proposed(
    log: DoorLogWriter, found: ProposedDoors, note: Note, numbers: Collection[int] = ()
) -> list[DoorId]:
    """Append proposals as doors, in one commit; return their ids.

    Each is named `door-at X Y`, by the middle of its line, is there since the first scan, and is
    annotated with its kind, where that was seen.

    Args:
        log: Where to.
        found: What `propose_doors` returned for the log as it is.
        note: Who and why; the source names laser and method.
        numbers: Which of them, counted from 1; none: all.
    """
    used = set(log.state.used_door_ids)
    events: list[Event] = []
    added: list[DoorId] = []
    for number, each in enumerate(found.proposals, start=1):
        if numbers and number not in numbers:
            continue
        door = next_door_id(used, max(used, default=0))
        used.add(door)
        added.append(door)
        place = DoorAdded(
            door_id=door, level=each.level, x=each.x, y=each.y, theta=each.theta,
            width=each.width, happened_ns=found.first_ns,
        )  # fmt: skip
        notes = {"name": name_of(each), "kind": each.kind}
        events += [
            place,
            *(
                DoorAnnotated(door_id=door, key=key, value=value, happened_ns=found.first_ns)
                for key, value in notes.items()
                if value
            ),
        ]
    if events:
        said = replace(note, source=found.source, correlation=note.correlation or note.source)
        log.append(events, note=said)
    return added


def name_of(proposal: Proposal) -> str:
    """Return what a proposed door is called: by its place."""
    x, y = proposal.middle
    return f"door-at {x:.1f} {y:.1f}"
