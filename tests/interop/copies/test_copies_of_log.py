"""What is taken out of a log is taken out of its copies, too, or they are named."""

from __future__ import annotations

import json
import os
import shutil
import struct
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

import semmap_log as sl
from semmap_log.core.io.object_cache import VARIABLE
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.model.events import RobotPose
from semmap_log.fleet.answer_places import answer_name, default_folder
from semmap_log.fleet.shipping import ship
from semmap_log.interop.copies.copies_of_log import Action, Copy, plan_copies, take_out_of_copies
from semmap_log.interop.copies.going import Going
from semmap_log.interop.formats.kept_scans.reading import kept_visits
from semmap_log.interop.formats.kept_scans.writing import keeping_scans
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.replay.read_model.indexing import index
from semmap_log.log.trimming.redaction import Notes, Part, Redaction, Tracks
from semmap_log.store.folder import LogFolder
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.analysis.scans.some_scans import LINE, seen_visit
from tests.analysis.scans.some_visits import START_NS, S
from tests.interop.copies.holders import holders
from tests.interop.formats.kept_scans.torn import chunks_at
from tests.log.replay.projections import Texts
from tests.log.trimming.logs import MinuteClock
from tests.verbs import ran as semmap

NAME, ACTOR, PLACE = "Zoe Quist", "anna.k", 1234.0625
GOES = [NAME.encode(), ACTOR.encode(), struct.pack("<d", PLACE)]
REDACT = ("--actor", ACTOR, "--tracks", "--door", "1", "--key", "name")


def a_log(path: Path) -> Path:
    """Return a log of some seconds that begins when `some_visit` does."""
    clock = MinuteClock()
    clock.now_ns = START_NS
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        log.add_door(x=1.0, y=0.0, theta=0.0, width=0.9, name=NAME, actor=ACTOR)
        for _ in range(20):
            log.append([RobotPose(x=PLACE, y=PLACE, theta=0.0)])
            log.observe(1, "open", accuracy=0.9)
    return path


def keep_scans(log: Path, *at_s: float, **visit: Any) -> Path:
    """Keep a visit at each of these seconds of the log, all in one file."""
    with keeping_scans(log, sl.read(log).info.log_id) as writer:
        for each in at_s:
            seen, scans = seen_visit(each, **visit)
            there = [replace(one, origins=np.full_like(one.origins, PLACE)) for one in scans]
            writer.keep(seen, line=LINE, level=0, scans=there)
        assert writer.path is not None
        return writer.path


def fill(tree: Path, bucket: str) -> Path:
    """Make a log and all copies of it that this program makes, and some that people make."""
    log = a_log(tree / "office")
    ship(log, UrlPath(bucket))
    sl.read(bucket).replay()
    a_log(tree / "second" / "tug")
    assert sl.join([log, tree / "second" / "tug"]).replay().doors
    list(sl.fleet([log], engine="serial").map().table)
    sl.read(log).fold(Texts(), checkpoint=tree / "texts.checkpoint")
    index(log)
    shutil.copytree(log, tree / "office-backup")
    shutil.copytree(log, tree / "temporary" / "semmap-log-unzipped-x" / "office")
    with zipfile.ZipFile(tree / "office.zip", "w") as packed:
        for path in sorted(log.glob("*.mcap")):
            packed.write(path, f"office/{path.name}")
    keep_scans(log, 0, 30)
    (log / "damaged-1").mkdir()
    for name in ("office_000000.mcap.torn-99", "damaged-1/office_000000.mcap.x", "notes.txt"):
        (log / name).write_text(NAME)
    (log / ".office_000009.mcap.1-ab.tmp").write_text(NAME)
    (tree / ".office.recovering").mkdir()
    (tree / ".office.recovering" / "x").write_text(NAME)
    return log


