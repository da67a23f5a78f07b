"""What a damaged log may say: what the whole log says, or nothing. Anything else is wrong.

An answer may be that of the whole log; of the log before its last commits, where these may be
taken for a torn tail; or an error that names the file. All answers must be of one and the same log.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from fault_injection.questions import Answers, answer, questions
from semmap_log.errors import CorruptLogError, LogAccessError, NotALogError
from semmap_log.store.byte_layout import COMMIT_CHANNEL, KEYFRAME_CHANNEL
from semmap_log.store.pages import Page
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import read_chunk
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.records import MAGIC

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


class Judge:
    """Knows what a log says, and what it said before each of its last commits."""

    def __init__(self, log: Path, *, last_commits: int = 2) -> None:
        """Ask an undamaged log everything, as it is and without each of its last commits.

        Args:
            log: A log of which nothing is damaged.
            last_commits: How many commits at its end to leave out, one after the other.
        """
        reader = LogReader(log)
        whole = list(reader.commits())
        moments = [commit.recorded_ns for commit in whole[:: max(1, len(whole) // 4)]]
        self.questions = questions(moments, [commit.last_event for commit in whole][::5])
        self.truth: list[Answers] = [self._ask_all(log)]
        """What the log says; then what it says without its last commit, its last two …"""
        last = reader.segments[-1]
        ends = [c.offset + c.length for c in last.chunks]
        for left_out in range(1, last_commits + 1):
            events = whole[-left_out].first_event
            with copy_of(log) as copy:
                for known in ("closed*.json", "metadata.yaml"):  # they tell what is left out
                    for path in copy.glob(known):
                        path.unlink()
                for end in reversed(ends):
                    file = copy / last.path.name
                    file.write_bytes(bytes(last.source.read(0, end)))
                    if _next_event(copy) == events:
                        break
                self.truth.append(self._ask_all(copy))

    def _ask_all(self, log: Path) -> Answers:
        opened = sl.read(log)
        return {name: answer(ask, opened) for name, ask in self.questions.items()}

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
                said = answer(self.questions[name], opened)
            except REFUSALS as error:
                verdict = _refused(error, damaged)
                continue
            except Exception as error:
                raise WrongAnswerError(f"{name}: {error!r}") from error
            possible = [left_out for left_out in possible if said == self.truth[left_out][name]]
            if not possible:
                raise _wrong(name, self.truth[0][name], said)
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


def _next_event(log: Path) -> int:
    return sum(len(batch) for batch in sl.read(log).batches_in())


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


MOST_KEPT = 20
"""Logs on which something went wrong; more are alike."""
MOST_KEPT_BYTES = 2**27
"""A larger file is not kept."""
MARKS = ("closed.json", "closed-*-*.json")
"""What is written at each closing; the first as earlier versions named it."""
TELL_THE_END = (*MARKS, "metadata.yaml")
"""What tells, beside the segments, where a closed log ended."""


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
    def of(
        cls, log: Path, folder: Path, title: str, *, last_commits: int = 1, told: bool = True
    ) -> Subject:
        """Copy a log into a folder.

        Args:
            log: One that is not damaged.
            folder: Where the copy is made.
            title: What it is.
            last_commits: How many commits at its end may be taken for a torn tail.
            told: Whether the copy keeps what tells where a closed log ended.
        """
        copy = folder / title / log.name
        shutil.copytree(log, copy, ignore=shutil.ignore_patterns(".lock"))
        if not told:
            remove_all(copy, TELL_THE_END)
        places = commit_places(max(copy.glob("*.mcap")))
        return cls(copy, Judge(log, last_commits=last_commits), title, places)

    @property
    def files(self) -> list[Path]:
        """Its segments, in order."""
        return sorted(self.log.glob("*.mcap"))

    @property
    def is_end_known(self) -> bool:
        """Whether its last segment is closed, and a mark tells so: it can lose nothing unseen.

        To be asked while nothing is damaged.
        """
        is_closed = self.files[-1].read_bytes().endswith(MAGIC)
        return is_closed and bool(marks_of(self.log))

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
            kept = keep(log or self.log, plan.keep, what)
            return Outcome(what, checked, error.lost, error.invented, str(error), kept)
        return Outcome(what, checked)


def keep(log: Path, where: Path, fault: str) -> Path | None:
    """Copy a damaged log to a folder that tells the fault; None if many are kept already."""
    kept = where / re.sub(r"[^\w.]+", "-", fault)
    if where.is_dir() and len(list(where.iterdir())) >= MOST_KEPT:
        return None
    with suppress(shutil.Error):  # a pipe, which is left out
        shutil.copytree(log, kept / log.name, dirs_exist_ok=True, symlinks=True, ignore=_huge_files)
    return kept


def _huge_files(folder: str, names: list[str]) -> list[str]:
    """Return the files that are not kept: who repeats the fault has them again."""
    paths = [Path(folder) / name for name in names]
    return [p.name for p in paths if p.is_file() and p.lstat().st_size > MOST_KEPT_BYTES]


def commit_places(path: Path) -> tuple[tuple[int, int], ...]:
    """Return where each commit's chunks lie in a segment, from the first to the last of them."""
    segment = open_segment(path)
    places, start = [], None
    for chunk in segment.chunks:
        heads = Page(read_chunk(segment, chunk), 0, segment.path).heads
        last = int(heads["channel_id"][-1])
        if last == KEYFRAME_CHANNEL:
            continue
        start = chunk.offset if start is None else start
        if last == COMMIT_CHANNEL:
            places.append((start, chunk.offset + chunk.length))
            start = None
    return tuple(places)


def marks_of(log: Path) -> list[Path]:
    """Return the files that tell how far a log reached when a segment was closed."""
    return [path for pattern in MARKS for path in log.glob(pattern)]


def remove_all(log: Path, patterns: tuple[str, ...]) -> None:
    """Remove a log's files of some names, or patterns of names."""
    for pattern in patterns:
        for path in log.glob(pattern):
            path.unlink()
