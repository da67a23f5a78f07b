"""`redact`, `retain` and `pin`, as a user types them."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import HistoryTrimmed, RobotPose
from semmap_log.store.folder import LogFolder
from semmap_log.store.lock import WriterLock
from semmap_log.store.writing import segment_chain
from tests.log.trimming.logs import MinuteClock
from tests.store.trimming.plain_chain import all_bytes
from tests.verbs import ran

HOUR_NS = 3600 * 10**9


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Ten days up to now, by the clock of this machine: four sightings an hour."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 60)
    now_ns = time.time_ns() - HOUR_NS // 2
    clock, path = MinuteClock(), tmp_path / "office"
    clock.now_ns = now_ns - 242 * HOUR_NS
    with sl.create(path, tz="UTC", clock=clock, compact=False) as made:
        made.add_door(name="front", actor="anna", reason="first map")
        for hour in range(240):
            clock.now_ns = now_ns - (241 - hour) * HOUR_NS
            made.append([RobotPose(x=1.0, y=2.0, theta=0.0)])
            for _ in range(4):
                clock.now_ns += 60 * 10**9
                made.observe(1, "open" if hour % 12 else "closed", accuracy=0.9)
            if hour == 120:
                made.annotate(1, "owner", "Zoe", actor="anna")
    return path


def trimmings(log: Path) -> list[HistoryTrimmed]:
    return [h.event for h in sl.read(log).history() if isinstance(h.event, HistoryTrimmed)]


def test_an_age_is_counted_from_now(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Done again at once, there is nothing more: the log's own words have not moved the moment."""
    for option in ("--thin", "--keep"):
        code, out, _ = ran(capsys, "retain", log, option, "5d", "--json")
        done = json.loads(out)
        assert code == 0
        assert done["events"] > 200
        code, out, _ = ran(capsys, "retain", log, option, "5d", "--json")
        assert code == 0
        assert json.loads(out)["events"] == 0

    assert ran(capsys, "replay", log, "--at", "9d ago")[0] == 1
    assert ran(capsys, "replay", log, "--at", "4d ago")[0] == 0


