"""Recovery on demand: whole commits survive as they were, the rest is named, none is invented."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.model.events import Retracted
from semmap_log.errors import LogAccessError, LogError, LogExistsError, LogLockedError
from semmap_log.log.replay.maintenance import plan_recovery, recover, recover_into, verify
from semmap_log.store.byte_layout import RECOVERING_NAME
from semmap_log.store.folder import LogFolder
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.repairing import recovering
from semmap_log.store.repairing.recovering import ACTOR
from semmap_log.store.repairing.rewriting import Renumbering
from tests.store.eventful import contents, eventful_log, flip


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return eventful_log(tmp_path_factory.mktemp("original") / "log")


@pytest.fixture
def log(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "log"))


def spoil(log: Path, number: int, chunk: int) -> None:
    """Flip a bit in the records of a chunk."""
    file = sorted(log.glob("*.mcap"))[number]
    flip(file, open_segment(file).chunks[chunk].data_offset + 40)


def told(log: Path) -> list[tuple[Any, ...]]:
    """Return all that is to be known of each event but its number."""
    opened = sl.read(log)
    return [
        (e.recorded_ns, e.happened_ns, repr(e.event), e.actor, e.reason, e.command_id)
        for e in opened.history()
    ]


def promised(log: Path) -> list[tuple[Any, ...]]:
    """Return what each commit says of clocks and durability."""
    return [
        (c.command_id, c.wall_clock_ns, c.monotonic_clock_ns, c.boot_id, c.durability, c.content)
        for c in sl.read(log)._reader.commits()
    ]


def test_a_good_log_is_left_alone(log: Path, tmp_path: Path) -> None:
    """In place and into another folder: no byte is written, and there is nothing to do."""
    before = contents(log)

    found, done = plan_recovery(log), recover(log)
    into = recover_into(log, tmp_path / "new")

    assert not found.has_to_do
    assert (None, None, None) == (done.log, done.kept, into.log)
    assert before == contents(log)
    assert ["log"] == [path.name for path in tmp_path.iterdir()]


def test_a_survey_writes_nothing_and_names_what_is_lost(log: Path) -> None:
    """Events by number and time, files, and doors whose adding is gone."""
    recorded = [entry[0] for entry in told(log)]
    spoil(log, 0, 2)  # the door `back` and its name
    before = contents(log)

    found = plan_recovery(log)

    (loss,) = found.losses
    assert before == contents(log)
    assert (2, 3, 2) == (loss.first_event, loss.last_event, found.lost_events)
    assert loss.after_ns is not None
    assert recorded[1] < loss.after_ns < recorded[2]
    assert recorded[4] == loss.before_ns
    assert ("log_000000.mcap",) == loss.files
    assert (2,) == found.doors
    assert (10, 11, False) == (found.commits, found.events, found.keeps_numbers)


def test_into_another_folder(log: Path, tmp_path: Path) -> None:
    """The damaged log stays as it is."""
    was, kept = told(log), promised(log)
    spoil(log, 0, 2)
    before = contents(log)

    done = recover_into(log, tmp_path / "new")

    new = sl.read(tmp_path / "new")
    made = verify(tmp_path / "new")
    *survivors, last = told(tmp_path / "new")
    assert before == contents(log)
    assert ((), 3 - 2) == (made.findings, made.segments)
    assert [*was[:2], *was[4:]] == [entry_with_old_numbers(e) for e in survivors]
    assert [*kept[:1], *kept[2:]] == promised(tmp_path / "new")[:-1]
    assert done.plan.info is not None
    assert done.plan.info.log_id != new.info.log_id
    assert ACTOR == last[3]
    assert "lost were events 2..3" in last[4]
    assert [tmp_path / "log", tmp_path / "new"] == sorted(tmp_path.iterdir())
    assert ["closed-0-12.json", "metadata.yaml", "new_000000.mcap"] == sorted(
        contents(tmp_path / "new")
    )


def entry_with_old_numbers(entry: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return an entry of the test above: its one retraction speaks of event 8, now 6."""
    text = entry[2].replace("first_event=6, last_event=6", "first_event=8, last_event=8")
    return (*entry[:2], text, *entry[3:])


