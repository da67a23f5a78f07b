"""closed-2-26.json: a closed segment that was cut, or is missing, is no shorter log."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.maintenance import recover, verify
from semmap_log.store.closed_mark import MOST_BYTES, read_mark
from semmap_log.store.compaction import compact
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading import segment_folder
from semmap_log.store.verification.findings import Severity
from semmap_log.store.writing import segment_chain
from tests.marks import marks, remove_marks
from tests.store.logs import see, segment_files

DOOR = sl.DoorId(1)


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three closed segments of 10, 10 and 6 events."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 10)
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        log.add_door()
        see(log, 25)
    return tmp_path / "log"


def events(log: Path) -> int:
    return sum(len(batch) for batch in sl.read(log).batches())


def mark(log: Path) -> dict[str, object]:
    said: dict[str, object] = json.loads(marks(log)[-1].read_text())
    return said


def cut(log: Path) -> None:
    last = segment_files(log)[-1]
    os.truncate(last, sl.read(log)._reader.segments[-1].chunks[-1].offset + 40)


def cut_behind_its_last_chunk(log: Path) -> None:
    last = segment_files(log)[-1]
    os.truncate(last, sl.read(log)._reader.segments[-1].valid_end)


def cut_in_the_middle(log: Path) -> None:
    last = segment_files(log)[-1]
    os.truncate(last, sl.read(log)._reader.segments[-1].chunks[3].offset)


def removed(log: Path) -> None:
    segment_files(log)[-1].unlink()


DAMAGES = [cut, cut_in_the_middle, removed]


def test_it_tells_where_the_last_closed_segment_ended(log: Path) -> None:
    """The number behind its last event, and the hash of its last commit."""
    *_, last = sl.read(log).commits()

    said = mark(log)

    assert (2, 26, last.hash.hex()) == (said["segment"], said["next_event"], said["head"])
    assert said["log_id"] == sl.read(log).info.log_id


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_closed_segment_that_was_cut_is_damage(log: Path, damage: Callable[[Path], None]) -> None:
    """Reading is refused, and appending; what is there is not made the whole log by anybody."""
    damage(log)
    before = {path.name: path.read_bytes() for path in log.iterdir() if path.name != ".lock"}

    for ask in (sl.read, sl.append, compact):
        with pytest.raises(CorruptLogError, match=r"closed-2-26\.json"):
            ask(log)

    assert before == {p.name: p.read_bytes() for p in log.iterdir() if p.name != ".lock"}
    assert 4 == verify(log).exit_code
    assert 26 - 1 == max(f.events[1] or 0 for f in verify(log).findings if f.events)


def test_a_footer_that_was_lost_alone_loses_nothing(log: Path) -> None:
    """All commits are there: the segment is read like a live one, and closed anew."""
    cut_behind_its_last_chunk(log)

    assert 26 == events(log)
    sl.append(log).close()
    assert (26, 0) == (events(log), verify(log).exit_code)


@pytest.mark.parametrize("damage", DAMAGES)
def test_recover_goes_on_with_what_is_there(log: Path, damage: Callable[[Path], None]) -> None:
    """Told to, it makes a log of what is left, and names what is lost."""
    damage(log)

    done = recover(log)

    (loss,) = done.plan.losses
    assert 25 == loss.last_event
    assert 0 == verify(log).exit_code
    assert loss.first_event + 1 == events(log)  # and the commit that says so
    with sl.append(log) as opened:
        see(opened, 3)


def test_a_reader_that_was_open_is_told(log: Path) -> None:
    """Cut under an open reader: the next look is refused, not a shorter answer."""
    reader = sl.read(log)
    removed(log)

    with pytest.raises(CorruptLogError, match="segment 2"):
        reader.refresh()

    with pytest.raises(CorruptLogError, match="segment 2"):
        list(reader.follow(20, poll_s=0, stop=lambda: True))


def test_a_reader_that_was_open_is_told_of_what_was_closed_since(log: Path) -> None:
    """It has not looked meanwhile: a log that is as it saw it is shorter than it was."""
    reader = sl.read(log)
    before = {path: path.read_bytes() for path in segment_files(log)}
    with sl.append(log, compact=False) as opened:
        see(opened, 10)
    for path in segment_files(log):
        path.unlink()
    for path, data in before.items():
        path.write_bytes(data)

    with pytest.raises(CorruptLogError, match=r"ended before event 36"):
        reader.refresh()


def test_a_writer_that_rolls_at_every_look_is_no_damage(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is closed after the files were listed is not among them, and nothing is missing."""
    list_segments = segment_folder.list_segments
    looks: list[int] = []
    with sl.append(log, compact=False, durability="flush") as writer:
        see(writer, 10)

        def then_rolled(folder: LogFolder) -> segment_folder.Listing:
            found = list_segments(folder)
            looks.append(len(found))
            see(writer, 20)
            return found

        with monkeypatch.context() as patch:
            patch.setattr(segment_folder, "list_segments", then_rolled)
            seen = events(log)

    assert [4] == looks
    assert 40 == seen


