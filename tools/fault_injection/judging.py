"""What a damaged log may say: what the whole log says, or nothing. Anything else is a wrong answer.

An answer may be that of the whole log; of the log before its last commits, where these may be
taken for a torn tail; or an error that names the file. All answers must be of one and the same log.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError
from semmap_log.event_batch import EventBatch
from semmap_log.events import FloorMap
from semmap_log.log.form import COMMIT_CHANNEL, KEYFRAME_CHANNEL
from semmap_log.log.pages import Page
from semmap_log.log.scan import Segment, open_segment

REFUSALS = (CorruptLogError, NotALogError, LogAccessError)


class WrongAnswerError(AssertionError):
    """A damaged log gave an answer that is not the log's, or an error that is not ours."""

    def __init__(self, problem: str, lost: int = 0, invented: int = 0) -> None:
        super().__init__(problem)
        self.lost = lost
        """Commits that are not there, and no error says so."""
        self.invented = invented
        """Commits that are there, and that nobody wrote."""


class Verdict(Enum):
    """What came of one damage."""

    HARMLESS = "answered as if nothing had happened"
    TORN = "a torn tail left out"
    REFUSED = "an error that names the file"


Question = Callable[[sl.DoorLog], Any]
Answers = Mapping[str, Any]


@dataclass(frozen=True)
class Subject:
    """A log to damage: a copy whose files may be written to, and who knows what it should say."""

    log: Path
    """Its folder; whoever damages it puts it in order again."""
    judge: Judge
    title: str
    """What it is, for messages."""
    places: tuple[tuple[int, int], ...]
    """Where each commit of the last segment lies: first byte, and first byte behind it."""

    @classmethod
    def of(cls, log: Path, folder: Path, title: str, *, last_commits: int = 1) -> Subject:
        """Copy a log into a folder.

        Args:
            log: One that is not damaged.
            folder: Where the copy is made.
            title: What it is.
            last_commits: How many commits at its end may be taken for a torn tail.
        """
        copy = folder / title / log.name
        shutil.copytree(log, copy, ignore=shutil.ignore_patterns(".lock"))
        last = open_segment(max(copy.glob("*.mcap")))
        return cls(copy, Judge(log, last_commits=last_commits), title, _commit_places(last))

    @property
    def files(self) -> list[Path]:
        """Its segments, in order."""
        return sorted(self.log.glob("*.mcap"))

    def may_lose(self, name: str, data: bytes) -> int:
        """Return how many commits at the end may be taken for torn if a segment has these bytes.

        Only commits of the last segment, and only if every commit from the first touched one on is
        touched: a whole one behind it proves that what lies before it was on disk.
        """
        if name != self.files[-1].name:
            return 0
        whole = (self.log / name).read_bytes()
        touched = [whole[a:b] != data[a:b] for a, b in self.places]
        return len(touched) - touched.index(True) if any(touched) and _is_tail(touched) else 0

    def outcome(
        self, plan: Plan, fault: str, judged: Callable[[], Verdict], log: Path | None = None
    ) -> Outcome:
        """Return what came of one damage; the log is kept if that was wrong.

        Args:
            plan: Says where such logs are kept.
            fault: What was done.
            judged: Judges the log.
            log: The damaged folder; default: its own.
        """
        checked = len(self.judge.truth[0]["commits"])
        what = f"{self.title} log, {fault}"
        try:
            judged()
        except WrongAnswerError as error:
            kept = _keep(log or self.log, plan.keep, what)
            return Outcome(what, checked, error.lost, error.invented, str(error), kept)
        return Outcome(what, checked)


