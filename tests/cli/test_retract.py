"""`retract` as a person types it: what it says it did, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from tests.verbs import Refuses, Verb

pytestmark = pytest.mark.usefixtures("terminal")


@pytest.fixture
def run(run_verb: Verb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Verb:
    """Run a verb beside a log `office`: door 1 `front` (events 0, 1), seen 40 times (2..41)."""
    monkeypatch.chdir(tmp_path)
    with sl.create("office", tz="UTC") as log:
        door = log.add_door(name="front", at="2026-03-01T11:00")
        for i in range(40):
            log.observe(door, "open" if i & 1 else "closed", at=f"2026-03-01T12:{i:02}")

    return run_verb


def test_it_shows_what_was_hidden(run: Verb) -> None:
    """Number, when, door, what; then the answers leave it out, and the history marks it."""
    code, out, err = run("retract", "office", 41, "--actor", "me", "--reason", "dirty lens")

    assert (0, "") == (code, err)
    assert out.startswith("event 42\nhides 1 event:\n")
    (row,) = [line for line in out.splitlines() if line.strip().startswith("41")]
    assert "front" in row
    assert "seen OPEN" in row
    assert "(retracted" not in out
    assert "CLOSED" in run("replay", "office")[1]
    assert "OPEN" in run("replay", "office", "--event", 41)[1]
    history = run("history", "office", "-n", 2)[1]
    assert "(retracted by event " in " ".join(history.split())
    assert "me: dirty lens" in " ".join(history.split())


@pytest.mark.parametrize("events", ["10..12", "event:10..event:12", "event:10..12"])
def test_a_range_in_its_forms(run: Verb, events: str) -> None:
    """As JSON: the range, and every event that it hid."""
    code, out, _ = run("retract", "office", events, "--json")

    answer = json.loads(out)
    assert 0 == code
    assert (42, 1, 10, 12) == tuple(
        answer[key] for key in ("event", "count", "first_event", "last_event")
    )
    assert [(10, "DoorObserved", 1, True), (11, "DoorObserved", 1, True)] == [
        (e["event"], e["kind"], e["door_id"], e["retracted"]) for e in answer["hidden"][:2]
    ]
    assert 3 == len(answer["hidden"])


def test_of_many_only_some_are_shown(run: Verb) -> None:
    """The first twenty, and how many more there are."""
    out = run("retract", "office", "event:2..41")[1]

    numbers = [line.split()[0] for line in out.splitlines() if line[:6].strip().isdecimal()]
    assert [str(n) for n in range(2, 22)] == numbers
    assert "hides 40 events:" in out
    assert "… and 20 more" in out


def test_a_commit_taken_back_in_part_is_said(run: Verb) -> None:
    """On stderr, since it may be meant: the door is gone, the event that named it is not."""
    code, _, err = run("retract", "office", 0)

    assert 0 == code
    assert "note: of the commit of events 0..1, the others stay.\n" == err


def test_sent_again_it_says_so(run: Verb) -> None:
    """The same command id: the same answer, and nothing is written."""
    command = ("retract", "office", 5, "--command-id", "00" * 15 + "01")
    first, again = run(*command)[1], run(*command)[1]

    assert first == again.replace(" (stored before; nothing was written now)", "")
    assert "stored before" in again


def test_what_it_refuses(run: Verb, refuses: Refuses) -> None:
    """One line that says what is there instead; 2 for what is no number."""
    refuses("""
        retract office 42
        retract office 9..8
        retract office 1..
        retract office yesterday
        retract office -1
    """)
