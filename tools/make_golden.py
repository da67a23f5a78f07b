"""Make a golden log of the form that is written today: it must be read, and answer so, for ever.

    python tools/make_golden.py

It goes to tests/golden/format_<major>_<minor>: a small log with every kind of event, three times
(`live`: as a crash leaves it; `closed`; `compacted`), and `answers.json`, what commands say of it.
It is made once, when the form has got a new version, and never again: what is there is refused.
Times and ids are the same at each run.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import random
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.cli import main as run
from semmap_log.core.model.events import (
    DoorObserved,
    DoorRequested,
    FloorMap,
    HistoryTrimmed,
    LevelAdded,
    LogExported,
    MomentPinned,
    RobotPose,
    SightingsThinned,
)
from semmap_log.store.byte_layout import FORMAT_MINOR, FORMAT_VERSION, LOCK_NAME

GOLDEN = Path(__file__).parents[1] / "tests" / "golden"
DAY_NS = 1_772_323_200 * 10**9
"""2026-03-01, UTC; events are recorded on the evening of that day."""
HOUR_NS = 3600 * 10**9
SURVEY = sl.Note(actor="anna", source="survey", reason="first map", correlation="map-1")
VERIFIED = ("verdict", "log_id", "commits", "events", "head")
CARE = (
    ["redact", "LOG", "--actor", "anna", "--by", "officer"],
    ["redact", "LOG", "--tracks"],
    ["redact", "LOG", "--door", "1", "--key", "type"],
    ["retain", "LOG", "--thin", "1s"],
)
DRAWN = ("--inflate", "0.2", "--inscribed", "0.1")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=GOLDEN, help="default: tests/golden")
    folder = parser.parse_args().out / f"format_{FORMAT_VERSION}_{FORMAT_MINOR}"
    if folder.exists():
        print(f"{folder} is there: golden logs are never made again", file=sys.stderr)
        return 1
    make(folder, [])
    make(folder.with_name(f"{folder.name}_trimmed"), CARE)
    return 0


def make(folder: Path, care: Sequence[list[str]]) -> None:
    """Make a golden log in three ways, and write down what it answers.

    Args:
        folder: Where it shall lie.
        care: Commands by which some of it is taken out.
    """
    live, closed, compacted = (folder / name / "office" for name in ("live", "closed", "compacted"))
    closed.parent.mkdir(parents=True)
    with sl.create(
        closed, tz="Europe/Vienna", building="golden", robot="r1", clock=SteadyClock(),
        entropy=random.Random(1).randbytes,
    ) as log:  # fmt: skip
        tell(log)
        if not care:
            shutil.copytree(closed, live, ignore=shutil.ignore_patterns(LOCK_NAME))
    for command in care:
        code, printed = _run(in_log(command, closed))
        assert not code, printed
    if care:
        with sl.append(closed) as log:
            log.observe(2, "open", actor="r1")
            shutil.copytree(closed, live, ignore=shutil.ignore_patterns(LOCK_NAME))
    (closed / LOCK_NAME).unlink()
    shutil.copytree(closed, compacted)
    _run(["compact", str(compacted)])
    (compacted / LOCK_NAME).unlink()
    answers = [{"command": command, "answer": said(in_log(command, closed))} for command in asked()]
    lines = ",\n".join(json.dumps(answer) for answer in answers)
    (folder / "answers.json").write_text(f"[\n{lines}\n]\n", "utf-8")
    print(f"{folder}: {len(answers)} answers")


def tell(log: sl.DoorLogWriter) -> None:
    """Tell a story with every kind of event, events told late, and things taken back."""
    cells = np.zeros((30, 40), np.int8)
    cells[:, [0, 20, -1]] = cells[[0, -1]] = 100
    cells[3, 3] = -1
    log.append(
        [
            LevelAdded(level=0, name="ground", elevation=0.0),
            LevelAdded(level=1, name="first", elevation=3.5),
            FloorMap(level=0, resolution=0.25, origin_x=-1.0, origin_y=-2.0, cells=cells),
            FloorMap(level=1, resolution=0.5, origin_x=0.0, origin_y=0.0, cells=cells[:10, :10]),
        ],
        note=SURVEY,
    )  # fmt: skip
    front = log.add_door(
        x=4.125, y=1.0, theta=1.5, width=0.9, level="ground", state="closed", name="front",
        at=DAY_NS, actor="anna",
    )  # fmt: skip
    side = log.add_door(
        x=4.125, y=3.0, theta=1.5, width=0.8, level=0, prob_open=0.25, prob_closed=0.75,
        name="side", at=DAY_NS + HOUR_NS,
    )  # fmt: skip
    attic = log.add_door(x=2.0, y=2.0, theta=0.0, width=1.0, level=1, name="attic", at=DAY_NS)
    log.annotate(front, "type", "hinged", actor="anna")
    log.update_door(front, state="open", at=DAY_NS + 8 * HOUR_NS, actor="r1", reason="saw it")
    log.update_door(side, state="closed", width=0.85, at=DAY_NS + 9 * HOUR_NS)
    log.start_patrol(reason="evening", at=DAY_NS + 10 * HOUR_NS)
    seen = [
        RobotPose(level=0, x=0.5, y=1.0, theta=0.25, sd_xy=0.05, sd_theta=0.02),
        DoorObserved(door_id=front, state=sl.DoorState.OPEN, accuracy_open=0.9,
                     accuracy_closed=0.8),
        DoorObserved(door_id=side, state=sl.DoorState.CLOSED, opening=0.0),
    ]  # fmt: skip
    log.append(seen, note=sl.Note(actor="r1", source="laser"))
    log.observe(front, "closed", accuracy=0.95, at=DAY_NS + 11 * HOUR_NS, actor="r1")
    log.passed(front, at=DAY_NS + 21 * HOUR_NS // 2, waited_s=2.5)
    log.passed(side, passed=False, waited_s=30.0)
    log.append([DoorRequested(door_id=side, state=sl.DoorState.OPEN)], note=sl.Note(actor="guard"))
    log.update_door("side", state="moving", at=DAY_NS + 7 * HOUR_NS, reason="told late")
    wrong = log.update_door(attic, state="open", reason="the wrong door")
    log.finish_patrol(at=DAY_NS + 12 * HOUR_NS)
    log.retract(wrong.first_event, reason="it was another one", actor="anna")
    log.append([LogExported(format="yaml", file_name="doors.yaml", at_ns=DAY_NS + 12 * HOUR_NS)])
    log.append([MomentPinned(at_ns=DAY_NS + 10 * HOUR_NS, name="audit")])
    log.append(
        [
            SightingsThinned(door_id=side, state=sl.DoorState.CLOSED, count=3, accuracy_open=0.9,
                             accuracy_closed=0.8, first_ns=DAY_NS + 11 * HOUR_NS,
                             last_ns=DAY_NS + 12 * HOUR_NS, first_event=0),
            HistoryTrimmed(next_event=0, events_gone=0, notes_gone=0, horizon=0,
                           reasons="thinned", rule="none", tombstones=""),
        ]
    )  # fmt: skip
    tell_of_others(log)
    log.annotate(front, "name", "main", at=DAY_NS + 13 * HOUR_NS)
    log.remove_door(attic, at=DAY_NS + 14 * HOUR_NS, reason="walled up")
    log.append(
        sl.EventBatch.of(
            DoorObserved, door_id=[1, 2, 1], state=[1, 2, 2],
            happened_ns=DAY_NS + np.array([15, 15, 16]) * HOUR_NS,
        )
    )  # fmt: skip


def tell_of_others(log: sl.DoorLogWriter) -> None:
    """Tell of objects that are no doors: a point, an area, and a class that is defined anew."""
    log.define_class("dock", geometry="point", states="free,taken", blocks="", at=DAY_NS)
    log.define_class("spill", geometry="polygon", states="dry,wet", blocks="wet", at=DAY_NS)
    dock = log.add_door(x=1.0, y=2.0, level=0, state="free", name="west", object_class="dock",
                        at=DAY_NS + HOUR_NS)  # fmt: skip
    log.add_door(outline=[(5.0, 1.0), (6.0, 1.0), (6.0, 2.5), (5.5, 3.0)], level=0, state="wet",
                 object_class="spill", at=DAY_NS + HOUR_NS)  # fmt: skip
    log.observe(dock, "taken", at=DAY_NS + 8 * HOUR_NS, actor="r1")
    log.define_class("dock", geometry="point", states="free,taken", blocks="taken",
                     at=DAY_NS + 9 * HOUR_NS)  # fmt: skip


def asked() -> Iterator[list[str]]:
    """Yield commands; LOG stands for the log, OUT for a file that is the answer."""
    for verb in ("history", "replay", "verify"):
        yield [verb, "LOG"]
    for hour in (0, 7, 8, 10, 13, 16):
        yield ["replay", "LOG", "--at", f"2026-03-01T{hour:02}:30:00Z"]
        yield ["diff", "LOG", f"2026-03-01T{hour:02}:15:00Z..2026-03-01T23:00:00Z"]
    for millisecond in (5, 40, 80):
        yield ["replay", "LOG", "--known-at", f"2026-03-01T21:20:00.{millisecond:03}Z"]
    for event in (0, 4, 8, 20, 25):
        yield ["replay", "LOG", "--event", str(event)]
        yield ["show", "LOG", str(event)]
    for door in ("1", "2", "3"):
        yield ["timeline", "LOG", door]
        yield ["history", "LOG", door]
    yield ["replay", "LOG", "--class", "dock"]
    yield ["export", "LOG", "OUT.geojson"]
    for level in ("ground", "first"):
        yield ["costmap", "LOG", "OUT.npy", "--level", level, *DRAWN]
    yield ["export", "LOG", "OUT.jsonl"]


def in_log(command: list[str], log: Path) -> list[str]:
    """Return a command that asks that log."""
    return [str(log) if word == "LOG" else word for word in command]


def said(command: list[str]) -> Any:
    """Return what a command answers: JSON, or the file that it writes; of `verify` what lasts.

    Raises:
        ValueError: It answers an error.
    """
    with tempfile.TemporaryDirectory() as folder:
        outs = {word: Path(folder) / word for word in command if word.startswith("OUT.")}
        words = [str(outs.get(word, word)) for word in command]
        code, printed = _run(words if outs else [*words, "--json"])
        if code:
            raise ValueError(f"{command}: {printed}")
        for out in outs.values():
            if out.suffix == ".npy":
                return np.load(out).tolist()
            if out.suffix == ".geojson":
                return json.loads(out.read_text("utf-8"))
            return [json.loads(line) for line in out.read_text("utf-8").splitlines()]
    answer = json.loads(printed)
    return {key: answer[key] for key in VERIFIED} if command[0] == "verify" else answer


def _run(words: list[str]) -> tuple[int | str | None, str]:
    """Return the exit code of a command, and what it printed."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        try:
            run(words)
        except SystemExit as left:
            return left.code, printed.getvalue()
    return None, printed.getvalue()


if __name__ == "__main__":
    sys.exit(main())
