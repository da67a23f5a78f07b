"""The copies of what is taken out of a log: those that are known, and what becomes of each.

Caches are removed: they can be made again. Kept scans show where the robot was; they go with its
track. All else stays, and is named, for a person to look at it.

Exports, backups, joined logs, caches of other users, or in a folder that an option named, and what
lies on other machines are not known here.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from pathlib import Path, PurePath

from semmap_log.analysis.scans.visit import FOLDER_SUFFIX
from semmap_log.core.io.object_cache import VARIABLE, ObjectCache
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import FormatError, LogError
from semmap_log.fleet.answer_places import answers_of, default_folder
from semmap_log.fleet.join.joining_logs import TEMPORARY as VIEW
from semmap_log.fleet.join.joining_logs import is_view_of, views_of
from semmap_log.fleet.keeping import shipped_to
from semmap_log.interop.copies.going import EVER, Going
from semmap_log.interop.formats.files.thesis_yaml import SAVED_SUFFIX
from semmap_log.interop.formats.kept_scans.writing import (
    VisitsInFile,
    take_out_visits,
    visits_in_file,
)
from semmap_log.log import copies_next_to, holds_log, lock_log, other_files

_TEMPORARY = "semmap-log-"
"""How the names of our folders for temporary files begin."""
_LOOK = "look at it, and remove it"


class Action(str, Enum):
    """What becomes of a copy."""

    REMOVED = "removed"
    REWRITTEN = "rewritten"
    """Without what goes."""
    LEFT = "left"


@dataclass(frozen=True, slots=True)
class Copy:
    """Something that may hold what is taken out of a log."""

    path: PurePath
    """A file or a folder; of a store its URL."""
    kind: str
    """Of what is there: `torn`, `damaged`, `scans`, `answer` ..."""
    action: Action
    text: str
    """What it is; where it is left also what to do."""
    act: Callable[[], object] | None = field(default=None, repr=False, compare=False)
    """Removes or rewrites it."""
    is_writers: bool = field(default=False, repr=False, compare=False)
    """Whether who writes the log may be writing it, too."""


def plan_copies(log: Path, going: Going, *, is_trimmed: bool) -> list[Copy]:
    """Return the known copies of what goes, and what becomes of each; nothing is written.

    Args:
        log: The log's folder.
        going: What goes.
        is_trimmed: Whether some segment loses something.

    Raises:
        LogError: The log cannot be read.
    """
    return [
        *_in_folder(log, is_trimmed=is_trimmed),
        *_next_to(log, going),
        *_caches(going),
        *_elsewhere(log, going),
    ]


def take_out_of_copies(log: Path, going: Going, *, is_trimmed: bool) -> list[Copy]:
    """Do what `plan_copies` says, and return what became of each copy.

    What belongs to whoever writes the log is left where somebody does.

    Raises:
        LogError: The log cannot be read.
    """
    planned = plan_copies(log, going, is_trimmed=is_trimmed)
    if not any(one.is_writers for one in planned):
        return [_done(one) for one in planned]
    try:
        lock = lock_log(log)
    except LogError as error:
        return [_not_done(one, error) if one.is_writers else _done(one) for one in planned]
    try:  # only now nobody adds to the scans
        return [_done(one) for one in plan_copies(log, going, is_trimmed=is_trimmed)]
    finally:
        lock.release()


def _done(copy: Copy) -> Copy:
    """Remove or rewrite a copy; return it as left where that fails."""
    if copy.act is None:
        return copy
    try:
        copy.act()
    except FileNotFoundError:  # somebody was quicker
        pass
    except (OSError, LogError, ValueError) as error:
        return _not_done(copy, error)
    return copy


def _not_done(copy: Copy, error: Exception) -> Copy:
    why = (error.strerror if isinstance(error, OSError) else "") or str(error).rstrip(".")
    return _left(copy.path, copy.kind, f"{copy.text}; it stays: {why}; do it again")


def _in_folder(log: Path, *, is_trimmed: bool) -> Iterator[Copy]:
    """Yield what lies in the log's folder next to its segments."""
    texts = {
        "index": "tables of segments that lost something",
        "temporary": "a file that a killed writer has left",
        "torn": f"what a crash left after the last whole commit; {_LOOK}",
        "damaged": f"the log as it was before `recover`; {_LOOK}",
        "other": f"no file of the log; {_LOOK} if it holds any of it",
    }
    for one in other_files(log):
        path, text = log / one.name, texts[one.kind]
        if one.remove is None:
            yield _left(path, one.kind, text)
        elif is_trimmed or one.kind != "index":
            is_writers = one.kind == "temporary"
            yield Copy(path, one.kind, Action.REMOVED, text, one.remove, is_writers)


