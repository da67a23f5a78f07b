"""What people and tools do to a log's folder while somebody writes or reads it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import semmap_log as sl
from fault_injection.moving.keeper import Box, Keeper
from semmap_log.errors import SemmapError

Scenario = Callable[[Box], None]
LEVELS = ("event", "batch", "flush", "none")


def _writer(box: Box, path: Path, commits: int | None = None) -> Keeper:
    """Return a writer that has written some commits: none, or several segments."""
    keeper = box.keeper(path, durability=box.dice.choice(LEVELS), compact=box.dice.random() < 0.3)
    keeper.add(box.dice.randrange(12) if commits is None else commits)
    return keeper


def moved(box: Box) -> None:
    """The folder, or the one around it, gets another name."""
    path = box.folder / "around" / "office"
    path.parent.mkdir()
    one = _writer(box, path)
    if box.dice.random() < 0.5:
        path.rename(box.folder / "office_old")
    else:
        path.parent.rename(box.folder / "elsewhere")
    one.add(box.dice.randrange(12))
    one.close()


def moved_and_another_made(box: Box) -> None:
    """Another log takes the folder's name, and both are written."""
    path = box.folder / "office"
    one = _writer(box, path)
    path.rename(box.folder / "office_old")
    other = _writer(box, path)
    _in_turns(box, one, other)


def replaced_by_a_copy(box: Box) -> None:
    """A copy takes the folder's name; perhaps somebody else writes to it."""
    path = box.folder / "office"
    one = _writer(box, path)
    shutil.copytree(path, box.folder / "copy", ignore=shutil.ignore_patterns(".lock", "*.tmp"))
    path.rename(box.folder / "office_old")
    one.add(box.dice.randrange(4))
    (box.folder / "copy").rename(path)
    keepers = [one]
    if box.dice.random() < 0.6:
        keepers.append(box.keeper(path))
    _in_turns(box, *keepers)


def copied_over(box: Box) -> None:
    """An older copy of some files comes over them: as rsync does it, or as cp does."""
    path = box.folder / "office"
    one = _writer(box, path)
    shutil.copytree(path, box.folder / "older")
    one.add(box.dice.randrange(8))
    files = [p for p in sorted((box.folder / "older").iterdir()) if p.name != ".lock"]
    chosen = box.dice.sample(files, box.dice.randint(1, len(files)))
    in_place = box.dice.random() < 0.4
    for file in chosen:
        if in_place:
            shutil.copyfile(file, path / file.name)
        else:
            arriving = path / f".{file.name}.rsync"
            shutil.copy2(file, arriving)
            arriving.rename(path / file.name)
    box.say("step", f"{[file.name for file in chosen]} {'in place' if in_place else 'renamed'}")
    one.add(box.dice.randrange(8))
    one.close()


def another_directory(box: Box) -> None:
    """A program changes its working directory; a relative path then means another log."""
    here, there = box.folder / "here", box.folder / "there"
    here.mkdir()
    there.mkdir()
    _bystander_log(box, there / "office")
    os.chdir(here)
    one = _writer(box, Path("office"))
    one.add()
    reader = sl.read("office")
    known = reader.info.log_id
    os.chdir(there)
    _check_reader(box, reader, known)
    one.add(box.dice.randrange(8))
    if one.log is not None and not one.is_over:
        _check_reader(box, one.log, known)
    one.close()


def _bystander_log(box: Box, path: Path) -> None:
    """Make a log that nobody writes to any more."""
    keeper = box.keeper(path)
    keeper.add(box.dice.randrange(1, 8))
    keeper.close()
    box.bystander(path)


def read_while_exchanged(box: Box) -> None:
    """A reader's folder becomes another log's, or a copy that went on differently."""
    path, other = box.folder / "office", box.folder / "other"
    one = _writer(box, path)
    one.add()
    if box.dice.random() < 0.5:
        shutil.copytree(path, other, ignore=shutil.ignore_patterns(".lock", "*.tmp"))
    two = _writer(box, other)
    two.add()
    reader = sl.read(path)
    known = reader.info.log_id
    commits = [commit.hash for commit in reader.commits()]
    one.close()
    path.rename(box.folder / "office_old")
    two.add(box.dice.randrange(8))
    other.rename(path)
    _check_reader(box, reader, known, commits)
    two.close()
    _check_reader(box, reader, known, commits)


