"""Who looks for losses finds them: a judge that always says yes would prove nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from fault_injection.examiner import Examiner
from fault_injection.player import Player, Told
from fault_injection.story import Story, small_limits, story

import semmap_log as sl
from tests.marks import marks

Played = tuple[Story, Path, Told]


@pytest.fixture
def played(tmp_path: Path) -> Played:
    """A story that was told to the end."""
    told, lines = story(3), list[str]()
    (tmp_path / "out").mkdir()
    with small_limits():
        Player(tmp_path / "log", told, lines.append).play()
    return told, tmp_path / "log", Told.of(lines)


def test_a_whole_log_is_good(played: Played) -> None:
    """All wishes are there, and the log can be continued."""
    told, log, said = played

    outcome = Examiner(told).examine("nothing", log, said, must=said.durable)

    assert outcome.is_good, outcome.problem
    assert said.durable == outcome.checked == len(list(sl.read(log).commits())) - 1


def test_a_lost_commit_is_found(played: Played) -> None:
    """The last segment is gone, and what tells of it: as many commits are lost as it had."""
    told, log, said = played
    last = max(log.glob("*.mcap"))
    before = len(list(sl.read(log).commits()))
    for gone in (last, *marks(log), log / "metadata.yaml"):  # they would tell of it
        gone.unlink()
    left = len(list(sl.read(log).commits()))

    outcome = Examiner(told).examine("a segment", log, said, must=said.durable)

    assert before - left == outcome.lost > 0
    assert f"expected the first {before} commits, got {left}" in outcome.problem


def test_an_invented_commit_is_found(played: Played) -> None:
    """One more than was ever asked for."""
    told, log, said = played
    with sl.append(log) as writer:
        writer.add_door(level=0)

    outcome = Examiner(told).examine("one more", log, said, must=said.durable)

    assert 1 == outcome.invented


def test_an_altered_event_is_found(played: Played) -> None:
    """The same number of events under the same command, but one says something else."""
    told, log, said = played
    other = story(4)
    mixed = Story(told.acts, (*told.wishes[:-5], *other.wishes[-5:]))

    outcome = Examiner(mixed).examine("another story", log, said, must=said.durable)

    assert outcome.invented > 0
    assert outcome.lost > 0


def test_a_broken_export_is_found(played: Played) -> None:
    """An exported file that is empty after a crash was not written whole."""
    told, log, said = played
    (log.parent / "out" / "doors.yaml").write_bytes(b"")

    outcome = Examiner(told).examine("an export", log, said, must=said.durable)

    assert "an exported file is not what was exported" in outcome.problem
