"""Old segments removed from a disk: each answer stays right, or says where the rest lies."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.model.events import PatrolStarted
from semmap_log.errors import CorruptLogError, ElsewhereError, LogError, LogLockedError
from semmap_log.fleet.fetching import fetch
from semmap_log.fleet.keeping import remove_shipped
from semmap_log.fleet.shipping import ship
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.compaction import compact
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.fleet.test_shipping import RECORDINGS, events_of
from tests.marks import remove_marks
from tests.verbs import ran

ID = bytes(range(16))


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Six segments; in the first a command, a round, and an event that the third takes back."""
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as log:
        for number in range(3):
            log.add_door(x=float(number), y=2.0, theta=0.0, width=0.9, name=f"door{number}")
        for _ in range(30):
            log.observe("door0", "open", reason=random.randbytes(1500).hex())
        log.observe("door0", "open", command_id=ID)
        seen = log.last_event()
        for _ in range(30):
            log.observe("door0", "open", reason=random.randbytes(1500).hex())
    for session in range(5):
        with sl.append(path, compact=False) as log:
            for number in range(40):
                state = "open" if number % 2 else "closed"
                log.observe(f"door{number % 3}", state, reason=random.randbytes(1500).hex())
            if session == 2:
                log.retract(seen)
            if session == 3:
                log.update_door("door1", width=1.25)
    assert len(list(path.glob("*.mcap"))) >= 6
    return path


@pytest.fixture
def url(bucket: str, log: Path) -> str:
    ship(log, UrlPath(bucket))
    return bucket


def removed(log: Path, url: str) -> int:
    return remove_shipped(log, ObjectStore(UrlPath(url)), time.time_ns()).segments


def segments_in(log: Path) -> list[str]:
    return sorted(one.name for one in log.glob("*.mcap"))


def folded(lines: str) -> dict[str, Any]:
    """
    The doors as a few lines of Python fold them out of an export: by order, what is taken back out.
    """
    events = [json.loads(line) for line in lines.splitlines()]
    back = {
        number
        for event in events if event["kind"] == "Retracted"
        for number in range(event["first_event"], event["last_event"] + 1)
    }  # fmt: skip
    doors: dict[int, dict[str, Any]] = {}
    for number, event in enumerate(events):
        if event.get("event", number) in back:
            continue
        if event["kind"] == "DoorAdded":
            doors[event["door_id"]] = {"state": "UNKNOWN", "width": event["width"]}
        if event["kind"] == "DoorObserved":
            doors[event["door_id"]]["state"] = event["state"]
        if event["kind"] == "DoorUpdated" and event.get("width") is not None:
            doors[event["door_id"]]["width"] = event["width"]
    return doors


QUESTIONS = (
    ("replay",), ("replay", "--event", "20"), ("replay", "--at", "event:240"),
    ("history", "--json"), ("history", "door1", "--json"), ("show", "3"),
    ("show", "240"), ("tail", "--json"),
    ("diff", "event:1", "event:150"), ("timeline", "--json"), ("probabilities", "--json"),
    ("info", "--json"), ("best-time", "door1"), ("verify", "--json"), ("evaluate",),
)  # fmt: skip
OF_THE_PRESENT = (("replay",), ("replay", "--at", "event:240"), ("show", "240"))


def asked(
    capsys: pytest.CaptureFixture[str], log: Path, words: tuple[str, ...], *more: str
) -> tuple[int, str, str]:
    return ran(capsys, words[0], str(log), *words[1:], *more)


