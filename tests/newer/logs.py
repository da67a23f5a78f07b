"""Logs that later versions have written, and what they say of them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.newer.program import Later, install, run

LATER = {
    "locked": Later("DoorLocked"),
    "replaced": Later("DoorAddedV2"),
    "weighed": Later("DoorWeighed", is_marked=True),
    "entry": Later(has_entry=True),
    "minor": Later(minors=2),
    "unsaid": Later("DoorLocked", minors=0),
    "major": Later(major="5"),
}
"""What each later version has more; `unsaid`: somebody forgot to raise the minor version."""
UNKNOWN = 3
"""Number of the event of an unknown kind."""

WRITE = """
import os, sys, semmap_log as sl
from semmap_log.core.model import events
path, kind, is_closed = sys.argv[1], sys.argv[2], sys.argv[3] == "closed"
log = sl.create(path, tz="Europe/Vienna", robot="tug1")
door = log.add_door(x=2.0, y=1.5, theta=0.0, width=0.9, state="closed", name="front", actor="ada")
log.observe(door, "open", accuracy=0.9)
if kind:
    log.append([getattr(events, kind)(door_id=door, strength=3.0)])
log.observe(door, "closed", accuracy=0.9, reason="late")
log.close() if is_closed else os._exit(0)
"""

ASK = """
import json, sys, semmap_log as sl
from semmap_log.log.replay.maintenance import verify
log, found = sl.read(sys.argv[1]), verify(__import__("pathlib").Path(sys.argv[1]))
print(json.dumps({
    "kinds": [type(e.event).__name__ for e in log.history()],
    "fields": [repr(e.event) for e in log.history() if hasattr(e.event, "strength")],
    "state": log.replay().doors[1].state.name,
    "exit": found.exit_code, "findings": [f.text for f in found.findings],
    "minor": [s.header.minor for s in log._reader.segments],
    "head": found.head.hex(),
}))
"""


@dataclass(frozen=True)
class NewerLogs:
    """Programs of later versions, installed once, and logs that they make."""

    folder: Path

    def log(self, name: str, target: Path, *, how: str = "closed") -> Path:
        """Return a log of a later version, `closed` or `live`, at a place of the caller's own."""
        made = self.folder / f"{name}_{how}" / "office"
        if not made.exists():
            run(self._program(name), WRITE, made, LATER[name].kind, how)
        return Path(shutil.copytree(made, target / "office"))

    def ask(self, name: str, log: Path) -> dict[str, Any]:
        """Return what the later version says of a log."""
        told: dict[str, Any] = json.loads(run(self._program(name), ASK, log))
        return told

    def run(self, name: str, script: str, log: Path) -> str:
        """Run a script in the later version."""
        return run(self._program(name), script, log)

    def _program(self, name: str) -> Path:
        program = self.folder / f"program_{name}"
        return program if program.exists() else install(program, LATER[name])


MakeLog = Callable[..., Path]
