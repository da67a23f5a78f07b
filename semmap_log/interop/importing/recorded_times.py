"""Whether the times at which lines say that they were recorded can be those of a log."""

from __future__ import annotations

from dataclasses import dataclass

from semmap_log.core.model.moments import format_local
from semmap_log.interop.formats.json.event_json_reader import ParsedLine
from semmap_log.log.door_log.door_log import DoorLog


def last_recorded_ns(log: DoorLog) -> int | None:
    """Return when a log's last commit was recorded; None: it has none."""
    last = log.last_event()
    commit = log.find_commit(last) if last >= 0 else None
    return None if commit is None else commit.closed_ns


@dataclass(slots=True)
class RecordedTimes:
    """Goes along with the lines of a file."""

    tz: str
    """The log's, for messages."""
    now_ns: int
    """The log's clock: nothing was recorded later."""
    has_any: bool = False
    """Some line says when it was recorded."""
    why: str = ""
    """Why they cannot be a log's, with the line; empty: they can."""
    happened_later: int = 0
    """So many events say that they happened after they were recorded."""
    _first: tuple[int, int] | None = None
    """Line and time of the first."""
    _last: tuple[int, int] = (0, 1)

    def add(self, line: int, parsed: ParsedLine) -> None:
        """Take note of the next event: its time has to be later than the last, and not to come."""
        recorded_ns, happened_ns = parsed.recorded_ns, parsed.event.happened_ns
        self.has_any |= recorded_ns is not None
        if self.why:
            return
        if recorded_ns is None:
            self.why = f"line {line} does not say when it was recorded"
        elif recorded_ns <= self._last[1]:
            self.why = (
                f"line {line} was recorded at {self._told(recorded_ns)}, not after line "
                f"{self._last[0]} ({self._told(self._last[1])}): recorded times only grow"
            )
        elif recorded_ns > self.now_ns:
            self.why = f"line {line} was recorded at {self._told(recorded_ns)}, which is to come"
        else:
            self._first = self._first or (line, recorded_ns)
            self._last = (line, recorded_ns)
            self.happened_later += happened_ns is not None and happened_ns > recorded_ns

    def why_not_after(self, ended_ns: int | None) -> str:
        """Return why they cannot follow what a log has; empty: they can.

        Args:
            ended_ns: When the log's last commit was recorded; None: it has none.
        """
        if self._first is None or ended_ns is None or self._first[1] > ended_ns:
            return ""
        line, recorded_ns = self._first
        return (
            f"line {line} was recorded at {self._told(recorded_ns)}, not after the log's last "
            f"commit ({self._told(ended_ns)}): recorded times only grow"
        )

    def _told(self, ns: int) -> str:
        return format_local(ns, self.tz)
