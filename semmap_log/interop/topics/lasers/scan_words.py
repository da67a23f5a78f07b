"""What became of scans and visits, in words: for an import, a dry run, the end of a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from semmap_log.core.model.doors import Door
from semmap_log.interop.topics.known import Known
from semmap_log.interop.topics.lasers.lasers import Lasers
from semmap_log.interop.topics.lasers.visit_events import LaserSightings


def counts_of(lasers: Lasers, sightings: LaserSightings) -> Iterator[str]:
    """Yield how many scans and visits there were."""
    for topic, counts in lasers.counts.items():
        dropped = f", {counts.dropped:,} dropped (the warnings say why)" if counts.dropped else ""
        yield f"scans of {topic}: {counts.received:,}, {counts.placed:,} on the map{dropped}"
    yield from sightings.tally.summary()


def oddities_of(
    lasers: Lasers, sightings: LaserSightings, when: Callable[[int], str]
) -> Iterator[str]:
    """Yield what is odd, beside what was complained about message by message, and beside doors.

    Args:
        lasers: Where scans came from.
        sightings: What came of them.
        when: Writes a stamp.
    """
    for topic, counts in lasers.counts.items():
        if (jump := counts.worst_jump) is not None:
            most = f"by {jump} at {when(jump.stamp_ns)}"
            yield f"{topic}: the pose jumps: {counts.jumps:,} scans dropped, the most {most}"
    for why, count in sorted(sightings.not_used.items()):
        yield f"scans that were not looked through: {why} ({count:,} times)"
    tally = sightings.tally
    if tally.last_level is not None and not tally.doors:
        yield tally.nothing_met(tally.last_level)


def door_oddities_of(sightings: LaserSightings, known: Known) -> Iterator[str]:
    """Yield what is odd about doors, which are called by their names."""
    yield from sightings.tally.warnings(lambda door_id: called(door_id, known.doors.get(door_id)))


def called(door_id: int, door: Door | None) -> str:
    """Return what to call a door."""
    return f"{door_id} ({door.name})" if door and door.name else str(door_id)
