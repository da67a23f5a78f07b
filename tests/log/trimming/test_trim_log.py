"""Records taken out of a log: what is asked of the rest is answered as before, or refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.model.events import HistoryTrimmed, MomentPinned, RobotPose
from semmap_log.errors import HorizonError
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.replay.read_model.indexing import index
from semmap_log.log.trimming.redaction import Annotation, Notes, Redaction, Tracks
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, TrimRule, plan_trimming, trim_log
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.log.trimming.logs import (
    SECOND_NS,
    MinuteClock,
    answers,
    moments,
    random_log,
    without_texts,
)
from tests.store.trimming.plain_chain import all_bytes, read_plainly

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")


@pytest.fixture(params=range(2))
def seed(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture
def log(tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch) -> Path:
    return random_log(tmp_path, seed, monkeypatch)


def everything(log: Path) -> Redaction:
    reader = sl.read(log)
    texts = [Annotation(door, "name") for door in (1, 2, 3)]
    pins = tuple(reader.pins().values())
    return Redaction([Notes(), Tracks(), *texts], reader.last_event() + 1, pins)


def middle_ns(log: Path) -> int:
    commits = list(sl.read(log).commits())
    return commits[2 * len(commits) // 3].recorded_ns


def check_sound(log: Path) -> None:
    """Verified by the product, and by a reader that shares no line with it."""
    found, plain = verify(log), read_plainly(log)
    assert not [f for f in found.findings if f.severity and f.kind != "leftover"]
    assert found.exit_code == 0
    assert plain.head == found.head
    assert len(plain.events) == found.events


def test_what_is_redacted_is_gone_and_nothing_else(log: Path, seed: int) -> None:
    """Of no byte of the folder can it be read; states are what they were, whatever is asked."""
    asked = moments(log, seed)
    before = answers(log, asked)
    history = [h for h in sl.read(log).history() if not isinstance(h.event, RobotPose)]

    found = trim_log(log, everything(log), note=sl.Note(actor="officer"))

    assert found.done.notes
    assert found.done.events
    assert without_texts(answers(log, asked)) == without_texts(before)
    left = [h for h in sl.read(log).history() if not isinstance(h.event, HistoryTrimmed)]
    kept = [h for h in history if type(h.event).__name__ != "DoorAnnotated"]
    assert [(h.number, repr(h.event), h.recorded_ns, "") for h in kept] == [
        (h.number, repr(h.event), h.recorded_ns, h.actor) for h in left
    ]
    check_sound(log)
    for _, data in all_bytes(log):
        for word in (b"secret", b"anna", b"bert"):
            assert word not in data


def test_a_log_is_thinned_without_a_change_of_its_states(log: Path, seed: int) -> None:
    """At every moment, by what is known today and by what was known then."""
    asked = moments(log, seed)
    before = answers(log, asked)

    found = trim_log(log, Thinning(LogReader(log), middle_ns(log)))

    assert found.done.events > 20
    assert answers(log, asked) == before
    check_sound(log)


def test_what_is_older_than_it_is_kept_is_an_error(log: Path, seed: int) -> None:
    """Never another answer; behind the horizon all is as it was."""
    asked = moments(log, seed)
    before = answers(log, asked)
    rule = Retention(LogReader(log), middle_ns(log))

    trim_log(log, rule)

    after = answers(log, asked)
    reader = LogReader(log)
    assert reader.horizon == rule.before > 0
    assert {one for one in after if isinstance(one, str)} == {"HorizonError"}
    for moment, was, now in zip(asked, before, after, strict=True):
        if now == "HorizonError":
            event = moment.get("event", -1)
            assert event + 1 < reader.horizon
        else:
            assert now == was
    listed = sl.read(log).history(since=f"event:{rule.before}")
    assert next(h.number for h in listed) == rule.before
    check_sound(log)


def test_care_in_any_order(log: Path, seed: int) -> None:
    """Thinned, kept for so long, redacted, written to again: each finds what the others left."""
    for rule in (
        Thinning(LogReader(log), middle_ns(log)),
        Retention(LogReader(log), middle_ns(log) - 10**13),
    ):
        trim_log(log, rule)
    asked = moments(log, seed)
    before = answers(log, asked)

    trim_log(log, everything(log))
    with sl.append(log) as opened:
        opened.observe(1, "open")

    assert without_texts(answers(log, asked)) == without_texts(before)
    check_sound(log)


def test_a_pinned_moment_is_answered_when_its_past_is_gone(log: Path) -> None:
    """With what was told of it later, even after the retention."""
    early = list(sl.read(log).commits())[60].recorded_ns
    with sl.append(log, compact=False) as opened:
        opened.append([MomentPinned(at_ns=early, name="audit")])
    before = answers(log, [{"at": "pin:audit"}])
    trim_log(log, Retention(LogReader(log), middle_ns(log)))

    assert answers(log, [{"at": "pin:audit"}, {"at": f"@{early}"}]) == before * 2
    assert answers(log, [{"at": f"@{early - 1}"}]) == ["HorizonError"]

    with sl.append(log) as opened:
        opened.observe(2, "offline", at=f"@{early}")
    state = sl.read(log).replay(at="pin:audit").doors[2].state
    assert state == sl.DoorState.OFFLINE


@pytest.mark.parametrize("raw", [False, True], ids=["pin", "append"])
def test_a_pinned_moment_stays_answerable_when_it_is_pinned_again(log: Path, raw: bool) -> None:
    """Under the same name, and under another one whose first pin then moves on."""
    early = list(sl.read(log).commits())[60].recorded_ns
    with sl.append(log, compact=False) as opened:
        opened.pin("audit", at=f"@{early}")
    before = answers(log, [{"at": "pin:audit"}])
    trim_log(log, Retention(LogReader(log), middle_ns(log)))
    with sl.append(log, compact=False) as opened:
        if raw:
            opened.append([MomentPinned(at_ns=early, name="audit")])
        else:
            opened.pin("audit", at=f"@{early}")
            opened.pin("case 7", at=f"@{early}")
            opened.pin("audit")

    name = "audit" if raw else "case 7"
    assert answers(log, [{"at": f"pin:{name}"}, {"at": f"@{early}"}]) == before * 2


@pytest.mark.parametrize("kind", ["redaction", "thinning", "retention"])
def test_a_plan_counts_what_is_done(log: Path, kind: str) -> None:
    """And writes nothing."""
    rule: TrimRule = {
        "redaction": lambda: everything(log),
        "thinning": lambda: Thinning(LogReader(log), middle_ns(log)),
        "retention": lambda: Retention(LogReader(log), middle_ns(log)),
    }[kind]()
    files = {path.name: path.read_bytes() for path in log.iterdir()}

    planned = plan_trimming(log, rule)

    assert {path.name: path.read_bytes() for path in log.iterdir()} == files
    done = trim_log(log, rule).done
    assert (done.events, done.notes) == (planned.done.events, planned.done.notes)


def test_what_was_put_back_is_noticed(log: Path, tmp_path: Path) -> None:
    """The untrimmed files in place of the trimmed ones."""
    before = Path(shutil.copytree(log, tmp_path / "before"))
    trim_log(log, everything(log))
    trimmed = next(s for s in LogReader(log).segments if s.header.trimmed is not None)
    after = trimmed.path.read_bytes()
    for segment in LogReader(before).segments:
        shutil.copy(segment.path, log / segment.path.name)

    assert verify(log).exit_code == 4

    (before / trimmed.path.name).write_bytes(after)
    assert verify(before).exit_code == 4


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log of a door without a place, in segments of four commits."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 4)
    path, clock = tmp_path / "small", MinuteClock()
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        door = log.add_door(state="closed")
        for _ in range(7):
            log.observe(door, "open")
        log.append([RobotPose(x=1.0, y=2.0, theta=0.0)])  # the first of a segment
        for _ in range(4):
            log.observe(door, "open")
    return path


def last_ns(log: Path) -> int:
    return next(reversed(list(LogReader(log).commits()))).recorded_ns


def test_a_door_without_a_place_is_kept(small: Path) -> None:
    """Nobody says where it is."""
    before = sl.read(small).timeline(1)
    trim_log(small, Retention(LogReader(small), last_ns(small)))

    after = sl.read(small).timeline(1)
    assert after.state[-1] == before.state[-1]
    assert not sl.read(small).replay().doors[1].is_placed


@pytest.mark.parametrize("door", [None, 1])
def test_tables_of_what_is_left_are_asked(log: Path, door: int | None) -> None:
    """A question without a beginning tells what there is, with tables as without."""
    trim_log(log, Retention(LogReader(log), middle_ns(log)))
    before = [repr(one) for one in sl.read(log).history(door)]

    index(log)

    assert [repr(one) for one in sl.read(log).history(door)] == before
    with pytest.raises(HorizonError):
        list(sl.read(log).history(door, since="event:1"))


def test_sightings_of_a_removed_door_are_thinned(small: Path) -> None:
    """Also those that were after its removal, which was told late."""
    seen_ns = next(sl.read(small).history(1, since="event:3")).happened_ns
    with sl.append(small, compact=False) as opened:
        opened.remove_door(1, at=f"@{seen_ns}")

    assert trim_log(small, Thinning(LogReader(small), last_ns(small))).done.events > 3

    assert 1 not in sl.read(small).replay().doors
    check_sound(small)


def test_sightings_of_a_door_that_was_taken_back_are_no_obstacle(small: Path) -> None:
    """Though nobody may tell anything of it any more."""
    with sl.append(small, compact=False) as opened:
        opened.retract(0)

    trim_log(small, Thinning(LogReader(small), last_ns(small)))

    check_sound(small)


def test_a_text_of_an_earlier_time_counts_when_a_later_one_is_redacted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From keyframes, and at pins, as from the log itself; unless it was taken back by then."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 3)
    path, clock = tmp_path / "log", MinuteClock()
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        log.add_door(x=1.0, y=1.0, theta=0.0, width=0.9)
        early_ns = clock.now_ns
        secret = log.annotate(1, "name", "secret").commit
        log.annotate(1, "name", "late", at=f"@{early_ns}")
        wrong = log.annotate(1, "name", "wrong", at=f"@{early_ns + 1}").commit.last_event
        log.observe(1, "open")
        noted = log.observe(1, "open").commit
        log.retract(wrong)
        for _ in range(12):
            log.observe(1, "open")
        log.pin("audit", at=f"@{secret.recorded_ns}")
        log.observe(1, "open")
    trim_log(path, Retention(LogReader(path), noted.recorded_ns + 9 * SECOND_NS))

    trim_log(path, Redaction.of(LogReader(path), [Annotation(1, "name")], secret.last_event + 1))

    reader = sl.read(path)
    assert reader.replay().doors[1].annotations == {"name": "late"}
    assert reader.replay(at="pin:audit").doors[1].annotations == {"name": "late"}
    check_sound(path)


def test_stopped_after_the_last_segment_it_can_be_finished(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though nothing is left to take out: the log has yet to say that it is done."""
    rule = Redaction([Tracks()], sl.read(log).last_event() + 1)
    with monkeypatch.context() as patch:
        patch.setattr("semmap_log.log.trimming.trim_log.remove_stale_tables", stop)
        with pytest.raises(KeyboardInterrupt):
            trim_log(log, rule)
    assert [f for f in verify(log).findings if f.severity]

    trim_log(log, rule)

    check_sound(log)


