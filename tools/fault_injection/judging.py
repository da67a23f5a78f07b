"""What a damaged log may say: what the whole log says, or nothing. Anything else is a wrong answer.

An answer may be that of the whole log; of the log before its last commits, where these may be
taken for a torn tail; or an error that names the file. All answers must be of one and the same log.
"""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import semmap_log as sl
from semmap_log.errors import CorruptLogError, LogError, NotALogError
from semmap_log.event_batch import EventBatch
from semmap_log.events import FloorMap

REFUSALS = (CorruptLogError, NotALogError)


class WrongAnswerError(AssertionError):
    """A damaged log gave an answer that is not the log's, or an error that is not ours."""


class Verdict(Enum):
    """What came of one damage."""

    HARMLESS = "answered as if nothing had happened"
    TORN = "a torn tail left out"
    REFUSED = "an error that names the file"


@dataclass
class Tally:
    """What came of many damages."""

    verdicts: Counter[Verdict] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    """Each damage that got a wrong answer, and the answer."""

    @property
    def tried(self) -> int:
        """How many damages were done."""
        return self.verdicts.total() + len(self.wrong)

    def count(self, what: str, judged: Callable[[], Verdict]) -> None:
        """Add one damage."""
        try:
            self.verdicts[judged()] += 1
        except WrongAnswerError as error:
            self.wrong.append(f"{what}: {error}")

    def __str__(self) -> str:
        parts = [f"{self.verdicts[verdict]:,} {verdict.value}" for verdict in Verdict]
        return f"{self.tried:,} tried: {', '.join(parts)}; {len(self.wrong)} wrong"


Question = Callable[[sl.DoorLog], Any]
Answers = Mapping[str, Any]


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
        return ("events", "commits")

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
            sl.append(log).close()
        except REFUSALS as error:
            if before != contents(log):
                raise WrongAnswerError(f"refused, and changed files all the same: {error}") from None
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
                raise WrongAnswerError(f"{name}: {_difference(self.truth[0][name], answer)}")
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


def _questions(moments: list[int], numbers: list[int]) -> dict[str, Question]:
    """Return what to ask of a log; the first two read every byte that counts."""
    asked: dict[str, Question] = {
        "events": lambda log: [_plain(batch) for batch in log.reader.batches()],
        "commits": lambda log: list(log.commits()),
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


def _plain(batch: EventBatch) -> Any:
    """Return a batch as values that compare: NaN is NaN."""
    columns = {kind: rows.tobytes() for kind, rows in sorted(batch.columns.items())}
    texts = {kind: [_text(e) for e in events] for kind, events in sorted(batch.objects.items())}
    stamps = (batch.number, batch.kind, batch.happened_ns, batch.recorded_ns)
    return [array.tolist() for array in stamps], columns, texts


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


def _difference(expected: Any, got: Any) -> str:
    """Return where two answers part, in few words."""
    one, other = repr(expected), repr(got)
    at = next((i for i, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), 0)
    start = max(0, at - 30)
    return f"expected …{one[start : at + 60]}…, got …{other[start : at + 60]}…"
