"""The oracle: reads the bytes of a log, and says what is in it.

    python tools/fault_injection/oracle LOG                      all of it, as one JSON document
    python tools/fault_injection/oracle                          requests on stdin, a line each

It shares no code with the log it judges: what it knows of the form on disk it has from the
description, and from the message texts that each file carries. A request is a JSON object: the
`log`, and for each moment in `moments` an object of `at`, `known_at`, `event` (or none of them).
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

from doors import doors
from folder import Log, read_log
from segment import SegmentFile


def main() -> int:
    """Answer one question of the command line, or those that come on stdin."""
    if len(sys.argv) > 1:
        print(json.dumps(answered({"log": sys.argv[1], "moments": [{}]}), indent=1))
        return 0
    for line in sys.stdin:
        print(json.dumps(answered(json.loads(line))), flush=True)
    return 0


def answered(request: dict[str, Any]) -> dict[str, Any]:
    """Return what a log holds: its commits, its events, its doors, and what is wrong with it."""
    log = read_log(Path(request["log"]))
    return {
        "problems": log.problems,
        "segments": [_segment(segment) for segment in log.segments],
        "commits": _commits(log),
        "events": [_plain(event) for event in log.events],
        "doors": [doors(log, **moment) for moment in request.get("moments", ())],
    }


def _segment(segment: SegmentFile) -> dict[str, Any]:
    return {
        "file": segment.path.name,
        "bytes": segment.size,
        "closed": segment.closed,
        "first_event": segment.first_event,
        "next_event": segment.next_event,
        "torn_at": segment.torn_at,
        "log_id": segment.head["log_id"],
    }


def _commits(log: Log) -> list[dict[str, Any]]:
    names = ("first_event", "count", "durability", "durable_before")
    return [
        {name: commit.fields[name] for name in names}
        | {
            "command_id": bytes(commit.fields["command_id"]).hex(),
            "hash": commit.hash.hex(),
            "recorded": commit.recorded_ns,
            "note": _plain(commit.note) if commit.note else None,
        }
        for commit in log.commits
    ]


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: no number that is none, bytes as digits, salts left out."""
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items() if name != "salt"}
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


if __name__ == "__main__":
    sys.exit(main())
