"""Cases that random logs seldom have: what must go with the rest, and what must not."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.events import DoorObserved, SightingsThinned
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay import written_state
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.trimming import repeated_sightings
from semmap_log.log.trimming.redaction import Annotation, Notes, Redaction, Tracks
from semmap_log.log.trimming.repeated_sightings import HOUR_NS, Thinning
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.byte_layout import LOCK_NAME
from semmap_log.store.compaction import compact, merge
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.trimming import trimming
from semmap_log.store.writing import segment_chain
from tests.log.trimming.logs import MinuteClock, answers, moments, random_log, without_texts
from tests.store.trimming.plain_chain import all_bytes

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")
MINUTE_NS = 60 * 10**9


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return random_log(tmp_path, 7, monkeypatch, commits=200, roll=50)


def recorded(log: Path, event: int) -> int:
    commit = LogReader(log).find_commit(event)
    assert commit is not None
    return commit.recorded_ns


def texts(before: int) -> Redaction:
    return Redaction([Notes(), *(Annotation(door, "name") for door in (1, 2, 3))], before)


def test_files_that_were_merged_hold_nothing_that_went(log: Path) -> None:
    """They stay for an hour behind a compaction, for copies under way; not behind a redaction."""
    compact(log)
    assert list(LogReader(log).leftovers)

    trim_log(log, texts(sl.read(log).last_event() + 1))

    assert not [name for name, data in all_bytes(log) if b"secret" in data or b"anna" in data]


def test_what_came_later_than_the_limit_stays(log: Path) -> None:
    """Notes and texts by the number of their events."""
    before = sl.read(log)
    limit = next(h.number for h in before.history() if h.number > 120 and h.actor)
    notes = {h.number: h.actor for h in before.history()}
    late = before.replay().doors

    trim_log(log, texts(limit))

    after = {h.number: h.actor for h in sl.read(log).history()}
    assert {after.get(n, "") for n in notes if n < limit} == {""}
    assert {n: notes[n] for n in notes if n >= limit} == {n: after[n] for n in notes if n >= limit}
    for door_id, door in sl.read(log).replay().doors.items():
        told = sl.read(log).history(door_id, kinds=["DoorAnnotated"])
        assert door.annotations == (late[door_id].annotations if list(told) else {})


def test_a_copy_that_is_not_what_was_written_is_not_used(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The segment stays as it is."""
    really = trimming.build_chunk

    def other(records: bytes, offsets: object, *, compression: str) -> object:
        return really(records[:-1] + bytes([records[-1] ^ 1]), offsets, compression=compression)

    monkeypatch.setattr(trimming, "build_chunk", other)
    with pytest.raises(CorruptLogError, match="the old one is kept"):
        trim_log(log, Redaction([Tracks()], 100))
    monkeypatch.undo()

    assert not any(segment.header.trimmed for segment in LogReader(log).segments)
    assert not [f for f in verify(log).findings if f.severity > 1 and f.kind != "trimmed"]