class Judge:
    """Knows what a log says, and what it said before each of its last commits."""

    def __init__(self, log: Path, *, last_commits: int = 2) -> None:
        """Ask an undamaged log everything, as it is and without each of its last commits.

        Args:
            log: A log of which nothing is damaged.
            last_commits: How many commits at its end to leave out, one after the other.
        """
        reader = sl.read(log).reader
        whole = list(reader.commits())
        moments = [commit.recorded_ns for commit in whole[:: max(1, len(whole) // 4)]]
        self.questions = _questions(moments, [commit.last_event for commit in whole][::5])
        self.truth: list[Answers] = [self._ask_all(log)]
        """What the log says; then what it says without its last commit, its last two …"""
        last = reader.segments[-1]
        ends = [c.offset + c.length for c in last.chunks]
        for left_out in range(1, last_commits + 1):
            events = whole[-left_out].first_event
            with copy_of(log) as copy:
                for end in reversed(ends):
                    file = copy / last.path.name
                    file.write_bytes(bytes(last.file[:end]))
                    if _next_event(copy) == events:
                        break
                self.truth.append(self._ask_all(copy))

    def _ask_all(self, log: Path) -> Answers:
        opened = sl.read(log)
        return {name: _answer(ask, opened) for name, ask in self.questions.items()}

    @property
    def quick(self) -> tuple[str, ...]:
        """The two questions that read every byte that counts."""
        return ("commits", "events")

    def some(self, turn: int) -> tuple[str, ...]:
        """Return the quick questions and two of the others, in turns."""
        others = list(self.questions)[2:]
        return (*self.quick, others[turn % len(others)], others[(turn * 7 + 3) % len(others)])

    def judge_appending(self, log: Path, damaged: str = "", *, may_lose: int = 0) -> Verdict:
        """Open a damaged log for appending and close it, then ask it; a refusal changes no byte.

        Raises:
            WrongAnswerError: It changed what it refused, or the log says something that is not so.
        """
        before = contents(log)
        try:
            sl.append(log, compact=False).close()
        except REFUSALS as error:
            if before != contents(log):
                raise WrongAnswerError(
                    f"refused, and changed files all the same: {error}"
                ) from None
            return _refused(error, damaged)
        except Exception as error:
            raise WrongAnswerError(f"opening to append: {error!r}") from error
        return self.judge(log, damaged, may_lose=may_lose, only=self.quick)

    def judge(
        self,
        log: Path,
        damaged: str = "",
        *,
        may_lose: int = 0,
        only: tuple[str, ...] | None = None,
    ) -> Verdict:
        """Ask a damaged log.

        Args:
            log: Its folder.
            damaged: Name of the file that an error must name.
            may_lose: How many commits at the end may be missing, as a torn tail: all or none.
            only: The questions to ask; default: all.

        Raises:
            WrongAnswerError: It said something that is not so.
        """
        try:
            opened = sl.read(log)
        except REFUSALS as error:
            return _refused(error, damaged)
        except Exception as error:
            raise WrongAnswerError(f"opening: {error!r}") from error
        possible = sorted({0, may_lose})
        verdict = None
        for name in only or self.questions:
            try:
                answer = _answer(self.questions[name], opened)
            except REFUSALS as error:
                verdict = _refused(error, damaged)
                continue
            except Exception as error:
                raise WrongAnswerError(f"{name}: {error!r}") from error
            possible = [left_out for left_out in possible if answer == self.truth[left_out][name]]
            if not possible:
                raise _wrong(name, self.truth[0][name], answer)
        return verdict or (Verdict.TORN if possible[0] else Verdict.HARMLESS)


@contextmanager
def copy_of(log: Path) -> Iterator[Path]:
    """Hand out a copy of a log, to be damaged, in memory where the machine has such a place."""
    memory = Path("/dev/shm")  # noqa: S108  # a folder of its own is made in it
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        copy = Path(folder) / log.name
        shutil.copytree(log, copy, ignore=shutil.ignore_patterns(".lock"))
        yield copy


def contents(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Return every file of a folder: name -> (mtime in ns, bytes); the lock is no part of a log."""
    files = [path for path in folder.iterdir() if path.is_file() and path.name != ".lock"]
    return {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in files}


MOST_KEPT = 20


def _keep(log: Path, where: Path, fault: str) -> Path | None:
    """Copy a damaged log to a folder that tells the fault; None if many are kept already."""
    kept = where / re.sub(r"[^\w.]+", "-", fault)
    if where.is_dir() and len(list(where.iterdir())) >= MOST_KEPT:
        return None
    shutil.copytree(log, kept / log.name, dirs_exist_ok=True, symlinks=True)
    return kept


def _commit_places(segment: Segment) -> tuple[tuple[int, int], ...]:
    """Return where each commit's chunks lie, from the first to the last of them."""
    places, start = [], None
    for chunk in segment.chunks:
        heads = Page(chunk.records(segment.file), 0, segment.path).heads
        last = int(heads["channel_id"][-1])
        if last == KEYFRAME_CHANNEL:
            continue
        start = chunk.offset if start is None else start
        if last == COMMIT_CHANNEL:
            places.append((start, chunk.offset + chunk.length))
            start = None
    return tuple(places)


def _is_tail(touched: list[bool]) -> bool:
    return all(touched[touched.index(True) :])


def _questions(moments: list[int], numbers: list[int]) -> dict[str, Question]:
    """Return what to ask of a log; the first two read every byte that counts."""
    asked: dict[str, Question] = {
        "commits": lambda log: list(log.commits()),
        "events": lambda log: _plain(log.reader.batches()),
        "replay": lambda log: repr(log.replay()),
        "history": lambda log: [_text(entry) for entry in log.history()],
        "floor map": lambda log: _text(log.floor_map(1)),
        "end": lambda log: log.end_ns(),
    }
    for ns in moments:
        asked[f"known at {ns}"] = lambda log, ns=ns: repr(log.replay(known_at=ns))
        asked[f"at {ns}"] = lambda log, ns=ns: repr(log.replay(at=ns))
    for number in numbers:
        asked[f"event {number}"] = lambda log, n=number: _text(log.event(n))
        asked[f"entry {number}"] = lambda log, n=number: _text(log.entry(n))
        asked[f"up to {number}"] = lambda log, n=number: repr(log.replay(event=n))
    return asked


def _answer(ask: Question, log: sl.DoorLog) -> Any:
    try:
        return ask(log)
    except CorruptLogError:
        raise
    except LogError as error:  # such as: there is no event 12
        return f"{type(error).__name__}: {str(error).removeprefix(str(log.path))}"


def _plain(batches: Iterable[EventBatch]) -> Any:
    """Return batches as values that compare, however they are split: NaN is NaN."""
    stamps: tuple[list[int], ...] = ([], [], [], [])
    columns: dict[int, bytes] = {}
    texts: dict[int, list[str]] = {}
    for batch in batches:
        arrays = (batch.number, batch.kind, batch.happened_ns, batch.recorded_ns)
        for values, array in zip(stamps, arrays, strict=True):
            values.extend(array.tolist())
        for kind, rows in batch.columns.items():
            columns[kind] = columns.get(kind, b"") + rows.tobytes()
        for kind, events in batch.objects.items():
            texts.setdefault(kind, []).extend(map(_text, events))
    return stamps, columns, texts


def _text(value: Any) -> str:
    cells = getattr(getattr(value, "event", value), "cells", None)
    assert cells is None or isinstance(getattr(value, "event", value), FloorMap)
    return repr(value) if cells is None else f"{value!r} {cells.tobytes()!r}"


def _next_event(log: Path) -> int:
    return sum(len(batch) for batch in sl.read(log).reader.batches())


def _refused(error: Exception, damaged: str) -> Verdict:
    if damaged not in str(error):
        raise WrongAnswerError(f"an error that does not name {damaged}: {error}")
    return Verdict.REFUSED


def _wrong(name: str, expected: Any, got: Any) -> WrongAnswerError:
    """Return the error that says where two answers part, in few words."""
    one, other = repr(expected), repr(got)
    at = next((i for i, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), 0)
    start = max(0, at - 30)
    said = f"{name}: expected …{one[start : at + 60]}…, got …{other[start : at + 60]}…"
    if name != "commits":
        return WrongAnswerError(said)
    lost = sum(commit not in got for commit in expected)
    return WrongAnswerError(said, lost, sum(commit not in expected for commit in got))