def test_in_place_the_damaged_files_are_kept(log: Path) -> None:
    """All of them, byte for byte; what is not the log's stays where it was."""
    spoil(log, 1, 1)
    (log / "notes.txt").write_text("mine")
    before = {name: data for name, data in contents(log).items() if name != ".lock"}

    done = recover(log)

    assert log / "damaged-1" == done.kept
    kept = contents(log / "damaged-1")
    assert before == {**{n: d for n, d in kept.items() if n != ".lock"}, "notes.txt": b"mine"}
    assert "mine" == (log / "notes.txt").read_text()
    assert 0 == verify(log).exit_code
    after = contents(log)
    assert (None, after) == (recover(log).log, contents(log))

    spoil(log, 0, 1)
    again = recover(log)

    assert log / "damaged-2" == again.kept
    assert (log / "damaged-1" / "log_000002.mcap").exists()
    assert ["damaged-1", "damaged-2"] == sorted(p.name for p in log.iterdir() if p.is_dir())


def test_nothing_lost_keeps_numbers_hashes_and_the_id(log: Path) -> None:
    """Damage to what can be computed again, such as a summary."""
    head, log_id = verify(log).head, sl.read(log).info.log_id
    was = told(log)
    for file in sorted(log.glob("*.mcap")):
        flip(file, len(file.read_bytes()) - 60)

    done = recover(log)

    found = verify(log, head)
    assert done.plan.keeps_numbers
    assert (0, 1) == (found.exit_code, found.events_after_head)
    assert was == told(log)[:-1]
    assert log_id == sl.read(log).info.log_id
    assert "nothing was lost" == told(log)[-1][4]


def test_a_retraction_follows_its_events(log: Path) -> None:
    """Renumbered with them; dropped and named when all of them are lost."""
    spoil(log, 0, 1)  # events 0 and 1
    recover(log)
    (moved,) = [e.event for e in sl.read(log).history(kinds=[Retracted])]
    assert (6, 6) == (moved.first_event, moved.last_event)

    spoil(log, 0, open_place(log, 6))
    found = plan_recovery(log)
    recover(log)

    assert (7,) == found.dropped
    assert [] == list(sl.read(log).history(kinds=[Retracted]))
    assert "lost events were dropped: 7" in told(log)[-1][4]
    assert 0 == verify(log).exit_code


