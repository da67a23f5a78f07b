"""Trimmed logs and the other verbs: recover, index, export, zip files, ship, join."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path, PurePath
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.cli import main
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.model.events import (
    HistoryTrimmed,
    LogExported,
    Retracted,
    RobotPose,
    SightingsThinned,
)
from semmap_log.errors import LogError
from semmap_log.fleet.fetching import fetch
from semmap_log.fleet.shipping import ship, shipped_before
from semmap_log.log.replay.maintenance import copy, recover, verify
from semmap_log.log.replay.read_model.indexing import index
from semmap_log.log.trimming.redaction import Annotation, Notes, Redaction, Tracks
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, TrimRule, trim_log
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_scan import Segment
from tests.log.trimming.logs import (
    SECOND_NS,
    START_NS,
    answers,
    answers_of,
    moments,
    random_log,
    until_ns,
)
from tests.store.eventful import flip
from tests.store.trimming.plain_chain import all_bytes, read_plainly

pytestmark = [
    pytest.mark.filterwarnings(f"ignore::semmap_log.errors.{name}")
    for name in ("HorizonWarning", "SensorWarning", "KeyframeWarning")
]

DOORS = (1, 2, 3)


def redaction(log: Path) -> TrimRule:
    reader = LogReader(log)
    parts = [Notes(), Tracks(), *(Annotation(door, "name") for door in DOORS)]
    return Redaction.of(reader, parts, reader.last_event() + 1)


RULES: dict[str, Callable[[Path], TrimRule]] = {
    "redact": redaction,
    "thin": lambda log: Thinning(LogReader(log), until_ns(log)),
    "keep": lambda log: Retention(LogReader(log), until_ns(log)),
}


@pytest.fixture(scope="module")
def untrimmed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as patch:
        yield random_log(tmp_path_factory.mktemp("verbs"), 11, patch, commits=150, roll=35)


@pytest.fixture(scope="module", params=[["thin", "redact", "keep"], ["thin"]], ids=str)
def trimmed(
    untrimmed: Path, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    log = Path(shutil.copytree(untrimmed, tmp_path_factory.mktemp("trimmed") / "log"))
    for kind in request.param:
        assert trim_log(log, RULES[kind](log)).event is not None
    return log


@pytest.fixture
def log(trimmed: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(trimmed, tmp_path / "log"))


def run(*arguments: object) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(one) for one in arguments])
    assert not ended.value.code


def events_of(log: PurePath | str) -> list[str]:
    return [repr((h.recorded_ns, h.event, h.actor)) for h in sl.read(log).history()]


def about_doors(log: Path) -> list[Any]:
    opened = sl.read(log)
    found: list[Any] = [(b.door.door_id, b.p_open, b.low) for b in probabilities(opened)]
    for door in DOORS:
        found += [repr(list(opened.timeline(door))), [repr(h) for h in opened.history(door)]]
        found.append([b.p_open for b in probabilities(opened, doors=[door])])
    return found


def has_secrets(folder: Path) -> list[str]:
    words = (b"secret", b"anna", b"bert")
    return [str(path) for path, data in all_bytes(folder) if any(word in data for word in words)]


@pytest.mark.parametrize("kind", ["redact", "thin"])
def test_what_is_saved_of_a_damaged_one_was_there(
    untrimmed: Path, tmp_path: Path, kind: str
) -> None:
    """A byte of any chunk of a trimmed segment; nothing of what was taken out comes back."""
    trimmed = Path(shutil.copytree(untrimmed, tmp_path / "trimmed" / "log"))
    trim_log(trimmed, RULES[kind](trimmed))
    there, places = saved_of(trimmed), chunks_of_trimmed(trimmed)
    for i, (name, at) in enumerate(places):
        log = Path(shutil.copytree(trimmed, tmp_path / str(i) / "log"))
        flip(log / name, at)
        assert verify(log).exit_code == 4

        recover(log)

        found, saved = verify(log), saved_of(log)
        assert not [one for one in found.findings if one.severity]
        assert read_plainly(log).head == found.head
        assert len(saved) > len(there) / 2
        assert saved == [one for one in there if one in set(saved)]
        assert kind != "redact" or not has_secrets(log)


def chunks_of_trimmed(log: Path) -> list[tuple[str, int]]:
    """Return file and byte in the middle of each chunk of each trimmed segment."""
    return [
        (segment.path.name, chunk.data_offset + chunk.stored_size // 2)
        for segment in LogReader(log).segments
        if segment.header.trimmed is not None
        for chunk in segment.chunks
    ]


def saved_of(log: Path) -> list[str]:
    """Return the events, but for what tells of numbers of others, and of the recovery."""
    numbered = (Retracted, HistoryTrimmed, SightingsThinned, LogExported)
    entries = (one for one in sl.read(log).history() if not isinstance(one.event, numbered))
    return [repr((one.happened_ns, one.event, one.actor)) for one in entries]


def test_what_thinning_has_told_is_of_the_new_log(untrimmed: Path, tmp_path: Path) -> None:
    """Where that gives other numbers: no sighting counts twice, and none is forgotten."""
    log = Path(shutil.copytree(untrimmed, tmp_path / "log"))
    trim_log(log, RULES["thin"](log))
    name, at = chunks_of_trimmed(log)[-1]
    flip(log / name, at)

    recover(log)

    there = read_plainly(log).events
    for one in sl.read(log).history(kinds=[SightingsThinned]):
        assert isinstance(one.event, SightingsThinned)
        assert one.event.first_event == 0 or one.event.first_event not in there


def test_what_is_saved_behind_a_horizon_answers_as_if_all_were_kept(
    untrimmed: Path, tmp_path: Path
) -> None:
    """The same byte of each later chunk, in the log and in one that keeps all."""
    kept = Path(shutil.copytree(untrimmed, tmp_path / "kept" / "log"))
    trim_log(kept, RULES["keep"](kept), writing={"compact": False})
    there = {path.name: path.read_bytes() for path in untrimmed.glob("*.mcap")}
    later = [
        one for one in LogReader(kept).segments if one.path.read_bytes() == there.get(one.path.name)
    ]
    horizon_ns = LogReader(kept).horizon_ns
    asked = [m for m in moments(untrimmed, 7, count=30) if "event" not in m]
    asked = [m for m in asked if all(int(time[1:]) > horizon_ns for time in m.values())]
    places = [(one.path.name, chunk.data_offset + 20) for one in later for chunk in one.chunks[1:]]
    assert len(places) > 40
    for i, (name, at) in enumerate([places[0], *places[1:-1:5], places[-1]]):
        whole = Path(shutil.copytree(untrimmed, tmp_path / f"{i} whole" / "log"))
        log = Path(shutil.copytree(kept, tmp_path / f"{i} kept" / "log"))
        for one in (whole, log):
            flip(one / name, at)
            recover(one)

        found = verify(log)
        assert not [one for one in found.findings if one.severity]
        assert read_plainly(log).head == found.head
        assert LogReader(log).horizon == LogReader(kept).horizon
        assert answers(log, asked) == answers(whole, asked)
        early = LogReader(log).horizon_ns - 1
        assert answers(log, [{"at": f"@{early}"}, {"event": 1}]) == ["HorizonError"] * 2


def test_what_is_recovered_can_be_trimmed_and_recovered_again(
    untrimmed: Path, tmp_path: Path
) -> None:
    """It is a log as any other."""
    log = Path(shutil.copytree(untrimmed, tmp_path / "log"))
    trim_log(log, RULES["keep"](log))
    for _ in range(2):
        segment = LogReader(log).segments[-1]
        flip(segment.path, segment.chunks[1].data_offset + 20)
        recover(log)
        assert not [one for one in verify(log).findings if one.severity]
        trim_log(log, Retention(LogReader(log), LogReader(log).segments[-1].recorded[0]))

        assert not [one for one in verify(log).findings if one.severity]
        assert sl.read(log).replay().doors.keys() == set(DOORS)


def cut_at(size: int, segment: Segment) -> None:
    segment.path.write_bytes(segment.path.read_bytes()[:size])


@pytest.mark.parametrize(
    "damage",
    [
        partial(cut_at, 0),
        partial(cut_at, 100),
        lambda segment: segment.path.unlink(),
        lambda segment: flip(segment.path, segment.chunks[0].data_offset + 20),
    ],
    ids=["emptied", "cut", "removed", "a bit"],
)
@pytest.mark.parametrize("places", [[0], [0, 1], [1]], ids=str)
def test_a_log_that_lost_the_state_of_its_horizon_is_not_recovered(
    untrimmed: Path, tmp_path: Path, damage: Callable[[Segment], None], places: list[int]
) -> None:
    """Later events tell what was taken out; what its states rest on can be in no new log."""
    log = Path(shutil.copytree(untrimmed, tmp_path / "log"))
    trim_log(log, RULES["keep"](log))
    segments = LogReader(log).segments
    for place in places:
        damage(segments[place])
    files = {path.name: path.read_bytes() for path in log.iterdir()}

    with pytest.raises(LogError, match=r"horizon.*from a copy"):
        recover(log)
    assert {path.name: path.read_bytes() for path in log.iterdir()} == files
    assert [path.name for path in log.parent.iterdir()] == ["log"]


def test_tables_tell_the_same(log: Path) -> None:
    """Histories, timelines and probabilities of each door; of a log trimmed before, and since."""
    before = about_doors(log)

    index(log)

    assert about_doors(log) == before
    assert not [one for one in verify(log).findings if one.severity]
    trim_log(log, redaction(log))
    assert about_doors(log) == about_doors(without_tables(log))
    index(log)
    assert about_doors(log) == about_doors(without_tables(log))
    assert not has_secrets(log)


def without_tables(log: Path) -> Path:
    copy = log.parent / f"plain {len(list(log.parent.iterdir()))}" / "log"
    return Path(shutil.copytree(log, copy, ignore=shutil.ignore_patterns("index")))


def test_exported_lines_make_a_log_of_what_is_left(log: Path, tmp_path: Path) -> None:
    """States are what they were, from the horizon on."""
    reader, target = LogReader(log), tmp_path / "new"
    run("export", log, tmp_path / "x.jsonl")
    run("init", target, "--tz", "UTC")
    run("import", target, tmp_path / "x.jsonl")

    assert not [one for one in verify(target).findings if one.severity]
    times = [m for m in moments(log, 3, count=20) if set(m) == {"at"}]
    times += [
        {"at": f"@{max(reader.horizon_ns, START_NS) + i * 60 * SECOND_NS}"} for i in range(20)
    ]
    for moment, was, now in zip(times, answers(log, times), answers(target, times), strict=True):
        assert was in (now, "HorizonError"), moment


@pytest.mark.parametrize("name", ["x.parquet", "x.mcap"])
def test_other_formats_take_what_is_left(log: Path, tmp_path: Path, name: str) -> None:
    """From the horizon on, without what was taken out."""
    was_secret, out, horizon_ns = has_secrets(log), tmp_path / "out", LogReader(log).horizon_ns
    out.mkdir()
    since = ["--since", f"@{horizon_ns + 1}"] if horizon_ns >= 0 and name == "x.mcap" else []

    run("export", log, out / name, *since)

    assert was_secret or not has_secrets(out)
    assert (out / name).stat().st_size > 1000


def test_shipped_and_fetched_it_says_the_same(log: Path, bucket: str, tmp_path: Path) -> None:
    """And where it lies."""
    asked = moments(log, 1, count=4)

    ship(log, UrlPath(bucket))
    fetch(UrlPath(bucket), tmp_path / "fetched")

    for place in (tmp_path / "fetched", UrlPath(bucket)):
        assert answers(place, asked) == answers(log, asked)
        assert events_of(place) == events_of(log)
        assert not [one for one in verify(place).findings if one.severity]


@pytest.mark.parametrize("kind", RULES)
def test_trimmed_after_it_was_shipped_the_trimmed_segments_take_their_places(
    untrimmed: Path, bucket: str, tmp_path: Path, kind: str
) -> None:
    """The old objects stay in the store, as superseded, until somebody removes them."""
    log = Path(shutil.copytree(untrimmed, tmp_path / "log"))
    first = ship(log, UrlPath(bucket))
    trim_log(log, RULES[kind](log))

    done = ship(log, UrlPath(bucket))

    assert done.sent
    named = {one.name for one in done.manifest.segments}
    replaced = {one.name for one in first.manifest.segments} - named
    assert replaced
    assert {one.name for one in done.manifest.superseded} == replaced
    assert replaced <= {one.name for one in ObjectStore(UrlPath(bucket)).list()}
    fetch(UrlPath(bucket), tmp_path / "fetched")
    asked = moments(log, 1, count=4)
    assert answers(tmp_path / "fetched", asked) == answers(log, asked)
    assert kind != "redact" or not has_secrets(tmp_path / "fetched")


def test_an_untrimmed_object_is_no_copy_of_a_trimmed_segment(
    untrimmed: Path, bucket: str, tmp_path: Path
) -> None:
    """Though it has the same commits, and might have as many bytes."""
    log = Path(shutil.copytree(untrimmed, tmp_path / "log"))
    there = ship(log, UrlPath(bucket)).manifest
    trim_log(log, RULES["redact"](log))
    closed = [segment for segment in LogReader(log).segments if segment.header.trimmed is not None]
    sizes = {segment.header.number: segment.size for segment in closed}
    entries = [replace(one, size=sizes.get(one.header.number, one.size)) for one in there.segments]

    assert closed
    assert shipped_before(closed, replace(there, segments=tuple(entries))) == {}


@pytest.mark.parametrize("kind", RULES)
def test_joined_with_another_it_tells_what_is_left(
    untrimmed: Path, tmp_path: Path, kind: str
) -> None:
    """As before, or, where it is no longer kept, that it is gone."""
    other = another_log(tmp_path / "other")
    asked = [m for m in moments(untrimmed, 5, count=20) if "event" not in m]
    before = [places_and_states(one) for one in joined(untrimmed, other, asked)]
    log = Path(shutil.copytree(untrimmed, tmp_path / "log"))
    trim_log(log, RULES[kind](log))

    after = [places_and_states(one) for one in joined(log, other, asked)]

    assert len(asked) == len(after)
    horizon_ns = LogReader(log).horizon_ns
    for moment, was, now in zip(asked, before, after, strict=True):
        if all(int(time[1:]) >= horizon_ns for time in moment.values()):
            assert now == was, moment


def joined(one: Path, two: Path, asked: Sequence[dict[str, Any]]) -> list[Any]:
    return answers_of(sl.join({"one": one, "two": two}), asked)


def places_and_states(answer: Any) -> Any:
    """Return an answer without names, by which a join gives numbers."""
    return answer if isinstance(answer, str) else sorted(row[1:3] for row in answer)


def another_log(path: Path) -> Path:
    with sl.create(path, tz="UTC", compact=False) as log:
        log.add_door(x=9.0, y=9.0, theta=0.0, width=0.9, name="other", state="closed")
    return path


def test_a_copy_whose_last_event_was_taken_out_is_refused(tmp_path: Path) -> None:
    """It cannot be told from one that went on by itself; the message says so, and what to do."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as log:
        log.add_door(name="front")
        for x in range(9):
            log.append([RobotPose(level=0, x=float(x), y=0.0, theta=0.0)])
    copy(path, tmp_path / "copy")
    with sl.append(path) as log:
        log.observe(1, "open")
    assert trim_log(path, Thinning(LogReader(path), LogReader(path).last_log_time_ns())).done.events

    with pytest.raises(LogError, match=r"ends with event 10"):
        copy(path, tmp_path / "copy")
