"""Links, pipes and folders planted where a log's writer puts its files: outside nothing changes.

Which names there are is not written down here: each act is done once without traps, and every
name that it opens for writing, links or renames to is one to plant at.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.forking import forked
from fault_injection.moving.keeper import Box
from fault_injection.questions import ask_verb
from semmap_log.errors import SemmapError

PID = "{pid}"
"""In a name: the number of the process."""
LONGEST_S = 10
ALWAYS = (
    ".lock", ".lock.tmp", "metadata.yaml", f".metadata.yaml.{PID}.tmp", ".recovering", "damaged-1",
    "closed.json", f".closed.json.{PID}.tmp", "closed-0-12.json",
)  # fmt: skip
VICTIM = b"a file of somebody else\n" * 20

Act = Callable[[Path, Path], None]
"""Does something to a log; the second path is a folder for what it writes besides."""


def append(log: Path, out: Path) -> None:
    """Open, append until it rolls, close."""
    del out
    with sl.append(log, compact=False) as opened:
        for _ in range(12):
            opened.observe(1, "open")


def append_and_compact(log: Path, out: Path) -> None:
    """The same, with compaction in the background."""
    del out
    with sl.append(log) as opened:
        for _ in range(12):
            opened.observe(1, "open")


def observe(log: Path, out: Path) -> None:
    """One command."""
    _verb(("observe", str(log), "1", "open"), log, out)


def make(log: Path, out: Path) -> None:
    """Make a log where only the trap lies."""
    for path in log.glob("*"):
        if path.suffix == ".mcap" and path.is_file() and not path.is_symlink():
            path.unlink()
    _verb(("init", str(log)), log, out)


def compact(log: Path, out: Path) -> None:
    """Merge and compress."""
    _verb(("compact", str(log)), log, out)


def recover(log: Path, out: Path) -> None:
    """Save what is whole of a log with a bad byte."""
    first = min(log.glob("*_000000.mcap"))
    data = bytearray(first.read_bytes())
    data[-len(data) // 3] ^= 0xFF
    first.write_bytes(bytes(data))
    _verb(("recover", str(log)), log, out)


def torn(log: Path, out: Path) -> None:
    """Open a log whose last segment was torn."""
    last = max(log.glob("*_00000?.mcap"))
    data = last.read_bytes()
    last.write_bytes(data[: len(data) * 3 // 5])
    with suppress(SemmapError):
        append(log, out)


def export(log: Path, out: Path) -> None:
    """Write files of other programs."""
    for arguments in (
        ("export", str(log), f"{out}/made.csv"),
        ("export", str(log), f"{out}/made.jsonl"),
        ("export", str(log), f"{out}/made.mcap"),
        ("costmap", str(log), f"{out}/made.pgm"),
        ("history", str(log), "--plot", f"{out}/made.svg"),
    ):
        _verb(arguments, log, out)


def checkpoint(log: Path, out: Path) -> None:
    """Fold with a checkpoint."""

    class Counting:
        def initial(self) -> dict[str, int]:
            return {"events": 0}

        def apply(self, state: dict[str, int], batch: Any) -> dict[str, int]:
            return {"events": state["events"] + len(batch)}

    sl.read(log).fold(Counting(), checkpoint=out / "made.checkpoint")


ACTS: dict[str, Act] = {
    one.__name__: one
    for one in (
        append, append_and_compact, observe, make, compact, recover, torn, export, checkpoint,
    )
}  # fmt: skip


def _verb(arguments: tuple[str, ...], log: Path, out: Path) -> None:
    answer = ask_verb(arguments, log, out, fresh=False)
    if answer.code < 0:
        raise RuntimeError(answer.error)


def names_of(act: str, log: Path, folder: Path) -> list[str]:
    """Return the names that an act makes, in the log's folder and in the other, as templates."""
    copy, out = folder / "dry" / log.name, folder / "dry" / "out"
    shutil.copytree(log, copy)
    out.mkdir()

    def watch(tell: Callable[[str], object]) -> None:
        def hook(event: str, args: tuple[Any, ...]) -> None:
            with suppress(TypeError, ValueError, IndexError):
                for path in _made_by(event, args):
                    tell(os.fsdecode(path))

        sys.addaudithook(hook)
        with suppress(SemmapError):
            ACTS[act](copy, out)
        tell(f"pid {os.getpid()}")

    ended = forked(watch)
    shutil.rmtree(folder / "dry")
    *paths, last = ended.lines
    pid = last.removeprefix("pid ")
    found = set(ALWAYS)
    for path in map(Path, paths):
        for top, prefix in ((copy, ""), (out, "out/")):
            if path.parent == top:
                found.add(prefix + re.sub(rf"\b{pid}\b", PID, path.name))
        if not path.is_absolute() and len(path.parts) == 1:  # by the folder's descriptor
            found.add(re.sub(rf"\b{pid}\b", PID, path.name))
    return sorted(found)


def _made_by(event: str, args: tuple[Any, ...]) -> list[Any]:
    """Return the paths that an audited call may make."""
    if event == "open":
        flags = args[2] if isinstance(args[2], int) else 0
        return [args[0]] if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) else []
    if event in {"os.rename", "os.link", "os.symlink"}:
        return [args[1]]
    return [args[0]] if event == "os.mkdir" else []


WAYS = ("symlink", "hard link", "dangling link", "pipe", "folder", "link to a folder", "file")


def trap(box: Box, act: str, log: Path, names: list[str]) -> None:
    """Plant something at one of the names, and do the act; a hang ends the process.

    Args:
        box: Where to play.
        act: What is done.
        log: A log to copy.
        names: The templates of names.
    """
    copy, out = box.folder / log.name, box.folder / "out"
    shutil.copytree(log, copy)
    out.mkdir()
    outside = box.folder / "outside"
    outside.mkdir()
    victim = outside / "victim"
    victim.write_bytes(VICTIM)
    name, way = box.dice.choice(names).replace(PID, str(os.getpid())), box.dice.choice(WAYS)
    planted = out / name.removeprefix("out/") if name.startswith("out/") else copy / name
    if planted.suffix == ".mcap" and planted.exists():
        box.say("step", "nothing: a segment has that name")
        return
    _plant(planted, way, victim, outside)
    box.bystander(outside)
    box.say("step", f"{way} at {name}")
    signal.alarm(LONGEST_S)
    try:
        ACTS[act](copy, out)
    except SemmapError as error:
        box.say("step", f"{type(error).__name__}: {error}")
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
        box.say("wrong", f"{act}: {error!r}"[-500:])
    signal.alarm(0)


def _plant(path: Path, way: str, victim: Path, outside: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    if way == "symlink":
        path.symlink_to(victim)
    elif way == "hard link":
        path.hardlink_to(victim)
    elif way == "dangling link":
        path.symlink_to(outside / "not there")
    elif way == "pipe":
        os.mkfifo(path)
    elif way == "folder":
        path.mkdir()
        (path / "mine").write_bytes(b"mine")
    elif way == "link to a folder":
        path.symlink_to(outside)
    else:
        path.write_bytes(b"mine")
