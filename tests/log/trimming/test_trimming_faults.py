"""Trimming cut at each step, or on a full disk: no answer is wrong, no sighting counts twice."""

from __future__ import annotations

import errno
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.errors import SemmapError
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.trimming.repeated_sightings import HOUR_NS, Thinning
from semmap_log.log.trimming.trim_log import Retention, TrimRule, trim_log
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.trimming.trimming import Trimming
from semmap_log.store.verification.findings import Severity
from tests.log.trimming.logs import answers, moments, random_log, redaction, without_texts
from tests.store.trimming.plain_chain import all_bytes

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")


RULES: dict[str, Callable[[Path, int], TrimRule]] = {
    "redact": lambda log, _: redaction(log),
    "thin": lambda log, until_ns: Thinning(LogReader(log), until_ns),
    "keep": lambda log, until_ns: Retention(LogReader(log), until_ns),
}


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as patch:
        yield random_log(tmp_path_factory.mktemp("faults"), 5, patch, commits=120, roll=40)


def sightings(log: Path) -> Counter[Any]:
    """Return how many sightings count, of each door, hour and state."""
    evidence = Evidence()
    for batch in sl.read(log).batches():
        evidence.apply(batch)
    found = Counter[Any]()
    for door_id in evidence.door_ids:
        told = evidence.door(door_id)
        hours = (told.seen_ns // HOUR_NS).tolist()
        found.update(zip([door_id] * len(hours), hours, told.reads_open.tolist(), strict=True))
    return found


class Truth:
    """What a log answers before anything is taken out of it."""

    def __init__(self, log: Path, kind: str) -> None:
        self.kind = kind
        commit = LogReader(log).find_commit(90)
        assert commit is not None, "there are more"
        self.until_ns = commit.recorded_ns
        self.asked = moments(log, 3, count=4)
        self.answers = answers(log, self.asked)
        self.sightings = sightings(log)

    def trim(self, log: Path) -> Trimming:
        """Take out what shall go."""
        return trim_log(log, RULES[self.kind](log, self.until_ns)).done

    def check(self, log: Path) -> None:
        """Compare it with what it answers now: the same, or, of what expired, the stated error."""
        found, wanted = answers(log, self.asked), self.answers
        if self.kind == "redact":
            found, wanted = without_texts(found), without_texts(wanted)
        for now, was in zip(found, wanted, strict=True):
            assert now == was or (now == "HorizonError" and self.kind == "keep")
        if self.kind != "keep":
            assert sightings(log) == self.sightings
        assert not [f for f in verify(log).findings if f.severity >= Severity.DAMAGE]

    def check_done(self, log: Path) -> None:
        """Check that all is gone that shall, and all else is there."""
        with sl.append(log, compact=False) as opened:
            opened.start_patrol()  # it mends what nothing else was left to do for
        self.check(log)
        assert not [f for f in verify(log).findings if f.severity and f.kind != "leftover"]
        assert self.trim(log).events == 0
        assert not [path for path in log.iterdir() if path.name.endswith(".tmp")]
        if self.kind == "redact":
            assert not [name for name, data in all_bytes(log) if b"secret0" in data]
        if self.kind == "keep":
            assert LogReader(log).horizon > 0


def failing(call: str, at: int, fail: Callable[[], object]) -> Callable[..., Any]:
    """Return such a call of the system that fails when it is made for that time."""
    really, left = getattr(os, call), count(1)

    def wrapped(*arguments: Any, **named: Any) -> Any:
        if next(left) == at:
            fail()
        return really(*arguments, **named)

    return wrapped


def cut_off(truth: Truth, log: Path, call: str, at: int) -> bool:
    """Trim in a child that ends, without a word, before such a call; tell whether it did."""
    child = os.fork()
    if not child:
        setattr(os, call, failing(call, at, lambda: os._exit(9)))
        try:
            truth.trim(log)
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "call"),
    [("redact", "fsync"), ("thin", "replace"), ("keep", "fsync"), ("keep", "unlink")],
)
def test_killed_at_each_step(original: Path, copies: Iterator[Path], kind: str, call: str) -> None:
    """All is answered as before; done again, it is as if nothing had happened."""
    truth = Truth(original, kind)
    for at in count(1):
        log = next(copies)
        if not cut_off(truth, log, call, at):
            break
        truth.check(log)
        truth.trim(log)
        truth.check_done(log)
        shutil.rmtree(log.parent)

    assert at > {"replace": 3, "fsync": 12, "unlink": 1}[call]
    truth.check_done(log)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "call"), [("redact", "write"), ("thin", "fsync"), ("keep", "replace")]
)
def test_a_full_disk_at_each_step(
    original: Path, copies: Iterator[Path], monkeypatch: pytest.MonkeyPatch, kind: str, call: str
) -> None:
    """It is said; all is answered as before, and nothing half lies about."""
    truth, hits, told = Truth(original, kind), 0, 0

    def full() -> None:
        nonlocal hits
        hits += 1
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for at in count(1):
        log = next(copies)
        with monkeypatch.context() as patch:
            patch.setattr(os, call, failing(call, at, full))
            try:
                truth.trim(log)
            except SemmapError as error:
                told += 1
                assert "No space left" in str(error)
        if hits < at:
            break
        truth.check(log)
        truth.trim(log)
        truth.check_done(log)
        shutil.rmtree(log.parent)

    assert told > hits / 2 > 2  # what does without, such as the mark of a closing, goes on