def stop(_: Path) -> None:
    raise KeyboardInterrupt


def test_what_was_told_late_of_a_pinned_moment_can_be_taken_back(small: Path) -> None:
    """Also where it was told before the past of the moment went."""
    asked = [{"at": "pin:audit"}]
    with sl.append(small, compact=False) as opened:
        opened.pin("audit", at="event:2")
        at = f"@{opened.pins()['audit'].at_ns}"
        before = repr(answers(small, asked))
        until_ns = last_ns(small)
        for _ in range(3):
            opened.observe(1, "open")
        late = opened.observe(1, "offline", at=at).commit.last_event
    trim_log(small, Retention(LogReader(small), until_ns))
    with sl.append(small, compact=False) as opened:
        opened.retract(late)

    assert LogReader(small).horizon > 2
    assert repr(answers(small, asked)) == before


def test_a_log_is_kept_for_so_long_where_its_horizon_was_thinned(small: Path) -> None:
    """The commit behind the horizon is gone; a moment before it stays pinned."""
    with sl.append(small, compact=False) as opened:
        opened.pin("audit", at="event:2")
    asked, until_ns = [{"at": "pin:audit"}, {}], LogReader(small).commit_at(8).recorded_ns
    before = repr(answers(small, asked))
    trim_log(small, Thinning(LogReader(small), last_ns(small)))

    rule = Retention(LogReader(small), until_ns)
    assert LogReader(small).find_commit(rule.horizon) is None
    trim_log(small, rule)

    assert 0 < LogReader(small).horizon <= rule.horizon
    assert repr(answers(small, asked)) == before


