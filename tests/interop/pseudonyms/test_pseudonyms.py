"""Exports for others: no name, no word of anybody can be read in them, and all states can."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.cli import main as run
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import (
    KINDS,
    ClassDefined,
    DoorAnnotated,
    DoorObserved,
    Event,
    FloorMap,
    LevelAdded,
    LogExported,
    MomentPinned,
    RobotPose,
)
from semmap_log.errors import HorizonError
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.importing.importing import import_file
from semmap_log.interop.pseudonyms.pseudonymous_log import pseudonymous
from semmap_log.interop.pseudonyms.pseudonyms import Pseudonyms
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.replay.replay import Scope
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.reading.reader import LogReader
from tests.conftest import SteadyClock
from tests.log.trimming.logs import answers_of, moments, random_log, without_texts
from tests.store.test_other_readers import ONE_OF_EACH

SECRETS = ("Anna", "Bert", "Zoe", "whisper", "Morgue", "Chapel", "Tower", "Villa", "robbie")
"""All that somebody wrote by hand."""
DAY = "2026-03-01T{:02}:00:00Z"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with a name or a word wherever there can be one."""
    path = tmp_path_factory.mktemp("villa") / "Villa"
    with sl.create(path, tz="UTC", building="Villa", robot="robbie", clock=SteadyClock()) as log:
        cells = np.zeros((20, 20), np.int8)
        log.append(
            [
                LevelAdded(level=0, name="Tower", elevation=0.0),
                FloorMap(level=0, resolution=0.5, origin_x=0.0, origin_y=0.0, cells=cells),
            ],
            note=Note("Anna", "Villa scan", "whisper", "Chapel round"),
        )
        for i, name in enumerate(("Morgue", "Chapel")):
            log.add_door(
                x=2.0 + i, y=2.0, theta=0.5, width=0.9, name=name, actor="Bert", state="closed",
                prob_open=0.5, prob_closed=0.5, at=DAY.format(1),
            )  # fmt: skip
        log.annotate(1, "rooms", "Morgue, Chapel", actor="Anna")
        log.annotate(1, "owner", "Zoe")
        log.annotate(2, "lift", "Tower lift")
        log.annotate(2, "name", "")
        log.append([RobotPose(level=0, x=1.0, y=1.5, theta=0.0)], note=Note("robbie"))
        log.observe(1, "open", accuracy=0.9, at=DAY.format(2), actor="Anna", source="Bert's eye")
        log.append([LogExported(format="yaml", file_name="Zoe.yaml", at_ns=5)])
        log.append([MomentPinned(at_ns=10**18, name="whisper")])
        wrong = log.observe(2, "open", at=DAY.format(3), reason="whisper")
        log.retract(wrong.first_event, actor="Anna", reason="whisper")
        log.observe(2, "closed", at=DAY.format(4), correlation="Chapel round")
    return path


def told(path: Path) -> Iterator[bytes]:
    """Yield what can be read in a file: its bytes, and those that it has packed."""
    yield path.name.encode()
    yield path.read_bytes()
    if path.suffix == ".mcap":
        with path.open("rb") as file:
            for _, _, message in make_reader(file).iter_messages():
                yield message.data
    if path.suffix == ".parquet":
        pq = pytest.importorskip("pyarrow.parquet")
        yield repr(pq.read_table(path).to_pylist()).encode()


