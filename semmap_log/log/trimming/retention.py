"""What a log need not keep any longer: old sightings, changes of state and poses.

What says which doors, levels, floor plans and rounds there were stays, and so does what was taken
back. At the horizon stands a keyframe; from there on all moments can be asked about.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.events import Event, MomentPinned
from semmap_log.core.model.moments import format_second
from semmap_log.log.replay import keyframes
from semmap_log.log.replay.pins import pinned_state, pins, with_state
from semmap_log.log.replay.position import retractions_behind
from semmap_log.log.replay.state import keyframe_at, state_at
from semmap_log.store.event_fields import kinds_of
from semmap_log.store.header import TrimReason
from semmap_log.store.kind_bits import EXPIRING, KEYFRAME_BIT
from semmap_log.store.pages import Page
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import commit_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import numbers_of

_EXPIRING = [kind.kind for kind in EXPIRING]


class Retention:
    """What goes of all that was recorded before a moment, up to the last keyframe before it."""

    reason = TrimReason.EXPIRED

    def __init__(
        self, reader: LogReader, until_ns: int, *, always_has_horizon: bool = False
    ) -> None:
        """Look how far the horizon can be moved.

        Args:
            reader: Of the log.
            until_ns: What was recorded before this moment may go.
            always_has_horizon: Let the horizon move though nothing goes: the log has never known
                all of what was before.
        """
        self.always_has_horizon = always_has_horizon
        self._reader = reader
        self._until_ns = until_ns
        self.horizon, self._held_by = _horizon(reader, until_ns)

    @property
    def before(self) -> int:
        """Number of the first event that stays."""
        return self.horizon

    @property
    def words(self) -> str:
        """What goes, for the log's own history."""
        until = format_second(self._until_ns)
        held = self._held_by
        also = "" if held is None else f" and before what event {held} takes back"
        return f"what was recorded before {until}, up to the last keyframe before that{also}"

    def told_before(self) -> list[Event]:
        """Return the pins whose moments need what goes, with their states."""
        if self.horizon <= self._reader.horizon:
            return []
        horizon_ns = _recorded_before(self._reader, self.horizon)
        return [
            with_state(pin, state, self.horizon)
            for pin in pins(self._reader).values()
            if pin.at_ns < horizon_ns and (state := self._state_of(pin)) is not None
        ]

    def _state_of(self, pin: MomentPinned) -> DoorMapState | None:
        """Return what goes of a pinned moment: what comes later may be taken back yet."""
        if pin.at_ns < self._reader.horizon_ns:
            return pinned_state(self._reader, pin.at_ns, before_event=self.horizon)
        return state_at(self._reader, at_ns=pin.at_ns, limit=self.horizon - 1)

    def select(self, segment: Segment) -> Retention | None:
        """Return what goes of a segment; None: nothing."""
        is_moved = self.horizon > self._reader.horizon
        return self if is_moved and segment.header.first_event < self.horizon else None

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """As `Selection` says."""
        can_go = np.isin(kinds_of(page.heads["channel_id"]), _EXPIRING)
        return can_go & (page.numbers(np.arange(len(can_go))) < self.horizon)

    def keyframe(self, data: bytes) -> bytes | None:
        """As `Selection` says: those before the horizon are of no use."""
        event = keyframes.event_of(data)
        return data if event is None or event + 1 >= self.horizon else None


def _recorded_before(reader: LogReader, horizon: int) -> int:
    """Return when the last event before a horizon was recorded, or a little later."""
    first_segment = reader.segment_of(horizon) or 0
    later = (one for one in reader.commits(first_segment) if one.last_event >= horizon)
    commit = next(later, None)  # the very next may have been taken out
    return reader.last_log_time_ns() + 1 if commit is None else commit.recorded_ns


def _horizon(reader: LogReader, until_ns: int) -> tuple[int, int | None]:
    """Return the number of the event behind the last keyframe that can be the horizon.

    All before it was recorded before the moment, in closed segments, and no commit reaches across
    it. A later retraction may not reach before it: the keyframe would know what is not true any
    more. Which one held it back is returned, too.
    """
    held: int | None = None
    for place, chunk, event in _keyframes_before(reader, until_ns):
        if event <= reader.horizon:
            break
        reaching = _first_reaching_before(reader, event)
        if reaching is not None:
            held = reaching
        elif _is_state_before(reader.segments[place], chunk, event):
            return event, held
    return reader.horizon, held


def _is_state_before(segment: Segment, chunk: int, event: int) -> bool:
    """Tell whether a keyframe lies between two commits, and holds the state before an event."""
    commit = commit_of(segment, event)
    if commit is not None and commit.first_event < event:
        return False
    state = keyframe_at(segment, chunk)
    return state is not None and state.event == event - 1


def _keyframes_before(reader: LogReader, until_ns: int) -> Iterator[tuple[int, int, int]]:
    """Yield segment, chunk and the next event of keyframes by a moment, the last first."""
    for place in reversed(range(len(reader.segments))):
        segment = reader.segments[place]
        rows, firsts = segment.chunks.rows, numbers_of(segment)[0]
        is_before = (rows["kinds"] == KEYFRAME_BIT) & (rows["start_ns"] < until_ns)
        for chunk in reversed(np.flatnonzero(is_before).tolist()):
            needed = reader.segments[: place + (chunk > 0)]
            if all(one.closed and one.told is None for one in needed):
                yield place, chunk, int(firsts[chunk])


def _first_reaching_before(reader: LogReader, event: int) -> int | None:
    """Return the first retraction from an event on that takes back something before it."""
    later = retractions_behind(reader, event - 1)
    return next((one.number for one in later if one.first_event < event), None)
