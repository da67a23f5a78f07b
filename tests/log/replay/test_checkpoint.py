"""Checkpoints: used where they fit, and never where they do not."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.events import Retracted
from semmap_log.errors import CheckpointError, CheckpointWarning, OutputError
from semmap_log.log.trimming.redaction import Annotation, Redaction
from semmap_log.log.trimming.trim_log import trim_log
from semmap_log.store.reading.reader import LogReader
from tests.log.replay.projections import Digest, Numbers, Sums, Texts
from tests.store.eventful import flip


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "checkpoint"


@pytest.fixture
def log_path(tmp_path: Path) -> Path:
    """A log of a door that was seen ten times: events 0..10."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door()
        for i in range(10):
            log.observe(door, "open" if i & 1 else "closed")
    return tmp_path / "log"


def _observe(path: Path, times: int = 1) -> None:
    with sl.append(path) as log:
        for _ in range(times):
            log.observe(1, "open")


class _Spy(Numbers):
    """Numbers that tells which events it was given."""

    name = "Numbers"

    def __init__(self) -> None:
        self.given: list[int] = []

    def apply(self, state: list[int], batch: Any) -> list[int]:
        self.given += batch.number.tolist()
        return super().apply(state, batch)


def _fold(log_path: Path, path: Path) -> tuple[list[int], list[int]]:
    """Return the state, and the events that it took to come to it; warnings are errors."""
    spy = _Spy()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        state = sl.read(log_path).fold(spy, checkpoint=path)
    return state, spy.given


def test_only_what_is_new_is_read(log_path: Path, path: Path) -> None:
    """The second time the ten old events are not folded again, the third time none is."""
    first = _fold(log_path, path)
    _observe(log_path, 2)
    second, third = _fold(log_path, path), _fold(log_path, path)

    assert (list(range(11)), list(range(11))) == first
    assert (list(range(13)), [11, 12]) == second
    assert (list(range(13)), []) == third


def test_an_empty_log_has_nothing_to_keep(tmp_path: Path, path: Path) -> None:
    """No file is written before the first commit; then the fold begins as ever."""
    sl.create(tmp_path / "log", tz="UTC").close()

    assert ([], []) == _fold(tmp_path / "log", path)
    assert not path.exists()
    with sl.append(tmp_path / "log") as log:
        log.add_door()
    assert ([0], [0]) == _fold(tmp_path / "log", path)
    assert path.exists()


@pytest.mark.slow
def test_a_file_cut_anywhere_is_damaged(log_path: Path, path: Path) -> None:
    """At every byte: a warning, a fold from the start, and the file is whole again."""
    _fold(log_path, path)
    whole = path.read_bytes()

    for end in range(len(whole)):
        path.write_bytes(whole[:end])
        spy = _Spy()
        with pytest.warns(CheckpointWarning, match=r"not used: it is damaged.*log's start"):
            state = sl.read(log_path).fold(spy, checkpoint=path)

        assert list(range(11)) == state == spy.given
        assert whole == path.read_bytes()


@pytest.mark.slow
def test_a_flipped_bit_anywhere_is_noticed(log_path: Path, path: Path) -> None:
    """In its first line it is no checkpoint any more: an error. Behind that it is a damaged one."""
    _fold(log_path, path)
    whole = path.read_bytes()

    for at in range(len(whole)):
        flip(path, at, at % 8)
        if at < len(b"semmap-log checkpoint\n"):
            with pytest.raises(CheckpointError, match="expected a checkpoint, got another file"):
                sl.read(log_path).fold(Numbers(), checkpoint=path)
        else:
            with pytest.warns(CheckpointWarning, match="damaged"):
                assert list(range(11)) == sl.read(log_path).fold(Numbers(), checkpoint=path)
        path.write_bytes(whole)