@pytest.mark.parametrize(
    "name", ["a.jsonl", "a.csv", "a.geojson", "a.yaml", "a.html", "a.parquet", "a.rrd", "a.mcap",
             "a.bag"],
)  # fmt: skip
def test_no_file_holds_a_name_or_a_word(
    log: Path, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever the format, by the command line; with the robot's tracks, too."""
    markers = ["--markers"] if name in ("a.mcap", "a.bag") else []
    for tracks in ([], ["--with-tracks"]):
        words = ["export", str(log), str(tmp_path / name), "--pseudonymous", *tracks, *markers]
        with pytest.raises(SystemExit) as left:
            run(words)
        assert not left.value.code, capsys.readouterr().err

        read = b"\n".join(told(tmp_path / name))
        assert not [word for word in SECRETS if word.encode() in read]
        assert len(read) > 150
    assert not [word for word in SECRETS if word in capsys.readouterr().err.replace(str(log), "")]


def test_states_places_and_times_are_those_of_the_log(log: Path) -> None:
    """At every moment, by what is known today and by what was known then."""
    original = sl.read(log)
    moments = [{}, *({"at": DAY.format(hour)} for hour in range(5))]
    moments += [{"known_at": f"@{c.closed_ns}"} for c in original.commits()]
    with pseudonymous(original) as (copy, _):
        for moment in moments:
            theirs, ours = copy.replay(**moment).doors, original.replay(**moment).doors
            assert theirs.keys() == ours.keys()
            for door_id, door in ours.items():
                other = theirs[door_id]
                assert (other.state, other.x, other.y, other.width, other.prob_open) == (
                    door.state, door.x, door.y, door.width, door.prob_open,
                )  # fmt: skip
                assert set(other.annotations) == set(door.annotations) - {"owner"}


def test_the_same_person_has_the_same_pseudonym(log: Path) -> None:
    """Numbered in the order in which they come; what is not known stays so."""
    with pseudonymous(sl.read(log)) as (copy, names):
        actors = [commit.note.actor for commit in copy.commits()]
        door = copy.replay().doors[1]

    assert actors == ["actor-1", "actor-2", "actor-2", "actor-1", "", "", "actor-1", "", "actor-1",
                      ""]  # fmt: skip
    assert door.annotations == {"name": "door-1", "rooms": "room-1,room-2"}
    assert names.left_out == {
        "DoorAnnotated": 1, "RobotPose": 1, "LogExported": 1, "MomentPinned": 1,
    }  # fmt: skip


def test_the_lines_make_a_log_anew(log: Path, tmp_path: Path) -> None:
    """With the log's own times, as any log's lines do."""
    out = tmp_path / "events.jsonl"
    with pseudonymous(sl.read(log)) as (copy, _):
        export(copy, out)
        times = [commit.recorded_ns for commit in copy.commits()]

    with sl.create(tmp_path / "again", tz="UTC") as again:
        import_file(again, out)
    assert times == [commit.recorded_ns for commit in sl.read(tmp_path / "again").commits()]


def test_a_copy_ends_where_the_question_does(log: Path, tmp_path: Path) -> None:
    """`--event` means the log's own numbers, though the copy has others."""
    out = tmp_path / "doors.geojson"
    pose = next(h.number for h in sl.read(log).history() if isinstance(h.event, DoorObserved))

    for event, state in ((pose - 1, "CLOSED"), (pose, "OPEN")):
        with pytest.raises(SystemExit):
            run(["export", str(log), str(out), "--pseudonymous", "--event", str(event)])
        assert f'"state": "{state}", ' in out.read_text().partition("door-2")[0]


@pytest.mark.parametrize("event", ONE_OF_EACH, ids=lambda event: type(event).__name__)
def test_every_kind_is_told_without_its_words(event: Event) -> None:
    """A text of any kind goes, or gets another in its place."""
    texts = [f.name for f in dataclasses.fields(event) if isinstance(getattr(event, f.name), str)]
    written = dataclasses.replace(event, **dict.fromkeys(texts, "Zoe") | of_classes(event))

    assert "Zoe" not in repr(Pseudonyms(with_tracks=True).event(written))
    if not texts:
        assert Pseudonyms(with_tracks=True).event(written) == event


def of_classes(event: Event) -> dict[str, str]:
    """Return texts that a class can have."""
    if not isinstance(event, ClassDefined):
        return {}
    return {"geometry": "point", "states": "Zoe,with Zoe", "blocks": "Zoe"}


def test_every_kind_is_looked_at() -> None:
    """One of each is among those above."""
    assert set(KINDS) == {type(event) for event in ONE_OF_EACH}


def test_what_is_said_of_doors_under_other_keys_goes() -> None:
    """Whatever somebody called it."""
    said = DoorAnnotated(door_id=DoorId(1), key="Zoe", value="Zoe")

    assert Pseudonyms().event(said) is None


@pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")
@pytest.mark.filterwarnings("ignore::semmap_log.errors.SensorWarning")
@pytest.mark.parametrize("seed", range(4))
def test_a_log_with_a_horizon_has_copies_with_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """From there on they answer as the log does, and believe the same; before, that it is gone."""
    log = random_log(tmp_path, seed, monkeypatch, commits=200, roll=30)
    until_ns = [commit.recorded_ns for commit in LogReader(log).commits()][150]
    if seed % 2:
        trim_log(log, Thinning(LogReader(log), until_ns))
    trim_log(log, Retention(LogReader(log), until_ns))
    opened = sl.read(log)
    begins_ns = opened.horizon_ns()
    asked = [
        moment
        for moment in moments(log, seed)
        if "event" not in moment and all(abs(int(t[1:]) - begins_ns) > 4 for t in moment.values())
    ]

    with pseudonymous(opened) as (copy, _):
        ours, theirs = (without_texts(answers_of(one, asked)) for one in (opened, copy))
        believed, told = (
            [p for b in probabilities(one, at=opened.end_ns()) for p in (b.p_open, b.low, b.high)]
            for one in (opened, copy)
        )
        assert [] == [one for one in verify(Path(str(copy.path))).findings if one.severity]

    assert ours == theirs
    assert "HorizonError" in ours
    assert told == pytest.approx(believed, nan_ok=True)


def test_no_copy_ends_before_the_horizon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines of events say that they tell only the last words of before."""
    log = random_log(tmp_path, 1, monkeypatch, commits=150, roll=30)
    trim_log(log, Retention(LogReader(log), LogReader(log).last_log_time_ns()))
    opened = sl.read(log)

    for scope in (Scope(at_ns=opened.horizon_ns() - 1), Scope(event=opened.horizon() - 2)):
        with pytest.raises(HorizonError), pseudonymous(opened, scope):
            pass
        with pytest.raises(HorizonError):
            export(opened, tmp_path / "events.jsonl", scope)
    (note,) = export(opened, tmp_path / "events.jsonl").notes
    assert f"history begins at event {opened.horizon()}" in note
