"""How the log is: what `info` tells, as values for the page."""

from __future__ import annotations

from typing import Any

from semmap_log.domain.moments import format_local
from semmap_log.door_log.summary import LogSummary

MOST_FILES = 50
MOST_SUSPECTS = 50


def health_of(summary: LogSummary, tz: str) -> dict[str, Any]:
    """Return a log's health; of many files and suspect clocks, the last ones and their number."""

    def span(times: tuple[int, int] | None) -> list[str] | None:
        return None if times is None else [format_local(time, tz) for time in times]

    return {
        "logId": summary.info.log_id,
        "events": summary.events,
        "commits": summary.commits,
        "kinds": summary.counts,
        "happened": span(summary.happened_ns),
        "recorded": span(summary.recorded_ns),
        "durability": summary.durability,
        "head": summary.head.hex(),
        "bytes": summary.bytes,
        "segments": len(summary.segments),
        "files": [
            [segment.path.name, segment.size, segment.closed, segment.header.first_event]
            for segment in summary.segments[-MOST_FILES:]
        ],
        "suspects": len(summary.suspects),
        "lastSuspects": [suspect.text for suspect in summary.suspects[-MOST_SUSPECTS:]],
        "warnings": summary.warnings,
    }