def test_each_segment_of_a_new_log_begins_with_the_state_so_far(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its keyframes are those of what was saved, so that a moment is answered from them."""
    monkeypatch.setattr(recovering, "ROLL_COMMITS", 3)
    spoil(log, 0, 1)  # events 0 and 1

    recover(log)

    found = verify(log)
    assert (0, found.segments) == (found.exit_code, found.keyframes)
    assert found.segments > 2


def open_place(log: Path, event: int) -> int:
    """Return the place of the chunk whose commit begins with that event."""
    firsts = [commit.first_event for commit in sl.read(log)._reader.commits()]
    return 1 + firsts.index(event)


@pytest.mark.slow
def test_a_commit_of_several_chunks_is_lost_whole(tmp_path: Path) -> None:
    """And one that survives comes out as it went in, chunk by chunk."""
    from tests.store.logs import sightings

    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as opened:
        door = opened.add_door(name="front")
        for _ in range(2):
            opened.append(sightings(door, 30_000))
    was = told(path)
    chunks = open_segment(path / "log_000000.mcap").chunks
    assert len(chunks) > 5
    spoil(path, 0, 2)  # the beginning of the first long commit

    recover(path)

    assert [*was[:2], *was[30_002:]] == told(path)[:-1]
    assert ((), 30_003) == (verify(path).findings, verify(path).events)


def test_a_torn_tail_is_no_damage(original: Path, tmp_path: Path) -> None:
    """The next writer mends it; recovery leaves it to that."""
    folder = tmp_path / "log"
    folder.mkdir()
    data = (original / "log_000000.mcap").read_bytes()
    end = open_segment(original / "log_000000.mcap").chunks[-1].offset
    (folder / "log_000000.mcap").write_bytes(data[: end + 50])

    done = recover(folder)

    assert (3, False, None) == (verify(folder).exit_code, done.plan.has_to_do, done.log)


@pytest.mark.slow
@settings(max_examples=25, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture,
                                 HealthCheck.too_slow])  # fmt: skip
@given(
    places=st.lists(
        st.tuples(st.integers(0, 2), st.floats(0, 1, exclude_max=True), st.sampled_from(
            ["flip", "zero", "cut", "end", "file"]
        )),
        min_size=1,
        max_size=4,
    ),
    in_place=st.booleans(),
)  # fmt: skip
@example(places=[(0, 0.0, "end"), (1, 0.0, "end"), (2, 0.0, "end")], in_place=False)
@example(places=[(0, 0.0, "file"), (1, 0.0, "file"), (2, 0.0, "file")], in_place=True)
def test_whatever_was_damaged(
    original: Path, log: Path, tmp_path: Path,
    places: list[tuple[int, float, str]], in_place: bool,
) -> None:  # fmt: skip
    """The old events in order with all fields and times; each undamaged commit is there."""
    was = without_numbers(original)
    restore(original, log, tmp_path)
    for number, place, what in places:
        damage(log / f"log_00000{number}.mcap", place, what)
    if not any(file.stat().st_size for file in log.glob("*.mcap")):
        with pytest.raises(LogError, match="no segment of a semmap log is in this folder"):
            plan_recovery(log)
        return
    found = plan_recovery(log)
    if not found.has_to_do:
        return

    done = recover(log) if in_place else recover_into(log, tmp_path / "new")

    assert done.log is not None
    made = verify(done.log)
    survivors = without_numbers(done.log)[:-1]
    assert () == tuple(f for f in made.findings if f.severity > 0)
    assert survivors == [entry for entry in was if entry in survivors]
    assert len(survivors) == found.events
    assert found.events + len(found.dropped) == found.verification.events
    if in_place:
        assert not recover(log).plan.has_to_do


def restore(original: Path, log: Path, tmp_path: Path) -> None:
    """Put the log back as it was before the last example."""
    for folder in (log, tmp_path / "new"):
        shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(original, log)


def damage(file: Path, place: float, what: str) -> None:
    if not file.exists() or not file.stat().st_size:
        return
    data = bytearray(file.read_bytes())
    at = int(place * len(data))
    if what == "flip":
        data[at] ^= 4
    elif what == "zero":
        data[at : at + 512] = bytes(len(data[at : at + 512]))
    elif what == "cut":
        del data[at : at + 700]
    else:
        del data[at:]
    if what == "file":
        file.unlink()
    else:
        file.write_bytes(data)


def without_numbers(log: Path) -> list[tuple[Any, ...]]:
    """Return the events, a retraction without the numbers that it names."""
    return [(*entry[:2], entry[2].partition("first_event")[0], *entry[3:]) for entry in told(log)]


def test_the_state_is_that_of_the_events_that_are_left(log: Path) -> None:
    """Keyframes are made anew; floor maps are those of the log, whatever their numbers."""
    spoil(log, 0, 3)

    recover(log)

    new = sl.read(log).replay()
    found = verify(log)
    assert {"front", "back"} == {door.name for door in new.doors.values()}
    assert 2 in new.levels
    assert found.segments == found.keyframes


def test_who_writes_is_not_disturbed(log: Path) -> None:
    """A log that is open for writing is not recovered in place."""
    spoil(log, 0, 2)
    lock = WriterLock(LogFolder(log))
    try:
        with pytest.raises(LogLockedError):
            recover(log)
    finally:
        lock.release()


def test_wrong_places(log: Path, tmp_path: Path) -> None:
    """No log, a file, a target that is taken: said, and nothing is made."""
    spoil(log, 0, 2)
    with pytest.raises(LogExistsError, match="expected a new folder"):
        recover_into(log, log)
    for path in (tmp_path / "absent", next(log.glob("*.mcap")), tmp_path):
        with pytest.raises(LogError):
            recover(path)
    assert [log] == list(tmp_path.iterdir())
    assert not (log / "damaged-1").exists()


STEPS = 21
"""Changes of the file system that a recovery makes, and one more."""


@pytest.mark.slow
@pytest.mark.parametrize("step", [*range(1, STEPS, 2), STEPS])
def test_killed_at_any_step(step: int, log: Path, original: Path, tmp_path: Path) -> None:
    """The log is the old one or the new one, whole; afterwards it can be recovered."""
    spoil(log, 0, 2)
    damaged = contents(log)
    old = plan_recovery(log).verification.findings

    died = _recover_killed(log, step)

    found = verify(log)
    is_new = found.exit_code == 0
    assert is_new or found.findings == old
    recover(log)
    kept = contents(log / "damaged-1")
    assert 0 == verify(log).exit_code
    assert {n: d for n, d in damaged.items() if n != ".lock"} == {
        n: d for n, d in kept.items() if n != ".lock"
    }
    assert [log] == list(tmp_path.iterdir())
    assert not (log / RECOVERING_NAME).exists()
    assert died == (step < STEPS)


def _recover_killed(log: Path, step: int) -> bool:
    """Recover in a process that is killed before its n-th change; tell whether it came so far."""
    code = f"""
import os, signal, sys, pathlib
left = {step}
def before(real):
    def call(*args, **more):
        global left
        left -= 1
        if not left:
            os.kill(os.getpid(), signal.SIGKILL)
        return real(*args, **more)
    return call
for name in ("replace", "rename", "link", "unlink", "mkdir", "rmdir", "fsync"):
    setattr(os, name, before(getattr(os, name)))
from semmap_log.store.lock import WriterLock
from semmap_log.store.folder import LogFolder
from semmap_log.store.repairing import recovering
from semmap_log.log.replay.maintenance import recover
recovering._exchange = before(recovering._exchange)
recover(pathlib.Path({str(log)!r}))
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True)
    assert done.returncode in (0, -9), done.stderr.decode()
    return done.returncode == -9