def test_another_file_is_never_overwritten(log_path: Path, path: Path) -> None:
    """A wrong path is an error, and the file there stays."""
    path.write_bytes(b"my thesis\n")

    with pytest.raises(CheckpointError, match="left as it is"):
        sl.read(log_path).fold(Numbers(), checkpoint=path)
    with pytest.raises(CheckpointError, match="left as it is"):
        next(sl.read(log_path).fold_live(Numbers(), checkpoint=path))

    assert b"my thesis\n" == path.read_bytes()


def test_another_log_or_projection_is_an_error(log_path: Path, path: Path, tmp_path: Path) -> None:
    """Two folds that share a path by mistake would forever begin anew."""
    sl.create(tmp_path / "other", tz="UTC").close()
    _fold(log_path, path)
    before = path.read_bytes()

    with pytest.raises(CheckpointError, match=r"expected a checkpoint of the log \S+, got one of"):
        sl.read(tmp_path / "other").fold(Numbers(), checkpoint=path)
    with pytest.raises(CheckpointError, match="of the projection Sums, got one of Numbers"):
        sl.read(log_path).fold(Sums(), checkpoint=path)

    assert before == path.read_bytes()


class _NewNumbers(Numbers):
    name = "Numbers"
    version = 2


def test_another_version_begins_anew(log_path: Path, path: Path) -> None:
    """With a warning; then the file is of the new version."""
    _fold(log_path, path)

    with pytest.warns(CheckpointWarning, match="version 1, and 2"):
        sl.read(log_path).fold(_NewNumbers(), checkpoint=path)
    with pytest.warns(CheckpointWarning, match="version 2, and 1"):
        sl.read(log_path).fold(Numbers(), checkpoint=path)


@pytest.mark.parametrize("more", [0, 1, 2, 3])
def test_a_log_that_was_put_back_is_noticed(
    log_path: Path, path: Path, tmp_path: Path, more: int
) -> None:
    """A backup that went on differently: shorter, as long, or longer than what was taken in."""
    shutil.copytree(log_path, tmp_path / "backup")
    _observe(log_path, 2)
    _fold(log_path, path)
    _observe(tmp_path / "backup", more)

    with pytest.warns(CheckpointWarning, match="event 12 .* put back"):
        state = sl.read(tmp_path / "backup").fold(Numbers(), checkpoint=path)

    assert list(range(11 + more)) == state


def test_a_copy_that_went_on_behind_the_position_is_the_same_log(
    log_path: Path, path: Path, tmp_path: Path
) -> None:
    """Up to there nothing differs: the checkpoint is good for both."""
    shutil.copytree(log_path, tmp_path / "backup")
    _fold(log_path, path)
    _observe(tmp_path / "backup")

    assert (list(range(12)), [11]) == _fold(tmp_path / "backup", path)


@pytest.mark.parametrize(
    ("first", "last", "given"),
    [
        (3, 4, [0, 1, 2, *range(5, 14)]),
        (10, 11, [*range(10), 12, 13]),
        (11, 12, [13]),
    ],
)
def test_a_retraction_of_what_was_taken_in_begins_anew(
    log_path: Path, path: Path, first: int, last: int, given: list[int]
) -> None:
    """Without a warning, since nothing is wrong; one of later events alone changes nothing."""
    _fold(log_path, path)
    _observe(log_path, 2)
    with sl.append(log_path) as log:
        log.append([Retracted(first_event=first, last_event=last)])
    expected = [n for n in range(14) if not first <= n <= last]

    assert (expected, given) == _fold(log_path, path)
    assert (expected, []) == _fold(log_path, path)


def test_what_was_redacted_since_is_not_told(log_path: Path, path: Path) -> None:
    """The state held it; without a warning it is made of what is left, and takes its place."""
    with sl.append(log_path) as log:
        for key, value in (("owner", "Zoe"), ("kind", "fire door")):
            log.annotate(1, key, value)
    assert ["Zoe", "fire door"] == sl.read(log_path).fold(Texts(), checkpoint=path)
    reader = LogReader(log_path)
    parts = [Annotation(1, "owner")]

    trim_log(log_path, Redaction.of(reader, parts, reader.last_event() + 1))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert ["fire door"] == sl.read(log_path).fold(Texts(), checkpoint=path)
    assert b"Zoe" not in path.read_bytes()
    _observe(log_path)
    spy = _Spy()
    sl.read(log_path).fold(spy, checkpoint=path.with_name("numbers"))
    sl.read(log_path).fold(spy, checkpoint=path.with_name("numbers"))
    assert sorted(spy.given) == sorted(set(spy.given)), "from then on it is used as ever"


