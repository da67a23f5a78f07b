"""Which parts of a log a query's filter can match: its doors, its kinds, its chunks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import reduce
from itertools import pairwise
from operator import and_

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.scanned_table import (
    Guarantee,
    ScanRequest,
    between,
    equal,
    microseconds,
)
from semmap_log.core.model.doors import MAX_DOOR_ID, DoorId
from semmap_log.core.model.events import KINDS
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.log_parts import LogPart
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.window import Window

MOST_DOORS = 16
"""So many are asked for one by one; for more, all events are read sooner."""

BOUNDED = ("event", "happened", "happened_ns", "recorded", "recorded_ns")
"""Columns by which parts of a log can be left out."""


def possible_doors(log: DoorLog, asked: ScanRequest) -> list[DoorId] | None:
    """Return the doors whose rows the filter can match; None: many, or rows about others, too."""
    names = [name for name in ("door_id", "door_name") if asked.filters_by(name)]
    if not names:
        return None
    called = log.names_ever()
    ids = sorted(called)
    gaps = [(one + 1, other - 1) for one, other in pairwise([-1, *ids, MAX_DOOR_ID + 1])]
    strangers = [equal("door_id", None), *(_ids(*gap) for gap in gaps if gap[0] <= gap[1])]
    # A door that is called nothing here has no name at any time.
    if asked.possible([each & equal("door_name", None) for each in strangers]):
        return None
    pairs = [(door_id, name) for door_id in ids for name in [None, *sorted(called[door_id])]]
    places = asked.possible(
        [_ids(door_id, door_id) & equal("door_name", _text(name)) for door_id, name in pairs]
    )
    found = sorted({pairs[place][0] for place in places})
    return found if len(found) <= MOST_DOORS else None


def possible_windows(log: DoorLog, asked: ScanRequest) -> list[Window]:
    """Return where the events lie that the filter can match: ranges of numbers, and kinds."""
    kinds = list(KINDS)
    if asked.filters_by("kind"):
        places = asked.possible([equal("kind", _text(kind.__name__)) for kind in KINDS])
        kinds = [KINDS[place] for place in places]
    bits = bits_of_kinds(kinds)
    if not kinds or not any(map(asked.filters_by, BOUNDED)):
        return [Window(kinds=bits)] if kinds else []
    segments = _possible_parts(log.parts(), asked)
    runs = [run for part in segments for run in _possible_parts(log.parts_within(part), asked)]
    return [
        Window(first_event=first, before_event=end, kinds=bits, only_kept=True)
        for first, end in _joined(runs)
    ]


def _ids(first: int, last: int) -> Guarantee:
    least, greatest = (pa.scalar(each, pa.uint32()) for each in (first, last))
    return equal("door_id", least) if first == last else between("door_id", least, greatest)


def _text(text: str | None) -> pa.Scalar | None:
    return None if text is None else pa.scalar(text)


def _possible_parts(parts: Iterable[LogPart], asked: ScanRequest) -> list[LogPart]:
    listed = list(parts)
    guarantees = [reduce(and_, _bounds(part, asked)) for part in listed]
    return [listed[place] for place in asked.possible(guarantees)]


def _bounds(part: LogPart, asked: ScanRequest) -> Iterator[Guarantee]:
    yield between("event", pa.scalar(part.first_event), pa.scalar(part.last_event))
    for name, (least, greatest) in (
        ("happened", part.happened_ns),
        ("recorded", part.recorded_ns),
    ):
        yield between(name, microseconds(least), microseconds(greatest))
        if asked.has(f"{name}_ns"):
            yield between(f"{name}_ns", pa.scalar(least), pa.scalar(greatest))


def _joined(parts: Iterable[LogPart]) -> list[tuple[int, int]]:
    """Return ranges of events, the end of each behind its last; neighbours are one."""
    found: list[tuple[int, int]] = []
    for part in parts:
        if found and found[-1][1] == part.first_event:
            found[-1] = found[-1][0], part.last_event + 1
        else:
            found.append((part.first_event, part.last_event + 1))
    return found