def test_what_is_redacted_is_in_no_file_that_is_not_named(
    tmp_path: Path, bucket: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """All files below a folder in which everything lies: before, each copy holds it."""
    log = fill(tmp_path, bucket)
    shutil.rmtree(tmp_path / "second")
    before = holders(tmp_path, GOES)
    planned = json.loads(semmap(capsys, "redact", log, *REDACT, "--dry-run", "--json")[1])
    assert before == holders(tmp_path, GOES)

    code, out, _ = semmap(capsys, "redact", log, *REDACT, "--json")

    assert code == 0
    copies = json.loads(out)["copies"]
    assert [one for one in planned["copies"] if one["kind"] != "temporary"] == copies
    left = {Path(one["path"]) for one in copies if one["action"] == "left"}
    gone = {Path(one["path"]) for one in copies if one["action"] == "removed"}
    assert {"index", "torn", "damaged", "other", "scans", "recovering", "copy",
            "checkpoint", "answer", "objects", "view", "unpacked"} == {
        one["kind"] for one in copies}  # fmt: skip
    assert {one["kind"] for one in planned["copies"]} - {one["kind"] for one in copies} == {
        "temporary"}  # fmt: skip
    now = holders(tmp_path, GOES)
    assert not [path for path in now if not left & {path, *path.parents}]
    held = {Path(copy["path"]) for copy in copies if copy["kind"] not in {"objects", "answer"}}
    assert not [one for one in held if not any(one in {path, *path.parents} for path in before)]
    assert not [path for path in gone if path.is_file()]
    assert verify(log).exit_code == 0


def copies_by_kind(found: list[Copy], kind: str) -> list[Copy]:
    return [copy for copy in found if copy.kind == kind]


def redaction(log: Path, *parts: Part, before: int | None = None) -> Going:
    reader = LogReader(log)
    end = sl.read(log).last_event() + 1
    return Going.of(Redaction.of(reader, parts, end if before is None else before), sl.read(log))


def kept(log: Path) -> list[tuple[float, list[float]]]:
    """Return when each kept visit began, and each of its scans, in seconds of the log."""
    found = kept_visits(log, sl.read(log).info.log_id)
    return [
        ((one.visit.first_ns - START_NS) / 1e9, [(s.stamp_ns - START_NS) / 1e9 for s in one.scans])
        for one in found
    ]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return a_log(tmp_path / "office")


def test_nothing_is_written_by_a_plan(log: Path, tmp_path: Path) -> None:
    """Not even a cache that is not there yet."""
    keep_scans(log, 0)
    shutil.rmtree(tmp_path / "cache")
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}

    assert plan_copies(log, redaction(log, Tracks()), is_trimmed=True)

    assert before == {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}


def test_only_what_was_there_by_then_goes_of_the_scans(log: Path) -> None:
    """A file with earlier and later visits is written again."""
    first = next(
        commit for commit in sl.read(log).commits() if commit.recorded_ns > START_NS + 20 * S
    )
    path = keep_scans(log, 0, 17, 19, 24, 60)
    earlier = keep_scans(log, 3)
    later = keep_scans(log, 100)
    kept_before, messages = kept(log), messages_of(path)
    going = redaction(log, Tracks(), before=first.first_event)
    assert going.scans_before_ns == first.recorded_ns
    assert 20 < (first.recorded_ns - START_NS) / S < 24

    copies = take_out_of_copies(log, going, is_trimmed=True)

    assert [(path, Action.REWRITTEN), (earlier, Action.REMOVED)] == sorted(
        (one.path, one.action) for one in copies_by_kind(copies, "scans")
    )
    assert [one for one in kept_before if one[0] >= 24] == kept(log)
    assert later.exists()
    left = messages_of(path)
    assert left
    assert set(left) < set(messages)
    assert min(at_ns for _, at_ns, _ in left) == START_NS + 24 * S
    assert [] == copies_by_kind(take_out_of_copies(log, going, is_trimmed=True), "scans")


def messages_of(path: Path) -> list[tuple[str, int, bytes]]:
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


def test_scans_of_a_retention(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Those from before the horizon go."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 10)
    log = a_log(tmp_path / "office")
    with sl.append(log) as opened:
        opened.observe(1, "open", at=f"@{START_NS + 7 * S}")
    keep_scans(log, 0, 5, 60)
    words = ("retain", log, "--keep", "2025-12-29T09:20:40", "--json")

    planned = json.loads(semmap(capsys, *words, "--dry-run")[1])
    assert [0, 5, 60] == [first for first, _ in kept(log)]
    done = json.loads(semmap(capsys, *words)[1])

    assert done["events"] > 10
    assert planned["copies"] == done["copies"]
    assert ["scans", "rewritten"] == [done["copies"][0][key] for key in ("kind", "action")]
    assert [5, 60] == [first for first, _ in kept(log)]
    assert [] == json.loads(semmap(capsys, *words)[1])["copies"]


@pytest.mark.parametrize(("words", "action"), [
    (("redact", "--tracks"), "removed"), (("redact", "--actor", "tug"), "left"),
    (("redact", "--notes"), "left"), (("retain", "--thin", "0s"), "left"),
    (("redact", "--actor", "bert"), ""), (("redact", "--door", "1", "--key", "name"), ""),
    (("retain", "--keep", "100y"), ""),
])  # fmt: skip
def test_which_scans_hold_what_goes(
    log: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], action: str
) -> None:
    """They show where which robot was, and nothing that anybody said."""
    path = keep_scans(log, 0, robot="tug")

    code, out, _ = semmap(capsys, words[0], log, *words[1:], "--json")

    assert code == 0
    found = [one for one in json.loads(out)["copies"] if one["kind"] == "scans"]
    assert [action] * bool(action) == [one["action"] for one in found]
    assert path.exists() == (action != "removed")


