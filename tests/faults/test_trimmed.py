"""Logs that are trimmed among all else: no wrong answer, nothing stored twice."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from fault_injection.trimmed import Played, play

import semmap_log as sl
from semmap_log.store.writing import segment_chain
from tests.faults.running import faults, is_tried

TRIMMED = ("write", "write", "large", "thin", "keep")
RESENT = ("resend",) * 3


@pytest.fixture
def room(memory: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder; nobody looks at temporary files of others."""
    monkeypatch.setattr(tempfile, "tempdir", str(memory))
    return memory / "room"


def _played(room: Path, acts: Sequence[str]) -> Played:
    return play([(name, f"4 1 {place}") for place, name in enumerate(acts)], room)


def test_a_trimmed_log_answers_as_if_it_were_whole(room: Path) -> None:
    """What is left of it, commands that are sent again, and what is reported late."""
    played = _played(room, (*TRIMMED, *RESENT, "late", "other", "examine"))

    assert "" == played.problem
    assert 0 < played.checked
    assert any("--keep" in step for step in played.steps)


def test_a_command_that_is_stored_again_is_noticed(
    room: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A log that forgets the commands of what was trimmed is wrong as soon as one is repeated."""
    monkeypatch.setattr(segment_chain, "gone_commands", lambda _: iter(()))

    played = _played(room, (*TRIMMED, *RESENT))

    assert "sent again" in played.problem


def test_an_answer_of_another_moment_is_noticed(
    room: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A log that answers for now, whatever was known at the moment, is wrong."""
    replay = sl.DoorLog.replay

    def of_today(log: sl.DoorLog, **moment: Any) -> Any:
        return replay(log, **{name: moment[name] for name in moment.keys() - {"known_at"}})

    monkeypatch.setattr(sl.DoorLog, "replay", of_today)

    assert "expected" in _played(room, ("write", "write", "examine", "examine")).problem


@pytest.mark.slow
def test_whatever_is_done_to_a_log_it_answers_for_what_it_holds(tmp_path: Path) -> None:
    """Trimming among writing, late reports, retractions, joins, copies, exports and recovery."""
    is_tried(faults("trimmed", 25, tmp_path), at_least=25)