@pytest.mark.parametrize("kind", ["thin", "keep", "redact"])
def test_where_nothing_goes_nothing_is_written(log: Path, seed: int, kind: str) -> None:
    """The second time, in a log that has records of the kinds that could go."""
    last_ns = LogReader(log).last_log_time_ns()
    rules: dict[str, TrimRule] = {
        "thin": Thinning(LogReader(log), last_ns),
        "keep": Retention(LogReader(log), last_ns),
        "redact": Redaction([Tracks()], sl.read(log).last_event() + 1),
    }
    assert trim_log(log, rules[kind]).event is not None
    with sl.append(log, compact=False) as opened:
        opened.observe(1, "moving")
    before = {path.name: path.read_bytes() for path in log.iterdir()}
    again: dict[str, TrimRule] = {
        "thin": Thinning(LogReader(log), LogReader(log).last_log_time_ns()),
        "keep": Retention(LogReader(log), last_ns),
        "redact": Redaction([Tracks()], sl.read(log).last_event() + 1),
    }

    found = trim_log(log, again[kind])

    assert (found.event, found.done.segments) == (None, 0)
    assert {path.name: path.read_bytes() for path in log.iterdir()} == before


def test_that_nothing_goes_is_one_line(
    log: Path, seed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """On stdout, and the exit code is 0."""
    trim_log(log, Thinning(LogReader(log), LogReader(log).last_log_time_ns()))
    last = sl.read(log).last_event()
    capsys.readouterr()

    with pytest.raises(SystemExit, match="0"):
        main(["retain", str(log), "--thin", "1s"])

    shown = capsys.readouterr()
    assert shown.out.count("\n") == 1
    assert "there is nothing of that to take out" in shown.out
    assert sl.read(log).last_event() == last