def _next_to(log: Path, going: Going) -> Iterator[Copy]:
    """Yield what lies in the same folder as the log."""
    folder = _as_given(log)
    yield from _scans(folder, going)
    texts = {
        "recovering": "a recovery that was stopped; finish it: " + command_line("recover", log),
        "copy": "a copy of this log; take it out there as well, or remove it",
        "checkpoint": "a checkpoint of a fold",
    }
    for one in copies_next_to(log, going.log_ids):
        path, text = folder.with_name(one.name), texts[one.kind]
        if one.remove is None:
            yield _left(path, one.kind, text)
        else:
            yield Copy(path, one.kind, Action.REMOVED, text, one.remove)
    saved = folder.with_name(f"{folder.name}{SAVED_SUFFIX}")
    if going.saved_doors and saved.is_dir():
        yield _left(saved, "saved", f"doors that a server saved, with their states; {_LOOK}")


def _as_given(log: Path) -> Path:
    """Return the path of a log, with its name; relative if it was given so, and no link."""
    folder = log.resolve()
    is_name = log.name == folder.name and log.parent.resolve() == folder.parent
    return log if is_name else folder


def _scans(folder: Path, going: Going) -> Iterator[Copy]:
    """Yield the files of kept scans that hold what goes."""
    for path in sorted(folder.with_name(f"{folder.name}{FOLDER_SUFFIX}").glob("*.mcap*")):
        try:
            found = visits_in_file(path, going.log_id, going.shows)
        except FormatError as error:
            if going.removes_scans:
                why = str(error).removeprefix(f"{path}: ").rstrip(".")
                yield _left(path, "scans", f"it cannot be read ({why}); {_LOOK}")
            continue
        if found is not None:
            yield from _scans_in(found, going)


def _scans_in(found: VisitsInFile, going: Going) -> Iterator[Copy]:
    """Yield what becomes of a file of kept scans, if it holds what goes."""
    what = f"scans of {counted(found.going, 'visit')}, which show where the robot was"
    is_all = going.scans_before_ns == EVER
    if going.removes_scans and found.problem and not (is_all and not found.staying):
        yield _left(found.path, "scans", f"{what}; it is damaged ({found.problem}); {_LOOK}")
    elif going.removes_scans and (found.going or (is_all and not found.staying)):
        act = partial(take_out_visits, found, going.log_id, going.shows)
        action = Action.REWRITTEN if found.staying else Action.REMOVED
        yield Copy(found.path, "scans", action, what, act, is_writers=True)
    elif found.going and (going.names_scans or going.names(found.robots)):
        yield _left(found.path, "scans", f"{what}, and which robot it was; {_LOOK}")


def _caches(going: Going) -> Iterator[Copy]:
    """Yield what this user's caches hold."""
    answers: list[Path] = []
    with suppress(RuntimeError):  # this user has no home, and so no answers
        answers = list(answers_of(going.log_id, default_folder()))
    for path in answers:
        yield Copy(path, "answer", Action.REMOVED, "an answer of a fleet question", path.unlink)
    cache = Path(os.environ.get(VARIABLE, "") or os.devnull)
    if not cache.is_dir():
        return
    blocks = ObjectCache(cache).blocks()
    if blocks:
        what = f"{counted(len(blocks), 'block')} of segments that were read from stores"
        yield Copy(cache, "objects", Action.REMOVED, what, partial(_remove_all, blocks))
    for path in views_of(going.log_ids, cache):
        what = "a view of joined logs, this one among them"
        yield Copy(path, "view", Action.REMOVED, what, partial(shutil.rmtree, path))


def _remove_all(paths: list[Path]) -> None:
    for path in paths:
        path.unlink(missing_ok=True)


def _elsewhere(log: Path, going: Going) -> Iterator[Copy]:
    """Yield what a killed program has left among temporary files, and the store that is known."""
    for path in sorted(Path(tempfile.gettempdir()).glob(f"{_TEMPORARY}*")):
        is_view = path.name.startswith(VIEW) and is_view_of(going.log_ids, path / "view")
        if path.is_dir() and (is_view or holds_log(path, going.log_ids)):
            what = "what a program unpacked or made of logs; if none runs that uses it, remove it"
            yield _left(path, "unpacked", what)
    url = shipped_to(log)
    if url is not None:
        line = command_line("ship", log, url, "--remove-superseded-after", "0")
        yield _left(url, "shipped", f"what was shipped; send the log as it is now: {line}")


def _left(path: PurePath, kind: str, text: str) -> Copy:
    return Copy(path, kind, Action.LEFT, f"may hold it still: {text}.")