def test_where_folders_cannot_be_swapped(log: Path, tmp_path: Path, monkeypatch) -> None:
    """Some file systems cannot: it says so, names the way out, and leaves nothing behind."""
    spoil(log, 0, 2)
    before = contents(log)

    def refuse(one: Path, other: Path) -> None:
        raise OSError(22, os.strerror(22))

    monkeypatch.setattr(recovering, "_exchange", refuse)
    with pytest.raises(LogAccessError, match=r"--out NEW"):
        recover(log)

    assert before == contents(log)
    assert [log] == list(tmp_path.iterdir())


def test_a_strangers_links_lead_nowhere(log: Path, tmp_path: Path) -> None:
    """The kept files of an unfinished recovery are a link to somebody's folder."""
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    (theirs / "letter.txt").write_text("mine")
    spoil(log, 0, 2)
    (log / RECOVERING_NAME).touch()
    (log / "damaged-7").symlink_to(theirs)

    recover(log)

    assert ["letter.txt"] == [path.name for path in theirs.iterdir()]
    recovering.beside(log).symlink_to(theirs)
    (theirs / RECOVERING_NAME).touch()
    spoil(log, 0, 2)
    with pytest.raises(LogAccessError, match="expected nothing at this place"):
        recover(log)
    assert (theirs / "letter.txt").exists()


def test_a_folder_of_somebody_else_in_the_way_stays(log: Path) -> None:
    """It has the name of an unfinished recovery's, but not its mark."""
    spoil(log, 0, 2)
    recovering.beside(log).mkdir()
    (recovering.beside(log) / "letter.txt").write_text("mine")

    with pytest.raises(LogAccessError, match="expected nothing at this place"):
        recover(log)

    assert "mine" == (recovering.beside(log) / "letter.txt").read_text()


def test_a_log_that_was_moved_is_not_exchanged(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another one lies under its name when the new one is ready: it stays where it is."""
    spoil(log, 0, 2)
    is_at = LogFolder.is_at

    def then_moved(folder: LogFolder, path: Path) -> bool:
        log.rename(tmp_path / "moved")
        sl.create(log, tz="UTC").close()
        return is_at(folder, path)

    monkeypatch.setattr(LogFolder, "is_at", then_moved)
    with pytest.raises(LogAccessError, match="was moved away while it was recovered"):
        recover(log)

    assert 0 == verify(log).exit_code
    assert 4 == verify(tmp_path / "moved").exit_code


def test_numbers_without_gaps() -> None:
    """In order, and ranges shrink to what is left of them."""
    numbers = Renumbering()

    new = [numbers.keep(old) for old in (0, 1, 5, 6, 9)]

    assert [0, 1, 2, 3, 4] == new
    assert [0, 1, 2, 2, 2, 2, 3, 4, 4, 4, 5] == [numbers.below(old) for old in range(11)]
    assert (1, 2) == numbers.range(1, 5)
    assert None is numbers.range(2, 4)
    assert (2, 4) == numbers.range(3, 100)
