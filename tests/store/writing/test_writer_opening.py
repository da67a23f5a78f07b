"""A log that is opened for writing is read once, and let go of if that fails."""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import Retractions
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, Retracted
from semmap_log.errors import CorruptLogError, LogError, LogPoisonedError
from semmap_log.store.reading import segment_folder
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.segment import SegmentWriter
from tests.log.replay.test_state import START_NS, sightings, tiny_steps


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often each segment is opened, by name, while the test runs."""
    found: Counter[str] = Counter()
    segment_in = segment_folder.segment_in

    def counted(path: Path, *how: Any, **more: Any) -> Any:
        found[path.name] += 1
        return segment_in(path, *how, **more)

    monkeypatch.setattr(segment_folder, "segment_in", counted)
    return found


def _written(path: Path) -> Path:
    """Write a log of several segments, with something taken back."""
    with tiny_steps(), sl.create(path, tz="UTC", compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        for event in sightings(40):
            log.append([event])
        log.append([Retracted(first_event=3, last_event=3)])
    assert len(list(path.glob("*.mcap"))) > 3
    return path


def test_each_segment_is_opened_once(tmp_path: Path, opened: Counter[str]) -> None:
    """What the writer read is what the log answers from."""
    path = _written(tmp_path / "log")
    answer = repr(sl.read(path).replay())
    opened.clear()

    with sl.append(path) as log:
        assert answer == repr(log.replay())
        assert opened == Counter(file.name for file in path.glob("*.mcap"))


def test_what_was_taken_back_is_looked_up_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The door map was folded for the writer's keyframes: a question needs no other search."""
    path = _written(tmp_path / "log")
    batches: list[int] = []
    apply = Retractions.apply

    def counted(found: Retractions, batch: Any) -> None:
        batches.append(len(batch))
        apply(found, batch)

    monkeypatch.setattr(Retractions, "apply", counted)

    with sl.append(path, compact=False) as log:
        assert DoorId(1) in log.replay().doors

    assert [1] == batches


def test_of_a_torn_log_only_the_last_segment_is_opened_again(
    tmp_path: Path, opened: Counter[str]
) -> None:
    """It was made whole in a copy, and the copy is another file."""
    with tiny_steps(), sl.create(tmp_path / "live", tz="UTC", compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        for event in sightings(25):
            log.append([event])
        path = Path(shutil.copytree(tmp_path / "live", tmp_path / "log"))
    *closed, torn = sorted(file.name for file in path.glob("*.mcap"))
    with (path / torn).open("ab") as file:
        file.write(b"torn")
    opened.clear()

    with sl.append(path) as log:
        assert 25 == log._reader.last_event()
        assert opened == Counter({**dict.fromkeys(closed, 1), torn: 2})


def test_a_new_log_is_opened_once(tmp_path: Path, opened: Counter[str]) -> None:
    """It is read back when it is made."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        assert {} == log.replay().doors
        assert [1] == list(opened.values())


@pytest.mark.parametrize("is_new", [True, False], ids=["new", "old"])
def test_a_log_that_cannot_be_read_back_is_let_go_of(
    is_new: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody gets the writer then, and nobody else could let the next one in."""
    path = tmp_path / "log"
    open_it = sl.append
    if is_new:
        path.mkdir()
        open_it = sl.create
    else:
        _written(path)
    refresh = LogReader.refresh
    looks: list[LogReader] = []

    def refused(reader: LogReader) -> None:
        looks.append(reader)
        if len(looks) == (1 if is_new else 2):
            raise CorruptLogError(path, 0, "exchanged meanwhile")
        refresh(reader)

    with monkeypatch.context() as patch:
        patch.setattr(LogReader, "refresh", refused)
        with pytest.raises(CorruptLogError, match="exchanged meanwhile"):
            open_it(path)

    assert all(segment.closed for segment in LogReader(path).segments)
    with sl.append(path) as log:
        log.add_door()


@pytest.mark.parametrize("name", ["log.zip", "log.mcap", "-"])
def test_a_name_that_would_be_taken_for_something_else(name: str, tmp_path: Path) -> None:
    """Of a file, or of the standard output: no log is called so, and nothing is made."""
    with pytest.raises(LogError, match="name of a f"):
        sl.create(tmp_path / name, tz="UTC")
    assert [] == list(tmp_path.iterdir())


def test_a_log_with_events_does_not_begin_anew(tmp_path: Path) -> None:
    """Recorded time only grows."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        with pytest.raises(LogError, match="expected a log without events"):
            log._writer.begin_at(START_NS)

        assert not log.begin_at(START_NS)
        assert 1 == len(log.door_map())


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (OSError(28, "No space left on device"), LogPoisonedError),
        (KeyboardInterrupt(), KeyboardInterrupt),
    ],
)
def test_a_log_that_could_not_begin_anew(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    raised: type[BaseException],
) -> None:
    """The one segment or the other is there, and the writer writes nothing more."""

    def fails(_: SegmentWriter, *, replacing: object) -> None:
        raise error

    log = sl.create(tmp_path / "log", tz="UTC")
    with monkeypatch.context() as patch:
        patch.setattr(SegmentWriter, "install", fails)
        with pytest.raises(raised):
            log.begin_at(START_NS)
    with pytest.raises(LogPoisonedError):
        log.add_door()
    log.close()

    with sl.append(tmp_path / "log") as again:
        again.add_door()
    assert [] == list((tmp_path / "log").glob("*.tmp"))
