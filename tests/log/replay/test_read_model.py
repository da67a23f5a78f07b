"""The read model: tables of closed segments, sorted by door. With and without them, one answer."""

from __future__ import annotations

import errno
import fcntl
import itertools
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.cli import main
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorEvent, DoorObserved, RobotPose
from semmap_log.errors import CommandError, LogAccessError, LogLockedError, OutputError
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.replay.read_model import events_about
from semmap_log.log.replay.read_model.indexing import index
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.other_process import NOBODY, only_root, other_process
from tests.test_replay import random_log as any_log

pytest.importorskip("pyarrow")

DOORS = 6
RARE = ["set", "moved", "said", "hidden", "unplaced", "round", "passed", "asked", "drove", "late"]


@pytest.fixture(autouse=True)
def small_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 30)


def random_log(path: Path, seed: int, commits: int = 150) -> Path:
    """Write a log of some doors, with everything that can be said of one."""
    chance = random.Random(seed)
    with sl.create(path, tz="UTC", compact=False, durability="flush") as log:
        doors = [
            log.add_door(x=float(i), y=0.0, theta=0.0, width=0.9, name=f"d{i}", actor="survey")
            for i in range(DOORS)
        ]
        for number in range(commits):
            _one_commit(log, chance, chance.choice(doors), number)
    return path


