"""Bits flipped, files cut: detected, or harmless.

The short forms of `tools/faults.py flips cuts`, and what makes their verdicts.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from fault_injection.damaged_bytes import flipped, text_bytes
from fault_injection.judging import Judge, Subject, Verdict, WrongAnswerError
from fault_injection.sample import Sample

from semmap_log.errors import CorruptLogError
from tests.faults.running import faults, is_tried

LAST = "log_000002.mcap"


@pytest.fixture(scope="module")
def live(sample: Sample, tmp_path_factory: pytest.TempPathFactory) -> Subject:
    """The small log as a killed writer leaves it, and who knows what it says."""
    return Subject.of(sample.live, tmp_path_factory.mktemp("live"), "live")


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "count"), [("flips", 1000), ("cuts", 400)])
def test_no_damage_gives_a_wrong_answer(kind: str, count: int, tmp_path: Path) -> None:
    """The right events, or those before a torn tail, or an error that names the file."""
    said = faults(kind, count, tmp_path)

    is_tried(said, at_least=count)


def test_a_flipped_bit_of_an_acknowledged_commit_is_named(live: Subject) -> None:
    """It lies before a whole commit, which proves that it was on the disk."""
    with flipped(live.log / LAST, live.places[0][0] + 60, 3):
        verdict = live.judge.judge(live.log, LAST)

    assert Verdict.REFUSED is verdict


def test_a_flipped_bit_of_the_last_commit_is_a_torn_tail(live: Subject) -> None:
    """Nothing behind it tells whether it was ever whole."""
    with flipped(live.log / LAST, live.places[-1][0] + 60, 3):
        verdict = live.judge.judge(live.log, LAST, may_lose=1)

    assert Verdict.TORN is verdict


def test_a_flipped_bit_of_a_schema_is_harmless_to_us(live: Subject) -> None:
    """The texts are for other tools; we know our types."""
    path = live.log / "log_000000.mcap"
    with flipped(path, sorted(text_bytes(path))[500], 3):
        verdict = live.judge.judge(live.log, path.name)

    assert Verdict.HARMLESS is verdict


def test_the_judge_sees_what_is_missing(live: Subject, tmp_path: Path) -> None:
    """A log that ends a commit earlier, where nothing may be missing, is a wrong answer."""
    copy = tmp_path / "log"
    shutil.copytree(live.log, copy)
    whole = (copy / LAST).read_bytes()
    (copy / LAST).write_bytes(whole[: live.places[-1][0]])

    with pytest.raises(WrongAnswerError, match="commits: expected") as wrong:
        live.judge.judge(copy, LAST)

    assert (1, 0) == (wrong.value.lost, wrong.value.invented)
    assert Verdict.TORN is live.judge.judge(copy, LAST, may_lose=1)


@pytest.mark.parametrize(
    ("error", "problem"),
    [
        (CorruptLogError(Path("another.mcap"), 7, "broken"), "does not name"),
        (KeyError("oh"), "KeyError"),
    ],
    ids=["unnamed", "foreign"],
)
def test_the_judge_wants_errors_that_help(
    error: Exception, problem: str, live: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error that names another file is wrong, and so is one that is not ours."""
    monkeypatch.setattr("semmap_log.read", _raising(error))

    with pytest.raises(WrongAnswerError, match=problem):
        live.judge.judge(live.log, LAST)


def _raising(error: Exception) -> Callable[[Path], None]:
    def read(_: Path) -> None:
        raise error

    return read


def test_the_judge_asks_of_every_moment(sample: Sample) -> None:
    """Of commits, events, the map, its history and its floor plan, and of moments before."""
    judge = Judge(sample.live)

    asked = " ".join(judge.questions)

    for name in ("commits", "events", "replay", "history", "floor map", "known at", "at ", "event"):
        assert name in asked
    assert len(sample.commits) == len(judge.truth[0]["commits"])
    assert Verdict.HARMLESS is judge.judge(sample.live)
