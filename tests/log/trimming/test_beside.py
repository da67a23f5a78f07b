"""Trimming beside readers, followers, a writer, and compaction: who asks gets no wrong answer."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.errors import LogLockedError
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.replay.read_model.indexing import index
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, TrimRule, trim_log
from semmap_log.store.compaction import compact
from semmap_log.store.reading.following import FollowedCommit
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.log.trimming.logs import (
    answers,
    answers_of,
    moments,
    random_log,
    redaction,
    until_ns,
    without_texts,
)
from tests.store.trimming.plain_chain import read_plainly

pytestmark = [
    pytest.mark.filterwarnings(f"ignore::semmap_log.errors.{name}")
    for name in ("HorizonWarning", "SensorWarning")
]

DOORS = (1, 2, 3)


RULES: dict[str, Callable[[Path], TrimRule]] = {
    "redact": redaction,
    "thin": lambda log: Thinning(LogReader(log), until_ns(log)),
    "keep": lambda log: Retention(LogReader(log), until_ns(log)),
}
in_a_row = pytest.mark.parametrize(
    "kinds",
    [
        pytest.param(["thin", "redact", "keep"], id="all"),
        *(pytest.param([kind], id=kind, marks=pytest.mark.slow) for kind in RULES),
    ],
)


def care_for(log: Path, kinds: Sequence[str]) -> None:
    for kind in kinds:
        assert trim_log(log, RULES[kind](log)).event is not None


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as patch:
        yield random_log(tmp_path_factory.mktemp("beside"), 8, patch, commits=150, roll=35)


@pytest.fixture
def log(copies: Iterator[Path]) -> Path:
    return next(copies)


def everything(log: sl.DoorLog) -> Iterator[Callable[[], Any]]:
    """Yield questions that read all of a log, or one door's part of it."""
    yield lambda: [repr(entry) for entry in log.history()]
    for door in DOORS:
        yield lambda door=door: [repr(entry) for entry in log.history(door)]
        yield lambda door=door: repr(log.timeline(door))
    yield lambda: [(one.door.door_id, one.p_open) for one in probabilities(log)]
    yield lambda: [commit.hash for commit in log.commits()]
    yield lambda: [repr(event) for batch in log.batches() for event in batch]


def asked_all(log: sl.DoorLog, asked: Sequence[dict[str, Any]]) -> list[Any]:
    return [*answers_of(log, asked), *(told(question) for question in everything(log))]


def told(question: Callable[[], Any]) -> Any:
    """Return its answer, or its error's name."""
    try:
        return question()
    except sl.SemmapError as error:
        return type(error).__name__


@pytest.mark.parametrize("is_indexed", [False, True])
@in_a_row
def test_a_reader_that_was_opened_before_stays_what_it_was(
    log: Path, kinds: list[str], is_indexed: bool
) -> None:
    """Also where its tables are gone, and its first question comes after the trimming."""
    if is_indexed:
        index(log)
    asked = moments(log, 1, count=5)
    before = asked_all(sl.read(log), asked)
    opened, has_asked = sl.read(log), sl.read(log)
    asked_all(has_asked, asked[:6])

    care_for(log, kinds)

    for reader in (opened, has_asked):
        found = asked_all(reader, asked)
        assert len(found) == len(before)
        for now, was in zip(found, before, strict=True):
            assert now == was or now in {"CorruptLogError", "UnreadableLogError", "HorizonError"}


@in_a_row
def test_a_reader_that_looks_again_says_what_a_new_one_says(log: Path, kinds: list[str]) -> None:
    """Nothing that it remembers is of the log as it was."""
    asked = moments(log, 1, count=5)
    reader = sl.read(log)
    asked_all(reader, asked)

    for kind in kinds:
        care_for(log, [kind])
        reader.refresh()

        assert asked_all(reader, asked) == asked_all(sl.read(log), asked)


def numbers_of(followed: Sequence[FollowedCommit]) -> list[int]:
    return [recorded.number for one in followed for recorded in one]


@pytest.mark.parametrize("taken", [1, 149])
@in_a_row
def test_a_follower_goes_on_over_a_trimming(log: Path, kinds: list[str], taken: int) -> None:
    """All that is still there comes, once and in order; and so does what is written later."""
    is_over = threading.Event()
    follower = sl.read(log).follow(-1, poll_s=0, stop=is_over.is_set)
    followed = [next(follower) for _ in range(taken)]

    care_for(log, kinds)
    with sl.append(log) as opened:
        opened.observe(1, "closed")
    is_over.set()
    followed += follower

    found = numbers_of(followed)
    assert found == sorted(set(found))
    assert set(read_plainly(log).events) <= set(found)


@in_a_row
def test_a_follower_begins_anywhere_in_a_trimmed_log(log: Path, kinds: list[str]) -> None:
    """Also behind an event that is gone, or within a commit of which some are gone."""
    care_for(log, kinds)
    there, reader = read_plainly(log).events, sl.read(log)

    for after in range(-1, reader.last_event() + 1, 7):
        found = numbers_of(list(reader.follow(after, poll_s=0, stop=lambda: True)))

        assert found == sorted(number for number in there if number > after)