def test_each_question_is_answered_as_before_or_says_where_the_rest_lies(
    log: Path, url: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {words: asked(capsys, log, words) for words in QUESTIONS}

    assert removed(log, url) > 3

    for words in QUESTIONS:
        code, out, said = asked(capsys, log, words)
        if words in OF_THE_PRESENT:
            assert (code, out) == before[words][:2], (words, said)
        elif words[0] == "verify":
            assert code == 0
        elif (code, out) != before[words][:2] and words[0] != "info":
            assert (1, True) == (code, f"lie at {url}" in said + out), (words, out, said)
        code, out, said = asked(capsys, log, words, "--with", url)
        if words[0] not in ("verify", "info"):  # which tell how many files lie here
            assert (code, out) == before[words][:2], (words, said)
        assert code == before[words][0], (words, said)


def test_the_present_is_what_a_plain_fold_of_an_export_says(
    log: Path, url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ran(capsys, "export", str(log), str(tmp_path / "all.jsonl"))
    wanted = folded((tmp_path / "all.jsonl").read_text())
    removed(log, url)

    doors = sl.read(log).replay().doors

    assert {n: (d.state.name, d.width) for n, d in doors.items()} == {
        n: (d["state"], d["width"]) for n, d in wanted.items()
    }
    ran(capsys, "export", str(log), str(tmp_path / "with.jsonl"), "--with", url)
    assert (tmp_path / "all.jsonl").read_bytes() == (tmp_path / "with.jsonl").read_bytes()
    code, _, said = ran(capsys, "export", str(log), str(tmp_path / "without.jsonl"))
    assert (1, True, False) == (
        code, f"--with {url}" in said, (tmp_path / "without.jsonl").exists()
    )  # fmt: skip


def test_the_log_goes_on_and_is_shipped_on_and_comes_back_whole(
    log: Path, url: str, tmp_path: Path
) -> None:
    whole = shutil.copytree(log, tmp_path / "whole")
    removed(log, url)
    for path in (log, whole):
        with sl.append(path, compact=False) as writer:
            writer.observe("door2", "open")
    last = sl.read(log).last_event()
    assert sl.read(whole).last_event() == last

    done = ship(log, UrlPath(url))
    assert (1, last) == (done.sent, done.manifest.mark.next_event - 1)
    assert removed(log, url) == 1
    compact(log)
    fetch(UrlPath(url), tmp_path / "back")

    assert events_of(tmp_path / "back")[:-1] == events_of(whole)[:-1]
    assert len(events_of(tmp_path / "back")) == last + 1
    assert verify(log).exit_code == 0
    with sl.append(log) as writer:
        writer.observe("door2", "closed")
    assert verify(log).exit_code == 0
    assert sl.read(log, with_url=url).last_event() == last + 1


def test_a_command_that_may_lie_there_is_not_done_twice(log: Path, url: str) -> None:
    removed(log, url)
    last = sl.read(log).last_event()
    with sl.append(log) as writer:
        with pytest.raises(ElsewhereError, match="lie at"):
            writer.observe("door0", "open", command_id=ID)
        assert writer.observe("door0", "open", command_id=bytes(16)) is not None

    assert sl.read(log).last_event() == last + 1


def test_what_lies_in_the_removed_part_is_taken_back_by_number_or_refused(
    log: Path, url: str
) -> None:
    """What was taken back before stays so, and who takes back more is told where it lies."""
    removed(log, url)
    with sl.append(log) as writer:
        try:
            writer.retract(2)
        except ElsewhereError:
            taken = False
        else:
            taken = True

    doors = sl.read(log, with_url=url).replay().doors
    assert (2 in doors, taken) in ((True, False), (False, True), (True, True))
    assert verify(log).exit_code == 0


def test_verify_tells_a_removal_of_ours_from_a_loss(
    log: Path, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = removed(log, url)
    found = verify(log)
    assert (0, ["removed"]) == (found.exit_code, [one.kind for one in found.findings])
    assert f"{many} segments" in found.findings[0].text

    monkeypatch.setenv("SEMMAP_LOG_WITH", url)
    whole = verify(log)
    assert (0, (), len(events_of(log))) == (whole.exit_code, whole.findings, whole.events)
    monkeypatch.delenv("SEMMAP_LOG_WITH")

    first, _ = segments_in(log)[0], None
    kept = (log / first).read_bytes()
    (log / first).unlink()
    assert verify(log).exit_code != 0
    with pytest.raises(LogError):
        sl.read(log).replay()
    (log / first).write_bytes(kept)
    assert verify(log).exit_code == 0
    (log / "shipped.json").unlink()
    assert verify(log).exit_code == 4
    with pytest.raises(CorruptLogError, match="missing"):
        sl.read(log)


@pytest.mark.parametrize("harm", ["gone", "altered"])
def test_nothing_is_removed_here_unless_it_is_all_there(log: Path, url: str, harm: str) -> None:
    store = ObjectStore(UrlPath(url))
    name = next(one.name for one in store.list() if one.name.startswith("000002"))
    got = store.whole(name, most_bytes=2**24)
    assert got is not None
    store.remove(name)
    if harm == "altered":
        data = bytearray(got[0])
        data[len(data) // 2] ^= 1
        store.create(name, bytes(data))
    before = sorted(log.iterdir())

    with pytest.raises(CorruptLogError, match=name):
        removed(log, url)

    assert before == sorted(log.iterdir())


def test_an_object_that_is_lost_later_is_named(log: Path, url: str) -> None:
    removed(log, url)
    store = ObjectStore(UrlPath(url))
    name = next(one.name for one in store.list() if one.name.startswith("000001"))
    store.remove(name)

    with pytest.raises(LogError, match=name):
        [*sl.read(log, with_url=url).batches_in()]
    assert sl.read(log).replay().doors.keys() == {1, 2, 3} or sl.read(log).replay().doors


def test_beside_a_writer_nothing_is_removed(log: Path, url: str) -> None:
    before = segments_in(log)
    with sl.append(log) as writer:
        with pytest.raises(LogLockedError):
            removed(log, url)
        writer.observe("door0", "open")

    assert set(before) <= set(segments_in(log))


def test_two_removals_at_once_remove_it_once(log: Path, url: str) -> None:
    said: list[object] = []

    def remove() -> None:
        try:
            said.append(removed(log, url))
        except LogError as error:
            said.append(error)

    threads = [threading.Thread(target=remove) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert any(isinstance(each, int) and each > 0 for each in said)
    assert verify(log).exit_code == 0
    removed(log, url)
    assert len(segments_in(log)) == 1


KILLED = """
import os, signal, sys, time
from pathlib import Path
from semmap_log.fleet.keeping import remove_shipped
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
left = int(sys.argv[3])
def counted(call):
    def counting(*args, **more):
        global left
        left -= 1
        if left < 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return call(*args, **more)
    return counting
for name in ("replace", "unlink", "link", "fsync"):
    setattr(os, name, counted(getattr(os, name)))
remove_shipped(Path(sys.argv[1]), ObjectStore(UrlPath(sys.argv[2])), time.time_ns())
"""


def _killed_at_each_step(log: Path, url: str, tmp_path: Path) -> Iterator[Path]:
    for step in range(0, 100, 3):
        copy = shutil.copytree(log, tmp_path / f"copy{step}" / "log")
        words = (sys.executable, "-c", KILLED, str(copy), url, str(step))
        done = subprocess.run(words, check=False, env=os.environ)
        yield copy
        if done.returncode == 0:
            return
        assert done.returncode == -signal.SIGKILL
    raise AssertionError("it does not end")


def test_killed_at_any_step_the_log_is_whole_and_the_next_removal_goes_on(
    log: Path, url: str, tmp_path: Path
) -> None:
    whole = events_of(log)
    doors = repr(sl.read(log).replay().doors)
    for number, copy in enumerate(_killed_at_each_step(log, url, tmp_path)):
        assert repr(sl.read(copy).replay().doors) == doors
        with_rest = sl.read(copy, with_url=url)
        assert [repr(e) for batch in with_rest.batches_in() for e in batch] == whole
        assert verify(copy).exit_code == 0
        if number % 2:
            with sl.append(copy, compact=False) as writer:
                writer.observe("door0", "open")
        removed(copy, url)
        assert len(segments_in(copy)) <= 2
        assert verify(copy).exit_code == 0


def test_what_is_kept_is_not_believed_when_it_was_altered(log: Path, url: str) -> None:
    removed(log, url)
    kept = sorted(log.glob("*.kept"))[2]
    kept.write_bytes(zlib.compress(zlib.decompress(kept.read_bytes()).replace(b"]", b" ]", 1)))

    number = LogReader(LogFolder(log)).segments[2].header.first_event + 1
    with pytest.raises(CorruptLogError, match=kept.name):
        sl.read(log).event(number)
    kept.unlink()
    with pytest.raises(CorruptLogError, match="gone"):
        sl.read(log).event(number)
    assert sl.read(log, with_url=url).event(number).number == number


def test_a_segment_of_another_copy_is_not_taken_for_the_rest(
    log: Path, url: str, tmp_path: Path
) -> None:
    """
    The list of one log, and the rest of another that went another way from the same beginning.
    """
    other = shutil.copytree(log, tmp_path / "other")
    for path in (log, other):
        for _ in range(2):
            with sl.append(path, compact=False) as writer:
                writer.observe("door0", "open")
    ship(log, UrlPath(url))
    removed(log, url)
    (last,) = segments_in(log)
    shutil.copy(other / last.replace("log", "other"), log / last)
    remove_marks(log)

    assert verify(log).exit_code == 4
    with pytest.raises(CorruptLogError):
        [*sl.read(log).batches_in()]


def test_a_reader_that_is_open_meanwhile_reads_on(log: Path, url: str) -> None:
    """By the files that it has mapped; and what is written later, once it looks again."""
    opened = LogReader(LogFolder(log))
    last = opened.last_event()
    removed(log, url)

    assert sum(1 for _ in opened.pages()) > 3
    with sl.append(log) as writer:
        writer.observe("door0", "open")
    opened.refresh()
    assert opened.last_event() == last + 1
    with pytest.raises(ElsewhereError):
        [*opened.pages()]


def test_little_is_kept_of_a_segment(log: Path, url: str, tmp_path: Path) -> None:
    sizes = {one.stem: one.stat().st_size for one in log.glob("*.mcap")}

    assert removed(log, url) > 0

    kept = {one.stem: one.stat().st_size for one in log.glob("*.kept")}
    for name, size in kept.items():
        assert size < 0.4 * sizes[name], (name, size, sizes[name])


def test_of_a_segment_without_a_command_index_all_is_known(bucket: str, tmp_path: Path) -> None:
    """
    Of a recording that an older version has made, in which a command cannot be looked up else.
    """
    log = shutil.copytree(RECORDINGS / "clinic_week", tmp_path / "log")
    ship(log, UrlPath(bucket))
    before = repr(sl.read(log).replay().doors)

    assert removed(log, bucket) > 0

    with sl.append(log) as writer:
        writer.observe(1, "open", command_id=ID)
        assert writer.find_command(bytes(reversed(ID))) is None
    assert repr(sl.read(log).replay(event=77164).doors) == before
    assert verify(log).exit_code == 0


def test_rounds_are_counted_where_they_lie(
    log: Path, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with sl.append(log, compact=False) as writer:
        writer.start_patrol()
    with sl.append(log, compact=False) as writer:
        for _ in range(40):
            writer.observe("door0", "open", reason=random.randbytes(1500).hex())
    ship(log, UrlPath(url))
    removed(log, url)
    with sl.append(log) as writer:
        before = writer.last_event()
        try:
            writer.start_patrol()
        except ElsewhereError:
            assert writer.last_event() == before
            monkeypatch.setenv("SEMMAP_LOG_WITH", url)
    with sl.append(log) as writer:
        writer.start_patrol()
    assert sl.read(log, with_url=url).last_patrol(PatrolStarted) >= 2


def test_what_was_copied_back_is_read_here(log: Path, url: str, tmp_path: Path) -> None:
    whole = shutil.copytree(log, tmp_path / "whole")
    removed(log, url)

    for name in segments_in(whole):
        if not (log / name).exists():
            shutil.copy(whole / name, log / name)

    assert events_of(log) == events_of(whole)
    assert verify(log).exit_code == 0


def test_a_removed_part_elsewhere_a_recovery_and_a_damaged_list_are_named(
    log: Path, url: str, capsys: pytest.CaptureFixture[str]
) -> None:
    removed(log, url)
    code, _, said = ran(capsys, "recover", str(log))
    assert (1, True) == (code, f"lie at {url} only" in said)
    (log / "shipped.json").write_bytes((log / "shipped.json").read_bytes().replace(b"1", b"2", 1))
    with pytest.raises(CorruptLogError, match=r"shipped\.json"):
        sl.read(log)


def test_the_verb_keeps_days(log: Path, url: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = segments_in(log)
    code, out, _ = ran(capsys, "ship", str(log), url, "--keep-days", "1")
    assert (0, before, False) == (code, segments_in(log), "removed" in out)

    code, out, _ = ran(capsys, "ship", str(log), url, "--keep-days", "0")
    assert (0, True) == (code, f"ask with --with {url}" in out)
    assert segments_in(log) == before[-1:]
    code, out, _ = ran(capsys, "ship", str(log), url, "--check")
    assert code == 0
    assert ran(capsys, "replay", str(log), "--with", "here")[0] == 2