def test_scans_that_cannot_be_read(log: Path) -> None:
    """With all tracks they go, unless they are of another log that had the name."""
    damaged, torn, other = keep_scans(log, 0, 30), keep_scans(log, 1), keep_scans(log, 2)
    data = bytearray(damaged.read_bytes())
    data[chunks_at(damaged)[1] + 200] ^= 1
    damaged.write_bytes(data)
    torn.write_bytes(torn.read_bytes()[:600])
    log_id = sl.read(log).info.log_id
    other.write_bytes(other.read_bytes().replace(log_id.encode(), b"0" * 32))
    (other.parent / "notes.txt").write_text("mine")
    os.mkfifo(other.parent / "pipe.mcap")
    part = redaction(log, Tracks(), before=5)

    named, pipe = copies_by_kind(take_out_of_copies(log, part, is_trimmed=True), "scans")
    assert (damaged, Action.LEFT) == (named.path, named.action)
    assert "it is damaged" in named.text
    assert "it cannot be read (expected a regular file, got a named pipe)" in pipe.text

    take_out_of_copies(log, redaction(log, Tracks()), is_trimmed=True)
    assert {other.name, "notes.txt", "pipe.mcap"} == {
        path.name for path in other.parent.iterdir()}  # fmt: skip


def test_while_somebody_writes_scans_are_left(log: Path) -> None:
    """Whoever records adds to them; caches go."""
    path = keep_scans(log, 0)
    sl.read(log).fold(Texts(), checkpoint=log.parent / "texts")
    going = redaction(log, Tracks())
    lock = WriterLock(LogFolder(log))

    copies = take_out_of_copies(log, going, is_trimmed=True)
    lock.release()

    (scans,) = copies_by_kind(copies, "scans")
    assert scans.action is Action.LEFT
    assert "is writing to this log" in scans.text
    assert path.exists()
    assert not (log.parent / "texts").exists()


def test_what_cannot_be_removed_is_named(log: Path) -> None:
    """An index that somebody is making, of segments as they were."""
    index(log)
    answer = answer_of(log)
    answer.mkdir(parents=True)
    lock = WriterLock(LogFolder(log / "index"))

    copies = take_out_of_copies(log, redaction(log, Tracks()), is_trimmed=True)
    lock.release()

    (tables,) = copies_by_kind(copies, "index")
    assert tables.action is Action.LEFT
    assert "another process is making this index" in tables.text
    (kept_answer,) = copies_by_kind(copies, "answer")
    assert (Action.LEFT, answer) == (kept_answer.action, kept_answer.path)


def answer_of(log: Path) -> Path:
    return default_folder() / "map-0" / answer_name(str(log), sl.read(log).info.log_id, "00")


def test_the_log_that_a_log_was_recovered_from(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It may have another identity; the new one knows it."""
    segment = next(log.glob("*_000000.mcap"))
    data = bytearray(segment.read_bytes())
    data[len(data) // 2] ^= 1
    segment.write_bytes(data)
    assert semmap(capsys, "recover", log, "--out", tmp_path / "whole", "--yes")[0] == 0
    assert sl.read(tmp_path / "whole").info.log_id != LogReader(log).info.log_id

    copies = plan_copies(
        tmp_path / "whole", redaction(tmp_path / "whole", Tracks()), is_trimmed=True
    )

    assert [log] == [one.path for one in copies_by_kind(copies, "copy")]


def test_a_user_without_a_home(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a service may be: nothing is kept for it."""
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)

    assert [] == plan_copies(log, redaction(log, Tracks()), is_trimmed=True)


def test_other_logs_and_files_are_no_copies(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither named nor touched, whatever they are."""
    a_log(tmp_path / "other")
    answer = answer_of(tmp_path / "other")
    answer.parent.mkdir(parents=True)
    answer.write_bytes(b"")
    sl.read(tmp_path / "other").fold(Texts(), checkpoint=tmp_path / "texts")
    (tmp_path / "broken.zip").write_bytes(b"PK\3\4" + bytes(99))
    (tmp_path / "broken.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(99))
    os.mkfifo(tmp_path / "pipe.mcap")
    (tmp_path / "link").symlink_to(log)
    a_log(tmp_path / "third")
    view = sl.join([tmp_path / "other", tmp_path / "third"])
    assert 1 == len(list((tmp_path / "cache" / "joined").iterdir()))
    monkeypatch.delenv(VARIABLE)
    temporary = sl.join([tmp_path / "other", tmp_path / "third"])
    assert 1 == len(list((tmp_path / "temporary").iterdir()))
    monkeypatch.setenv(VARIABLE, str(tmp_path / "cache"))

    assert [] == plan_copies(log, redaction(log, Tracks(), Notes()), is_trimmed=True)
    assert view.replay().doors.keys() == temporary.replay().doors.keys()