def test_the_head_of_a_commit_that_is_gone(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Is not found; that it may be among those that went is said."""
    heads = [commit.hash.hex() for commit in sl.read(log).commits()]
    assert ran(capsys, "retain", log, "--keep", "5d")[0] == 0

    code, out, _ = ran(capsys, "verify", log, "--head", heads[100])
    assert code == 4
    assert "commits that were taken out" in " ".join(out.split())
    code, out, _ = ran(capsys, "verify", log, "--head", heads[-1])
    assert code == 4
    assert "not vouched for" in out
    assert "commits that were taken out" not in " ".join(out.split())


def test_what_is_kept_may_begin_at_a_time(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One that is still to come is refused, and so is what is no time."""
    day = time.strftime("%Y-%m-%d", time.gmtime(time.time() - 3 * 86400))
    assert ran(capsys, "retain", log, "--keep", day, "--by", "admin", "--reason", "policy")[0] == 0
    assert trimmings(log)[-1].reasons == "expired"
    assert day in trimmings(log)[-1].rule
    commit = list(sl.read(log).commits())[-1]
    assert (commit.note.actor, commit.note.reason) == ("admin", "policy")

    for told, why in (("2100-01-01", "still to come"), ("much", "2h or 1.5d")):
        code, _, err = ran(capsys, "retain", log, "--keep", told)
        assert code
        assert why in " ".join(err.split())


@pytest.mark.parametrize("words", [(), ("--keep", "1d", "--thin", "1d")])
def test_retain_wants_one_of_two(
    log: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    """What else could be meant is not guessed."""
    code, _, err = ran(capsys, "retain", log, *words)

    assert code == 2
    assert "expected --keep or --thin" in err


def test_a_dry_run_says_what_would_go(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same numbers as afterwards, and no byte is written."""
    before = {path.name: path.read_bytes() for path in log.iterdir()}
    words = ("redact", log, "--actor", "anna", "--tracks", "--door", "front", "--key", "owner")

    said = json.loads(ran(capsys, *words, "--dry-run", "--json")[1])

    assert {path.name: path.read_bytes() for path in log.iterdir()} == before
    done = json.loads(ran(capsys, *words, "--json")[1])
    numbers = ("events", "notes", "segments")
    assert [said[name] for name in numbers] == [done[name] for name in numbers]
    assert (done["events"], done["notes"]) == (241, 2)
    assert said["event"] is None
    assert done["event"] == sl.read(log).last_event()


def test_what_was_redacted_is_in_no_file(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And `verify` says that something went, by which rule."""
    (log / "office_000000.mcap.torn-1").write_bytes(b"Zoe")
    words = ("--actor", "anna", "--door", "front", "--key", "owner", "--by", "officer")

    code, out, err = ran(capsys, "redact", log, *words)

    assert code == 0
    assert "took out 1 event and 2 notes" in out
    assert "torn-1: may hold it still" in err
    (log / "office_000000.mcap.torn-1").unlink()
    assert not [name for name, data in all_bytes(log) if b"Zoe" in data or b"anna" in data]
    code, out, _ = ran(capsys, "verify", log)
    assert code == 0
    assert "1 event and 2 notes were taken out (redacted)" in " ".join(out.split()), out
    assert ran(capsys, "redact", log, *words)[1].endswith("there is nothing of that to take out.\n")


@pytest.mark.parametrize(
    ("words", "why"),
    [((), "what to take out"), (("--door", "front"), "--door and --key"),
     (("--key", "owner"), "--door and --key"), (("--door", "back", "--key", "x"), "back")],
)  # fmt: skip
def test_redact_wants_to_know_what(
    log: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], why: str
) -> None:
    """Nothing is taken out that nobody named."""
    before = {path.name: path.read_bytes() for path in log.iterdir()}

    code, _, err = ran(capsys, "redact", log, *words)

    assert code
    assert why in err
    assert {path.name: path.read_bytes() for path in log.iterdir()} == before


def test_while_somebody_writes_nothing_is_taken_out(
    log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is said who; the log is as it was."""
    before = sorted(path.name for path in log.iterdir())
    lock = WriterLock(LogFolder(log))
    try:
        code, _, err = ran(capsys, "redact", log, "--tracks")
    finally:
        lock.release()

    assert code == 1
    assert "writing" in err
    assert sorted(path.name for path in log.iterdir()) == before
    assert not trimmings(log)


def test_a_pinned_moment_outlives_its_past(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Asked by its name after the retention; a name that nobody gave is an error."""
    assert ran(capsys, "pin", log, "audit", "--at", "9d ago", "--actor", "anna")[0] == 0
    was = json.loads(ran(capsys, "replay", log, "--at", "pin:audit", "--json")[1])
    assert ran(capsys, "retain", log, "--keep", "2d")[0] == 0

    now = json.loads(ran(capsys, "replay", log, "--at", "pin:audit", "--json")[1])
    assert now["doors"] == was["doors"]
    assert ran(capsys, "replay", log, "--at", "9d ago")[0] == 1
    code, _, err = ran(capsys, "replay", log, "--at", "pin:nothing")
    assert code == 1
    assert "nothing" in err
    code, _, err = ran(capsys, "pin", log, "late", "--at", "9d ago")
    assert code == 1
    assert "no longer kept" in err


def test_the_same_pin_sent_again_is_stored_once(log: Path) -> None:
    """By the id of its command, as any other command."""
    with sl.append(log) as opened:
        first = opened.pin("audit", at="2d ago", command_id=bytes(15) + b"\1", actor="anna")
        again = opened.pin("audit", at="2d ago", command_id=bytes(15) + b"\1", actor="anna")

    assert again.commit == first.commit
    assert sl.read(log).pins()["audit"].at_ns > 0