def link_turned(box: Box) -> None:
    """The path is a symbolic link, and the link is made to lead to another log."""
    first, second, link = box.folder / "first", box.folder / "second", box.folder / "office"
    _bystander_log(box, second)
    first.mkdir()
    link.symlink_to("first")
    one = _writer(box, link)
    one.add()
    reader = sl.read(link)
    known = reader.info.log_id
    commits = [commit.hash for commit in reader.commits()]
    link.unlink()
    link.symlink_to("second")
    _check_reader(box, reader, known, commits)
    one.add(box.dice.randrange(8))
    one.close()


def file_removed(box: Box) -> None:
    """Somebody tidies up: a segment goes, or another file, or all of the folder."""
    path = box.folder / "office"
    one = _writer(box, path)
    one.add()
    everything = box.dice.random() < 0.2
    files = sorted(path.iterdir()) if everything else [box.dice.choice(sorted(path.iterdir()))]
    for file in files:
        file.unlink()
    if everything and box.dice.random() < 0.5:
        path.rmdir()
    box.say("step", f"{[file.name for file in files]} removed")
    one.add(box.dice.randrange(8))
    one.close()


def foreign_file_in_the_way(box: Box) -> None:
    """A file of somebody else has the name that the next segment would have."""
    path = box.folder / "office"
    one = _writer(box, path)
    one.add()
    last = max(p.name for p in path.glob("*.mcap"))
    number = int(last[-11:-5]) + box.dice.choice((1, 1, 2))
    taken = path / f"{last[:-11]}{number:06d}.mcap"
    taken.write_bytes(box.dice.choice((b"", b"mine", os.urandom(5000))))
    box.bystander(taken)
    one.add(box.dice.randrange(4, 12))
    one.close()


def segment_of_another(box: Box) -> None:
    """A segment of another log, or a later one of a copy of this, lies at the next name."""
    path, other = box.folder / "office", box.folder / "other" / "office"
    one = _writer(box, path)
    one.add()
    other.parent.mkdir()
    if box.dice.random() < 0.5:
        shutil.copytree(path, other, ignore=shutil.ignore_patterns(".lock", "*.tmp"))
    two = _writer(box, other)
    two.add(12)
    two.close()
    last = max(p.name for p in path.glob("*.mcap"))
    for file in sorted(other.glob("*.mcap")):
        if file.name > last:
            shutil.copy2(file, path / file.name)
            box.bystander(path / file.name)
            break
    one.add(box.dice.randrange(4, 12))
    one.close()


def lock_taken_away(box: Box) -> None:
    """The lock file goes, or becomes another; a second writer tries to come in."""
    path = box.folder / "office"
    one = _writer(box, path)
    (path / ".lock").unlink()
    if box.dice.random() < 0.5:
        (path / ".lock").write_bytes(b"")
    two = box.keeper(path)
    if two.log is not None:
        box.say("wrong", "two writers of one folder at once")
    _in_turns(box, one, two)


def two_make_one(box: Box) -> None:
    """Two processes make a log of the same name at the same time."""
    path = box.folder / "office"
    ready, go = os.pipe()
    children = []
    for _ in range(2):
        keeper_name = len(children)
        pid = os.fork()
        if pid == 0:
            os.close(go)
            os.read(ready, 1)
            try:
                keeper = Keeper(box, keeper_name, path)
                keeper.add(box.dice.randrange(8))
                keeper.close()
            finally:
                os._exit(0)
        children.append(pid)
    os.close(go)
    for pid in children:
        os.waitpid(pid, 0)
    os.close(ready)


def _in_turns(box: Box, *keepers: Keeper) -> None:
    """Let writers append, each some, and close, in a drawn order."""
    for _ in range(box.dice.randrange(1, 8)):
        box.dice.choice(keepers).add(box.dice.randrange(1, 6))
    order = list(keepers)
    box.dice.shuffle(order)
    for keeper in order:
        keeper.close()


def _check_reader(
    box: Box, log: sl.DoorLog, log_id: str, commits: list[bytes] | None = None
) -> None:
    """Refresh a reader: what it says then is of its own log, or an error."""
    try:
        log.refresh()
        found = log.info.log_id
        there = [commit.hash for commit in log.commits()]
        log.replay()
    except SemmapError:
        return
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
        box.say("wrong", f"a reader: {error!r}")
        return
    if found != log_id:
        box.say("wrong", f"a reader of log {log_id[:8]} answers from log {found[:8]}")
    elif commits is not None and there[: len(commits)] != commits:
        box.say("wrong", "a reader answers from a copy that went on differently")


MOVES: tuple[Scenario, ...] = (
    moved,
    moved_and_another_made,
    replaced_by_a_copy,
    copied_over,
    another_directory,
    read_while_exchanged,
    link_turned,
    file_removed,
    foreign_file_in_the_way,
    segment_of_another,
    lock_taken_away,
    two_make_one,
)
