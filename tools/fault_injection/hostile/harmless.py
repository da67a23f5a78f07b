"""Files that are what they say they are: what a verb takes for them, it may take for any."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

from fault_injection.hostile.bags import good_bag, good_mcap
from fault_injection.hostile.logs import good_log

LINE = b'{"kind": "DoorObserved", "door": "entrance", "state": "OPEN"}\n'
TABLE = b"timestamp,door,state\n2026-03-02T12:00:00Z,entrance,open\n"
YAML = b"door_1:\n  id: 1\n"
MAP = b"""image: harmless.pgm
resolution: 0.05
origin: [0, 0, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""
PICTURE = b"P5\n20 20\n255\n" + bytes(400)

_BYTES: dict[str, Callable[[], bytes]] = {
    ".mcap": good_mcap,
    ".bag": good_bag,
    ".yaml": lambda: YAML,
    ".building.yaml": lambda: YAML,
    ".map.yaml": lambda: MAP,
    ".jsonl": lambda: LINE,
    ".jsonl.gz": lambda: gzip.compress(LINE),
    ".csv": lambda: TABLE,
    ".csv.gz": lambda: gzip.compress(TABLE),
}
"""Extension -> what such a file contains; a log has none."""


def harmless_file(path: Path) -> None:
    """Write a small good file of the kind that its name says, or a log."""
    extension = path.name.partition(".")[2]
    if not extension:
        good_log(path)
        return
    if extension == "map.yaml":
        path.with_name("harmless.pgm").write_bytes(PICTURE)
    path.write_bytes(_BYTES[f".{extension}"]())