@pytest.mark.parametrize("near", [1000, 2**20])
def test_a_log_that_was_cut_off_can_be_thinned(
    near: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The keyframe at the horizon stays, though it contains sightings that go."""
    monkeypatch.setattr(written_state, "KEYFRAME_EVERY_BYTES", 2000)
    monkeypatch.setattr(written_state, "KEYFRAME_RARITY", 0)
    monkeypatch.setattr(merge, "KEYFRAME_EVERY_BYTES", 1000)
    log = random_log(tmp_path, 7, monkeypatch, commits=200, roll=150)
    asked = moments(log, 5)
    trim_log(log, Retention(LogReader(log), recorded(log, 90)))
    horizon = LogReader(log).horizon
    assert LogReader(log).horizon_place().chunk > 0
    before = answers(log, asked)
    monkeypatch.setattr(merge, "KEYFRAME_EVERY_BYTES", near)

    trim_log(log, Thinning(LogReader(log), recorded(log, 180)))

    assert LogReader(log).horizon == horizon
    assert answers(log, asked) == before
    assert before.count("HorizonError") < len(before)
    trim_log(log, texts(150))
    assert without_texts(answers(log, asked)) == without_texts(before)


def small_log(path: Path) -> tuple[Path, MinuteClock]:
    """Return a log of a door that was seen open ten times in an hour, and then often closed."""
    clock = MinuteClock()
    clock.now_ns -= clock.now_ns % HOUR_NS
    with sl.create(path / "log", tz="UTC", clock=clock, compact=False) as log:
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9)
        for state in ["open"] * 10 + ["closed"] * 10:
            clock.now_ns += 4 * MINUTE_NS
            log.observe(1, state, accuracy=0.9)
    return path / "log", clock


def test_a_run_whose_first_was_taken_back_is_left_alone(tmp_path: Path) -> None:
    """What stays would not say what those said that went."""
    log, clock = small_log(tmp_path)
    first = next(h for h in sl.read(log).history() if isinstance(h.event, DoorObserved))
    with sl.append(log, clock=clock, compact=False) as opened:
        opened.retract(first.number)
    at = [{"at": f"@{first.recorded_ns + i * MINUTE_NS}"} for i in range(0, 90, 3)]
    before = answers(log, at)

    trim_log(log, Thinning(LogReader(log), clock.now_ns + MINUTE_NS))

    assert answers(log, at) == before


def test_the_first_and_the_last_of_an_hour_stay(tmp_path: Path) -> None:
    """So it is known when a door was seen last, and all ways of asking agree on it."""
    log, clock = small_log(tmp_path)
    times = [h.happened_ns for h in sl.read(log).history() if isinstance(h.event, DoorObserved)]

    trim_log(log, Thinning(LogReader(log), clock.now_ns + MINUTE_NS))

    left = [h.happened_ns for h in sl.read(log).history() if isinstance(h.event, DoorObserved)]
    runs = _by_hour([times[:10], times[10:]])
    assert set(left) == {one for run in runs for one in (run[0], run[-1])}
    for at_ns in times:
        asked = sl.read(log).replay(at=f"@{at_ns}").doors[1]
        assert asked.last_seen_ns == max(one for one in left if one <= at_ns)


def _by_hour(runs: list[list[int]]) -> list[list[int]]:
    """Return runs cut where an hour begins."""
    hours = [
        [one for one in run if one // HOUR_NS == hour]
        for run in runs
        for hour in sorted({one // HOUR_NS for one in run})
    ]
    return [run for run in hours if run]


def test_how_much_is_looked_at_together_makes_no_difference(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An hour at a time, or a segment: the same sightings go, and the same is told of them."""
    by_hour = tmp_path / "by hour"
    shutil.copytree(log, by_hour)
    trim_log(log, Thinning(LogReader(log), recorded(log, 180)))

    monkeypatch.setattr(repeated_sightings, "EVENTS_AT_ONCE", 1)
    trim_log(by_hour, Thinning(LogReader(by_hour), recorded(by_hour, 180)))

    assert _sightings(by_hour) == _sightings(log)


def _sightings(log: Path) -> tuple[list[int], list[str]]:
    """Return the numbers of those that are left, and what is told of the others, sorted."""
    told = list(sl.read(log).history())
    left = [one.number for one in told if isinstance(one.event, DoorObserved)]
    return left, sorted(repr(one.event) for one in told if isinstance(one.event, SightingsThinned))


def test_keyframes_tell_what_the_events_tell(log: Path) -> None:
    """Folded from the beginning, a thinned log is as it is asked for, to the last time seen."""
    trim_log(log, Thinning(LogReader(log), recorded(log, 180)))

    reader = LogReader(log)
    hidden = reader.retractions()
    for event in range(20, reader.last_event(), 9):
        state = DoorMapState()
        for batch in reader.batches():
            state.apply(hidden.up_to(event).visible(batch.select(batch.number <= event)))
        assert repr(state.door_map().doors) == repr(sl.read(log).replay(event=event).doors)


def test_the_live_segment_is_thinned_with_its_worth(tmp_path: Path) -> None:
    """It is closed by the trimming: what went of it is told as of all others."""
    clock = MinuteClock()
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door(name="front")
        for _ in range(50):
            log.observe(door, "open", accuracy=0.9)
        live = tmp_path / "live"
        shutil.copytree(log.path, live, ignore=shutil.ignore_patterns(LOCK_NAME))

    trim_log(live, Thinning(LogReader(live), clock.now_ns + MINUTE_NS))

    left = [entry.event for entry in sl.read(live).history()]
    seen = sum(isinstance(event, DoorObserved) for event in left)
    assert 50 > seen >= 2
    assert 50 == seen + sum(e.count for e in left if isinstance(e, SightingsThinned))


def test_what_is_taken_back_later_holds_the_horizon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A keyframe behind it would know what is not true any more: the horizon stays before it."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 10)
    path, clock = tmp_path / "log", MinuteClock()
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        door = log.add_door(name="front")
        log.append([sl.EventBatch.of(DoorObserved, door_id=[1], state=[1], happened_ns=[5])])
        for number in range(60):
            appended = log.update_door(door, width=1.0 + number, x=1.0, y=1.0, theta=0.0)
            if number == 25:
                wrong = appended.first_event
        log.retract(wrong)
        late = log.observe(door, "closed").first_event
    before = repr(sl.read(path).replay().doors)

    done = trim_log(path, Retention(LogReader(path), recorded(path, late) + 10**12))

    assert 0 < sl.read(path).horizon() <= wrong, done
    assert before == repr(sl.read(path).replay().doors)
    assert 0 == verify(path).exit_code