def _one_commit(log: Any, chance: random.Random, door: Any, number: int) -> None:
    match chance.choice([*["seen"] * len(RARE), *RARE]):
        case "seen":
            source = chance.choice(["laser", "camera", ""])
            state = chance.choice(["open", "closed", "unknown", "moving"])
            log.observe(door, state, accuracy=0.9, source=source)
        case "set":
            log.update_door(door, state="open", reason=f"because {number}", correlation="t1")
        case "moved":
            log.update_door(door, width=0.5 + number / 1000)
        case "said":
            log.annotate(door, "name", f"n{number}", actor="\u00e9va")
        case "hidden":
            with suppress(CommandError):  # it was taken back already, or is a retraction
                log.retract(DOORS * 2 + number // 3)
        case "unplaced":
            log.add_door(name=f"u{number}")
        case "passed":
            log.passed(door, passed=chance.random() < 0.5, waited_s=2.5)
        case "asked":
            log.request(door, "open", actor="porter")
        case "drove":
            pose = RobotPose(level=0, x=1.0, y=number / 7, theta=0.1, sd_xy=0.2, sd_theta=0.01)
            log.append([pose, DoorObserved(door_id=door, state=DoorState.OPEN, opening=0.7)])
        case "late":
            told = log.now_ns() - chance.randrange(10**9)
            log.observe(door, "closed", at=told, source="a note")
        case "round":
            log.start_patrol()
            with suppress(CommandError):  # its beginning may be retracted
                log.finish_patrol()


def answers(path: Path) -> dict[str, list[str]]:
    """Return what a log says of single doors, in every way that may ask tables."""
    log = sl.read(path)
    last = log.last_event()
    spans: list[dict[str, Any]] = [
        {}, {"since": f"event:{last // 4}", "until": f"event:{last // 2}"},
        {"since": log.event(last // 3).recorded_ns, "recorded": True},
    ]  # fmt: skip
    found = {}
    for door in range(1, DOORS + 1):
        for at, span in enumerate(spans):
            found[f"history {door} {at}"] = [repr(e) for e in log.history(door, **span)]
            found[f"events {door} {at}"] = [
                repr(e) for batch in log.batches(doors=[door, 1], **span) for e in batch
            ]
        sources = [batch.sources(DoorObserved) for batch in log.batches(doors=[door])]
        found[f"sources {door}"] = [names[place] for places, names in sources for place in places]
        for moment in (None, f"event:{last // 2}", log.event(last // 2).recorded_ns):
            for known in (False, True):
                asked = {"known_at" if known else "at": moment}
                said = [repr(one) for one in log.timeline(door, **asked)]
                found[f"timeline {door} {moment} {known}"] = said
    return found


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """Which tables gave rows."""
    given: list[Any] = []
    rows_of = events_about._rows

    def seen(tables: Any, *args: Any, **kwargs: Any) -> Any:
        rows = rows_of(tables, *args, **kwargs)
        given.extend([tables.stem] if rows is not None else [])
        return rows

    monkeypatch.setattr(events_about, "_rows", seen)
    return given


@pytest.mark.parametrize("seed", range(3))
def test_with_without_and_with_some(tmp_path: Path, seed: int, asked: list[Any]) -> None:
    """Event by event the same, whichever tables there are."""
    log = random_log(tmp_path / "log", seed)
    expected = answers(log)
    assert not asked

    done = index(log)
    assert done.segments == len(done.made) > 3
    assert expected == answers(log)
    assert set(asked) >= {Path(name).stem for name in done.made[:-1]}  # the last may be short

    for name in random.Random(seed).sample(done.made, 3):
        (log / "index" / f"{Path(name).stem}.json").unlink()
    assert expected == answers(log)
    shutil.rmtree(log / "index")
    assert expected == answers(log)


def test_the_live_end_and_what_is_retracted_later(tmp_path: Path, asked: list[Any]) -> None:
    """What came after the index was made counts, and retractions count as they are known now."""
    log = random_log(tmp_path / "log", 1)
    index(log)
    with sl.append(log, compact=False) as writer:
        writer.observe(1, "open", source="late")
        writer.retract(DOORS * 2 + 40, DOORS * 2 + 60)
    found = answers(log)
    assert asked

    shutil.rmtree(log / "index")
    assert answers(log) == found


def test_compacted_and_merged(tmp_path: Path, asked: list[Any]) -> None:
    """Compaction changes no hash, so tables stay good; segments that were merged have none."""
    log = random_log(tmp_path / "log", 2)
    expected = answers(log)
    index(log)
    compact(log, merge=False)
    assert not index(log).made

    compact(log)
    asked.clear()
    assert expected == answers(log)
    done = index(log)
    assert done.made
    assert done.removed
    assert expected == answers(log)


@pytest.mark.parametrize("name", ["json", "events.parquet", "commits.parquet"])
@pytest.mark.parametrize("harm", ["cut", "gone", "flipped", "foreign", "empty"])
def test_a_bad_table_is_not_used(
    tmp_path: Path, name: str, harm: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Stale, damaged, foreign or half: the log is read instead, and verify names it."""
    log = random_log(tmp_path / "log", 3)
    expected = answers(log)
    index(log)
    file = log / "index" / f"log_000002.{name}"
    data = file.read_bytes()
    match harm:
        case "cut":
            file.write_bytes(data[: len(data) // 2])
        case "gone":
            file.unlink()
        case "flipped":
            file.write_bytes(data[:40] + bytes([data[40] ^ 1]) + data[41:])
        case "foreign":
            other = random_log(tmp_path / "other" / "log", 4)
            index(other)
            shutil.copy(other / "index" / file.name, file)
        case "empty":
            file.write_bytes(b"")

    assert expected == answers(log)
    found = verify(log)
    assert found.exit_code == 0
    named = [finding for finding in found.findings if finding.kind == "index"]
    assert bool(named) == ((name, harm) != ("json", "gone"))  # then there is none
    assert all("log_000002" in finding.text for finding in named)

    capsys.readouterr()
    assert index(log).made == ["log_000002.mcap"]
    assert not [finding for finding in verify(log).findings if finding.kind == "index"]
    assert expected == answers(log)


def test_every_flipped_byte(tmp_path: Path) -> None:
    """Wherever a byte of a table changes, the answer does not."""
    log = random_log(tmp_path / "log", 5, commits=70)
    expected = answers(log)
    index(log)
    chance = random.Random(0)
    for file in sorted((log / "index").glob("log_000001.*")):
        data = file.read_bytes()
        for at in chance.sample(range(len(data)), 6):
            file.write_bytes(
                data[:at] + bytes([data[at] ^ (1 << chance.randrange(8))]) + data[at + 1 :]
            )
            assert expected == answers(log), f"{file.name} byte {at}"
        file.write_bytes(data)


def test_two_at_once(tmp_path: Path) -> None:
    """One does it, the other says so."""
    log = random_log(tmp_path / "log", 6, commits=70)

    def begin_another() -> None:
        with pytest.raises(LogLockedError, match="another process is making this index"):
            index(log)

    assert index(log, pause=begin_another).made


def test_killed_amid_the_work(tmp_path: Path) -> None:
    """Whole tables are left, or none; the next one goes on."""
    log = random_log(tmp_path / "log", 7)
    expected, steps = answers(log), 0

    def stop() -> None:
        nonlocal steps
        steps += 1
        if steps == 8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        index(log, pause=stop)
    assert expected == answers(log)
    assert index(log).made
    assert expected == answers(log)
    assert not [file for file in (log / "index").iterdir() if "tmp" in file.name]


def test_an_index_that_leads_elsewhere(tmp_path: Path) -> None:
    """Nothing is written through a link."""
    log = random_log(tmp_path / "log", 8, commits=40)
    (tmp_path / "elsewhere").mkdir()
    (log / "index").symlink_to(tmp_path / "elsewhere")

    with pytest.raises(LogAccessError, match="got a link"):
        index(log)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_whoever_writes_keeps_it_up(tmp_path: Path) -> None:
    """Once there is an index, each segment that is closed comes into it in the background."""
    log = random_log(tmp_path / "log", 9, commits=40)
    index(log)
    with sl.append(log) as writer:
        for _ in range(100):
            writer.observe(1, "open")
    with sl.append(log) as writer:  # what the first did not get to
        writer.observe(1, "closed")

    tables = {file.name.split(".")[0] for file in (log / "index").glob("*.json")}
    assert len(tables) >= 3


def test_no_index_is_made_unasked(tmp_path: Path) -> None:
    """A robot without pyarrow, or that nobody asks, does no work for it."""
    log = tmp_path / "log"
    with sl.create(log, tz="UTC") as writer:
        door = writer.add_door(name="a")
        for _ in range(70):
            writer.observe(door, "open")
    assert not (log / "index").exists()


def run(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 0


def test_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It says what it made; a second time there is nothing to do."""
    log = random_log(tmp_path / "log", 10)
    run(["index", str(log), "--json"])
    first = json.loads(capsys.readouterr().out)
    run(["index", str(log)])
    said = capsys.readouterr().out

    assert first["segments"] == len(first["made"]) == len(list((log / "index").glob("*.json")))
    assert first["events"] == sum(1 for _ in sl.read(log).history())
    assert "tables made       0" in said
    run(["index", str(log), "--anew", "--json"])
    assert json.loads(capsys.readouterr().out)["made"] == first["made"]


def test_tables_hold_the_commits(tmp_path: Path) -> None:
    """Who and why: else the log itself would answer, and take longer."""
    log = random_log(tmp_path / "log", 11, commits=100)
    index(log)
    reader = LogReader(log)
    tables = events_about.SegmentTables.of(log / "index", reader.segments[0])
    assert tables is not None

    found = tables.commits

    commits = list(reader.commits())[: len(found.first_event)]
    assert [c.first_event for c in commits] == found.first_event.tolist()
    assert [c.note.actor for c in commits] == [found.texts[n][0] for n in found.notes.tolist()]


def test_info_tells_how_far_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing without an index; else how many closed segments have tables that fit."""
    log = random_log(tmp_path / "log", 11, commits=100)
    run(["info", str(log), "--json"])
    assert json.loads(capsys.readouterr().out)["index"] is None

    made = index(log).made
    run(["info", str(log), "--json"])
    said = json.loads(capsys.readouterr().out)["index"]
    assert said["segments"] == said["indexed"] == len(made)
    assert said["bytes"] == sum(f.stat().st_size for f in (log / "index").iterdir())

    (log / "index" / "log_000001.json").write_text("{}")
    run(["info", str(log)])
    out = " ".join(capsys.readouterr().out.split())
    assert f"{len(made) - 1} of {len(made)} closed files" in out
    assert f"semmap-log index {log}" in out


def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The verb says so; whoever writes goes on, and every event is there."""
    from semmap_log.core.arrow import parquet

    def full(*_args: Any, **_kwargs: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    log = random_log(tmp_path / "log", 12, commits=60)
    index(log)
    monkeypatch.setattr(parquet, "write_groups", full)
    with pytest.raises(OutputError, match=r"No space left on device\. The log is as it was"):
        index(log, anew=True)
    with sl.append(log) as writer:
        for _ in range(100):
            writer.observe(1, "open")
    last = sl.read(log).last_event()
    assert [e.number for e in sl.read(log).history(1)][-100:] == list(range(last - 99, last + 1))


@pytest.mark.parametrize(
    "examples", [8, pytest.param(40, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_whatever_a_log_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, examples: int
) -> None:
    """Commits of any events, late ones and retractions: with tables, without, and with some."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 9)
    monkeypatch.setattr(events_about, "FEW_CHUNKS", 0)
    made = itertools.count()

    @settings(max_examples=examples, deadline=None)
    @given(seed=st.integers(0, 2**32), kept=st.sets(st.integers(0, 9)), compacted=st.booleans())
    def check(seed: int, kept: set[int], compacted: bool) -> None:
        log = tmp_path / f"log{next(made)}"
        told = any_log(log, random.Random(seed), commits=40)
        doors = {e.door_id for *_, e in told if isinstance(e, DoorEvent)}
        expected = told_of(log, doors)
        if compacted:
            compact(log)
        index(log)
        assert expected == told_of(log, doors)
        for place, file in enumerate(sorted((log / "index").glob("*.json"))):
            if place not in kept:
                file.unlink()
        assert expected == told_of(log, doors)
        shutil.rmtree(log)

    check()


def told_of(path: Path, doors: set[Any]) -> list[str]:
    """Return what a log tells of some doors: events, states, beliefs."""
    log = sl.read(path)
    there = sorted(doors & set(log.replay().doors))
    last = log.last_event()
    return [
        *(repr(entry) for door in sorted(doors) for entry in log.history(door)),
        *(repr(one) for door in there for at in (None, f"event:{last // 2}")
          for known in (None, f"event:{last // 3}") for one in log.timeline(door, at, known)),
        *(repr(one) for door in there for one in probabilities(log, doors=[door])),
    ]  # fmt: skip


def test_tables_that_are_exchanged_while_a_question_is_answered(tmp_path: Path) -> None:
    """What was looked for first is what is read, or the log is."""
    log = random_log(tmp_path / "log", 13)
    other = random_log(tmp_path / "other" / "log", 14)
    expected = [repr(entry) for entry in sl.read(log).history(1)]
    index(log)
    index(other)
    asked = sl.read(log).history(1)
    found = [repr(next(asked))]
    for file in sorted((other / "index").glob("log_*")):
        shutil.copy(file, log / "index" / file.name)

    assert expected == [*found, *(repr(entry) for entry in asked)]


@pytest.mark.parametrize("name", ["json", "events.parquet", "commits.parquet"])
@pytest.mark.parametrize("what", ["pipe", "folder", "link", "no end"])
def test_what_is_no_file_is_not_read(tmp_path: Path, name: str, what: str) -> None:
    """A pipe would hold everybody up, and a device would never end."""
    log = random_log(tmp_path / "log", 15, commits=100)
    expected = [repr(entry) for entry in sl.read(log).history(1)]
    index(log)
    file = log / "index" / f"log_000001.{name}"
    file.unlink()
    match what:
        case "pipe":
            os.mkfifo(file)
        case "folder":
            file.mkdir()
        case "link":
            file.symlink_to("nowhere")
        case "no end":
            file.symlink_to("/dev/zero")

    assert expected == [repr(entry) for entry in sl.read(log).history(1)]
    assert [finding.path for finding in verify(log).findings if finding.kind == "index"]
    state = sl.read(log).summary().index
    assert state is not None
    assert state.indexed == state.segments - 1


def test_a_table_that_is_cut_while_it_is_read(tmp_path: Path) -> None:
    """It is not mapped: the process goes on, and reads the log."""
    log = random_log(tmp_path / "log", 16)
    expected = [repr(entry) for entry in sl.read(log).history(1)]
    index(log)
    asked = sl.read(log).history(1)
    found = [repr(next(asked))]
    for file in (log / "index").glob("*.parquet"):
        os.truncate(file, 100)

    assert expected == [*found, *(repr(entry) for entry in asked)]


def test_a_name_with_a_dot(tmp_path: Path) -> None:
    """Tables are made once; and what is not ours stays."""
    log = random_log(tmp_path / "of.fice", 17, commits=100)
    made = index(log).made
    ours = {file.name for file in (log / "index").iterdir()}
    for name in ("plan.json", "draft.tmp", "my.events.parquet"):
        (log / "index" / name).write_text("not ours")
    shutil.copy(log / "index" / "of.fice_000000.json", log / "index" / "of.fice_000077.json")

    again = index(log)
    assert (len(made), [], ["of.fice_000077.json"]) == (again.segments, again.made, again.removed)
    left = {file.name for file in (log / "index").iterdir()}
    assert ours | {"plan.json", "draft.tmp", "my.events.parquet"} == left


def test_a_child_does_not_keep_the_lock(tmp_path: Path) -> None:
    """A process that was forked amid the work may live on; the next one can begin."""
    log = random_log(tmp_path / "log", 18, commits=70)
    children: list[int] = []
    ready, end = os.pipe()

    def fork() -> None:
        if not children:
            children.append(os.fork())
            if not children[0]:
                os.close(end)
                os.read(ready, 1)  # until the parent ends it
                os._exit(0)

    index(log, pause=fork)
    assert index(log, anew=True).made
    os.close(end)
    os.waitpid(children[0], 0)


@only_root
def test_a_stranger_who_locks_an_index_keeps_nobody_out(tmp_path: Path) -> None:
    """Its folder, and a lock file that an older version made for all to read."""
    log = random_log(tmp_path / "log", 18, commits=70)
    index(log)
    (log / "index" / ".lock").chmod(0o644)

    def lock() -> list[int]:
        held = [os.open(name, os.O_RDONLY) for name in (".", ".lock")]
        for fd in held:
            fcntl.flock(fd, fcntl.LOCK_EX)
        return held

    with other_process(lock, log / "index", uid=NOBODY):
        assert index(log, anew=True).made


@only_root
def test_an_index_that_nobody_may_read() -> None:
    """It is not used, and verify names it."""
    program = """
import os, sys, semmap_log as sl
from pathlib import Path
from semmap_log.log.replay.maintenance import verify
def told():
    log = sl.read(sys.argv[1])
    found = [finding.kind for finding in verify(Path(sys.argv[1])).findings]
    return len(list(log.history(1))), log.summary().index.indexed, found
told()  # what it takes is loaded now
os.setuid(65534)
print(told())
"""
    with tempfile.TemporaryDirectory() as folder:  # pytest's own are for one user
        Path(folder).chmod(0o755)
        log = random_log(Path(folder) / "log", 19, commits=100)
        expected = [repr(entry) for entry in sl.read(log).history(1)]
        index(log)
        (log / "index").chmod(0o700)

        done = subprocess.run(
            [sys.executable, "-c", program, str(log)], capture_output=True, text=True, check=False
        )

    assert f"({len(expected)}, 0, ['index'])" == done.stdout.strip(), done.stderr