def test_a_writer_that_rolls_while_it_is_verified_is_no_damage(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here, too: what was closed since the files were listed is not missing."""
    iterdir = Path.iterdir
    looks: list[Path] = []
    with sl.append(log, compact=False, durability="flush") as writer:
        see(writer, 10)

        def then_rolled(path: Path) -> Iterator[Path]:
            found = list(iterdir(path))
            if path == log:
                looks.append(path)
                see(writer, 20)
            return iter(found)

        with monkeypatch.context() as patch:
            patch.setattr(Path, "iterdir", then_rolled)
            found = verify(log)

    assert [log] == looks
    assert [] == [finding.text for finding in found.of(Severity.DAMAGE)]


def test_an_older_state_of_a_segment_is_damage(log: Path, tmp_path: Path) -> None:
    """A continued segment is replaced by what it was before: whole, but short."""
    last = segment_files(log)[-1]
    shutil.copy(last, tmp_path / "older")
    with sl.append(log, compact=False) as opened:
        see(opened, 2)
    shutil.copy(tmp_path / "older", last)

    with pytest.raises(CorruptLogError, match="ends before event 26"):
        sl.read(log)

    assert 4 == verify(log).exit_code


def test_another_copy_of_the_last_segment_is_damage(log: Path, tmp_path: Path) -> None:
    """As many events, but others."""
    shutil.copytree(log, tmp_path / "copy")
    for path, state in ((log, "open"), (tmp_path / "copy", "closed")):
        with sl.append(path, compact=False) as opened:
            opened.observe(DOOR, state)
    shutil.copy(segment_files(tmp_path / "copy")[-1], segment_files(log)[-1])

    with pytest.raises(CorruptLogError, match="of another copy of this log"):
        sl.read(log)

    assert {"mark"} == {f.kind for f in verify(log).findings if f.kind != "metadata"}


def test_a_live_segment_may_not_end_before_it(log: Path) -> None:
    """Continued and not closed, then cut by a crash of the disk: what was closed once was there."""
    opened = sl.append(log, compact=False, durability="flush")
    see(opened, 2)
    whole = segment_files(log)[-1].read_bytes()
    first = opened._reader.segments[-1].chunks[2].offset
    opened.close()
    segment_files(log)[-1].write_bytes(whole)
    assert events(log) == 28  # not closed: all of it is there

    segment_files(log)[-1].write_bytes(whole[:first])

    with pytest.raises(CorruptLogError, match="it ends before event"):
        sl.read(log)


def test_a_log_without_it_opens_and_gets_it(log: Path) -> None:
    """Copied without it, or made before there was one."""
    remove_marks(log)

    assert 26 == events(log)
    sl.append(log).close()

    assert 26 == mark(log)["next_event"]


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (cut, r"metadata\.yaml lists it as closed, but no footer ends it: it was cut"),
        (removed, r"log: damaged: segment 2, its last, is missing; metadata\.yaml lists it"),
    ],
)
def test_without_it_metadata_yaml_tells(
    log: Path, damage: Callable[[Path], None], problem: str
) -> None:
    """Of a log that is older than these marks: reading and appending are refused as well."""
    damage(log)
    remove_marks(log)

    for ask in (sl.read, sl.append):
        with pytest.raises(CorruptLogError, match=problem):
            ask(log)

    (log / "metadata.yaml").unlink()
    assert events(log) < 26


def test_it_outlives_compaction(log: Path) -> None:
    """Segments are rechunked and merged: what it tells stays true."""
    before = mark(log)

    compact(log, keep_s=0)

    assert (before, 26, 0) == (mark(log), events(log), verify(log).exit_code)
    removed(log)
    with pytest.raises(sl.SemmapError):
        sl.read(log)


@pytest.mark.parametrize(
    "text",
    ["", "{}", "[1]", "null", '{"log_id": 1}', "[" * 3000, " " * MOST_BYTES + "{}"],
    ids=lambda text: text[:8],
)
def test_damage_of_the_file_itself_is_named(log: Path, text: str) -> None:
    """Whether the log was cut cannot be known then; `recover` takes it as it is."""
    marks(log)[-1].write_text(text)

    with pytest.raises(CorruptLogError, match=r"closed-2-26\.json: damaged"):
        sl.read(log)
    assert 4 == verify(log).exit_code
    recover(log)
    assert (27, 0) == (events(log), verify(log).exit_code)


@pytest.mark.parametrize("head", ["", "ab" * 31, "zz" * 32, 7])
def test_a_hash_that_is_none_is_damage_of_the_file(log: Path, head: str) -> None:
    """However well its digest fits."""
    found = read_mark(LogFolder(log))
    assert found is not None
    marks(log)[-1].write_text(replace(found, head=head).text())

    with pytest.raises(CorruptLogError, match=r"closed-2-26\.json: damaged"):
        sl.read(log)


def test_every_flipped_bit_of_it_is_seen(log: Path) -> None:
    """It has a digest of its own."""
    whole = marks(log)[-1].read_bytes()
    for place in range(len(whole) - 1):
        data = bytearray(whole)
        data[place] ^= 1
        marks(log)[-1].write_bytes(data)
        if data.lower() != whole.lower():
            with pytest.raises(CorruptLogError):
                sl.read(log)


def test_of_another_log_it_is_named(log: Path, tmp_path: Path) -> None:
    """Files of two logs that were mixed up."""
    sl.create(tmp_path / "other", tz="UTC").close()
    remove_marks(log)
    shutil.copy(marks(tmp_path / "other")[-1], log)

    with pytest.raises(CorruptLogError, match="expected the log id"):
        sl.read(log)

    assert 4 == verify(log).exit_code


def copy_in_order(log: Path, copy: Path, names: list[str]) -> None:
    """Copy some files, one after the other, as `cp` does; those that have gone are left out."""
    copy.mkdir(exist_ok=True)
    for name in names:
        if (log / name).exists():
            shutil.copy(log / name, copy)


@pytest.mark.parametrize("count", [3, 10, 40])
def test_a_mark_that_is_copied_later_than_the_segments_is_not_ahead(
    log: Path, tmp_path: Path, count: int
) -> None:
    """`cp -r` lists the names, and copies the segments."""
    with sl.append(log, compact=False, durability="flush") as writer:
        names = sorted(path.name for path in log.iterdir())
        copy_in_order(log, tmp_path / "copy", [n for n in names if n.endswith(".mcap")])
        see(writer, count)
    copy_in_order(log, tmp_path / "copy", [n for n in names if not n.endswith(".mcap")])

    assert 26 == events(tmp_path / "copy")
    assert verify(tmp_path / "copy").exit_code in (0, 3)
    segment_files(tmp_path / "copy")[-1].unlink()
    with pytest.raises(CorruptLogError):
        sl.read(tmp_path / "copy")


def test_the_first_closing_is_told_before_it_is_listed(tmp_path: Path) -> None:
    """Else a copy might hold a metadata.yaml that is ahead, and no mark."""
    log, written = tmp_path / "log", []
    with pytest.MonkeyPatch.context() as patch:
        write_atomic = LogFolder.write_atomic
        patch.setattr(
            LogFolder,
            "write_atomic",
            lambda self, name, data: (written.append(name), write_atomic(self, name, data)),
        )
        sl.create(log, tz="UTC").close()

    assert ["closed-0-0.json", "metadata.yaml"] == written


def test_of_many_marks_few_stay(log: Path) -> None:
    """The last ones, for whoever copies the folder now; and of each ten minutes the first."""
    for _ in range(40):
        with sl.append(log, compact=False) as opened:
            see(opened, 1)

    said = [path.name for path in marks(log)]

    assert ["closed-0-10.json"] == said[:1]
    assert 20 <= len(said) <= 22
    assert 66 == mark(log)["next_event"]


def test_a_mark_stays_for_an_hour_after_another_has_followed(log: Path) -> None:
    """However old it is itself: a copy may have listed it just before."""
    now_s = time.time()
    for path in marks(log):
        os.utime(path, (now_s - 7000, now_s - 7000))
    before = [path.name for path in marks(log)]

    with sl.append(log, compact=False) as opened:
        see(opened, 1)

    assert before[-1:] == [path.name for path in marks(log)][:-1]


def test_a_log_of_before_is_read_by_its_old_mark(log: Path) -> None:
    """It was called closed.json, one for all closings; the next closing adds one of today."""
    old = marks(log)[-1].read_bytes()
    remove_marks(log)
    (log / "closed.json").write_bytes(old)
    assert 26 == events(log)

    with sl.append(log, compact=False) as opened:
        see(opened, 2)

    assert 28 == mark(log)["next_event"]
    removed(log)
    with pytest.raises(CorruptLogError, match="ended before event 28"):
        sl.read(log)
    for path in marks(log)[1:]:
        path.unlink()
    with pytest.raises(CorruptLogError, match="ended before event 26"):
        sl.read(log)


def test_what_an_older_version_closes_later_counts(log: Path) -> None:
    """It knows closed.json alone: of both, the one that tells of more is believed."""
    with sl.append(log, compact=False) as opened:
        see(opened, 2)
    marks(log)[-1].rename(log / "closed.json")
    removed(log)

    with pytest.raises(CorruptLogError, match="ended before event 28"):
        sl.read(log)


def test_a_swapped_segment_in_the_middle_is_damage_to_every_question(
    log: Path, tmp_path: Path
) -> None:
    """Of a copy that went another way."""
    copy = tmp_path / "copy" / "log"
    for path in segment_files(log)[1:]:
        path.unlink()
    remove_marks(log)
    (log / "metadata.yaml").unlink()
    shutil.copytree(log, copy)
    for path, accuracy in ((log, 0.9), (copy, 0.8)):
        with sl.append(path, compact=False) as opened:
            for _ in range(25):
                opened.observe(DOOR, "open", accuracy=accuracy)
    shutil.copy(segment_files(copy)[1], segment_files(log)[1])

    swapped = sl.read(log)

    asks: list[Callable[[], object]] = [
        lambda: swapped.replay(event=14),
        lambda: swapped.replay(event=3),
        swapped.replay,
        lambda: swapped.event(12),
        lambda: list(swapped.history(DOOR)),
        lambda: swapped.diff("event:12", "event:15"),
        lambda: list(swapped.follow(13, poll_s=0, stop=lambda: True)),
        lambda: list(swapped.follow(22, poll_s=0, stop=lambda: True)),
        lambda: swapped._reader.find_commit(25),
        lambda: swapped._reader.event_known_at(2**62),
        lambda: sl.append(log),
    ]
    for ask in asks:
        with pytest.raises(CorruptLogError, match="of another copy of this log"):
            ask()