@pytest.mark.parametrize("kind", RULES)
def test_who_asks_while_a_log_is_trimmed_gets_an_answer_of_before_or_after(
    log: Path, kind: str
) -> None:
    """Opened anew for each question, until it is done, and once after it."""
    asked, history = moments(log, 2, count=3), [repr(h.event) for h in sl.read(log).history()]
    wanted, rounds = answers(log, asked), 0
    child = trimming_slowly(log, kind)
    while not child.has_ended():
        for moment, was in zip(asked, wanted, strict=True):
            (now,) = answers(log, [moment])
            assert is_between(kind, now, was)
        found = [repr(one.event) for one in sl.read(log).history()]
        assert is_part(found[: len(found) - told_since(found)], history)
        rounds += 1

    assert rounds > 0
    assert sl.read(log).last_event() >= len(history)


class Child:
    """A process that does something, and how it ended."""

    def __init__(self, work: Callable[[], None]) -> None:
        self._child = os.fork()
        self._is_waited_for = False
        if not self._child:
            with suppress(BaseException):
                work()
                os._exit(0)
            os._exit(1)

    def has_ended(self) -> bool:
        """Tell whether it had ended by the last time that this was asked, and went well."""
        if not self._is_waited_for:
            ended, status = os.waitpid(self._child, os.WNOHANG)
            self._is_waited_for = bool(ended)
            assert status == 0
            return False
        return True


def trimming_slowly(log: Path, kind: str) -> Child:
    """Trim in another process, which waits before each step that others can see."""

    def work() -> None:
        for call in ("replace", "unlink", "fsync"):
            setattr(os, call, slowly(getattr(os, call)))
        care_for(log, [kind])

    return Child(work)


def slowly(call: Callable[..., Any]) -> Callable[..., Any]:
    def wrapped(*arguments: Any, **named: Any) -> Any:
        time.sleep(0.01)
        return call(*arguments, **named)

    return wrapped


def is_between(kind: str, now: Any, was: Any) -> bool:
    """Tell whether an answer is that of before, that of after, or of a moment between them."""
    if kind == "keep" and now == "HorizonError":
        return True
    if kind != "redact":
        return bool(now == was)
    gone = all(
        not texts or texts == before[3] for (*_, texts), before in zip(now, was, strict=True)
    )
    return gone and without_texts([now]) == without_texts([was])


def told_since(told: Sequence[str]) -> int:
    """Return how many events at the end a trimming has told."""
    kinds = ("HistoryTrimmed(", "SightingsThinned(", "MomentPinned(", "Retracted(")
    return next((i for i, one in enumerate(reversed(told)) if not one.startswith(kinds)), 0)


def is_part(some: Sequence[str], whole: Sequence[str]) -> bool:
    """Tell whether these are some of the others, in their order."""
    left = iter(whole)
    return all(one in left for one in some)


@pytest.mark.parametrize("kind", RULES)
def test_beside_a_writer_nothing_is_trimmed(log: Path, kind: str) -> None:
    """Not in this process, nor while another one writes; not a byte changes."""
    rule = RULES[kind](log)
    with sl.append(log, compact=False):
        check_nothing_is_trimmed(log, rule)
    ready, held = os.pipe(), os.pipe()

    def write() -> None:
        with sl.append(log, compact=False):
            os.write(ready[1], b".")
            os.read(held[0], 1)

    child = Child(write)
    os.read(ready[0], 1)
    check_nothing_is_trimmed(log, rule)
    os.write(held[1], b".")
    while not child.has_ended():
        time.sleep(0.01)

    assert trim_log(log, RULES[kind](log)).event is not None


def check_nothing_is_trimmed(log: Path, rule: TrimRule) -> None:
    files = {path.name: path.read_bytes() for path in log.iterdir()}
    with pytest.raises(LogLockedError):
        trim_log(log, rule)
    assert {path.name: path.read_bytes() for path in log.iterdir()} == files


@in_a_row
def test_whether_it_was_compacted_before_or_after_does_not_matter(
    copies: Iterator[Path], kinds: list[str]
) -> None:
    """All is answered as of the other one, and the same events are left."""
    before, after = next(copies), next(copies)
    asked, last = moments(before, 4, count=8), sl.read(before).last_event()

    compact(before, merge=kinds == ["redact"])
    care_for(before, kinds)
    care_for(after, kinds)
    compact(after, keep_s=0)

    found = answers(after, asked)
    assert answers(before, asked) == found
    assert events_up_to(last, before) == events_up_to(last, after)
    compact(before, keep_s=0)
    assert answers(before, asked) == found
    for log in (before, after):
        assert not [one for one in verify(log).findings if one.severity and one.kind != "leftover"]


def events_up_to(last: int, log: Path) -> dict[int, bytes]:
    return {number: record for number, record in read_plainly(log).events.items() if number <= last}


@in_a_row
def test_a_writer_compacts_beside_what_was_trimmed(
    log: Path, kinds: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the background, over several segments; then more is trimmed."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 20)
    asked = moments(log, 4, count=8)
    care_for(log, kinds)
    found = without_texts(answers(log, asked))

    for _ in range(2):
        with sl.append(log, compact=True) as opened:
            for i in range(60):
                opened.observe(2, "open" if i % 9 else "closed", actor="anna")
        said = without_texts(answers(log, asked))
        assert [now for m, now in zip(asked, said, strict=True) if m.get("known_at")] == [
            was for m, was in zip(asked, found, strict=True) if m.get("known_at")
        ]
        trim_log(log, redaction(log))

    assert b"anna" not in b"".join(read_plainly(log).notes)
    assert not [one for one in verify(log).findings if one.severity and one.kind != "leftover"]