def test_what_is_hidden_already_can_be_hidden_again(log_path: Path, path: Path) -> None:
    """A second retraction of the same events changes nothing and costs nothing."""
    again = Retracted(first_event=4, last_event=5)
    with sl.append(log_path) as log:
        log.append([Retracted(first_event=3, last_event=6)])
    _fold(log_path, path)
    with sl.append(log_path) as log:
        log.take_over(lambda _: [again], note=sl.Note(), command_id=bytes(16), content=bytes(32))

    assert ([0, 1, 2, *range(7, 13)], [12]) == _fold(log_path, path)


def test_places_that_cannot_be_written_to_are_said_at_once(log_path: Path, tmp_path: Path) -> None:
    """Before the fold, not after it; a folder in the place of the file, too."""
    with pytest.raises(OutputError, match="there is no such folder"):
        sl.read(log_path).fold(Numbers(), checkpoint=tmp_path / "nowhere" / "checkpoint")
    with pytest.raises(OutputError, match="lies in the log's own folder"):
        sl.read(log_path).fold(Numbers(), checkpoint=log_path / "log_000001.mcap")
    with pytest.raises(
        CheckpointError, match="cannot be read: expected a regular file, got a folder"
    ):
        sl.read(log_path).fold(Numbers(), checkpoint=tmp_path)


def test_a_disk_that_says_no_leaves_the_last_one_whole(
    log_path: Path, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error names the file; nothing of ours is left beside it."""
    _fold(log_path, path)
    before = path.read_bytes()
    _observe(log_path)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("semmap_log.core.io.disk.sync_file", full)
    with pytest.raises(OutputError, match=r"could not be written: No space left.*is unchanged"):
        sl.read(log_path).fold(Numbers(), checkpoint=path)

    assert before == path.read_bytes()
    assert [path] == list(path.parent.glob("*checkpoint*")) + list(path.parent.glob(".check*"))


def test_what_a_killed_process_left_is_removed(log_path: Path, path: Path) -> None:
    """And what a process that runs is just writing is not."""
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    left = path.with_name(f".checkpoint.{gone.pid}.tmp")
    others = [path.with_name(f".checkpoint.{os.getppid()}.tmp"), path.with_name(".checkpoint.tmp")]
    for file in (left, *others):
        file.write_bytes(b"half")

    _fold(log_path, path)

    assert not left.exists()
    assert all(file.exists() for file in others)


def test_states_with_bytes_of_their_own(log_path: Path, path: Path) -> None:
    """`dump` and `load` are asked, and nothing else."""
    first = sl.read(log_path).fold(Digest(), checkpoint=path)
    _observe(log_path)

    second = sl.read(log_path).fold(Digest(), checkpoint=path)

    assert (11 + 385j, 12 + 506j) == (first, second)
    assert b"\n11 385" not in path.read_bytes()
    assert b"\n12 506" in path.read_bytes()


class _Odd(Numbers):
    def initial(self) -> Any:
        return object()

    def apply(self, state: Any, batch: Any) -> Any:
        return state


def test_a_state_that_no_file_can_hold_says_the_way_out(log_path: Path, path: Path) -> None:
    """Without a checkpoint it may be anything."""
    assert sl.read(log_path).fold(_Odd()) is not None

    with pytest.raises(CheckpointError, match=r"the state is a object; expected .*dump\(state\)"):
        sl.read(log_path).fold(_Odd(), checkpoint=path)

    assert not path.exists()
