"""Random objects and classes, told late and taken back, beside events sorted by hand."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.core.model.doors import outline_text
from semmap_log.core.model.events import ClassDefined, DoorAdded, DoorAnnotated, DoorObserved, Event
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")
SECOND_NS, EVER_NS = 10**9, 10**19
CLASSES, GEOMETRIES = ("dock", "spill", "gate"), ("segment", "polygon", "point")
WORDS = ("OPEN,CLOSED,MOVING", "free,taken", "dry,wet,drying")


@dataclass
class Told:
    """An event as the test told it."""

    number: int
    when_ns: int
    recorded_ns: int
    event: Event


@dataclass
class Story:
    """All that was told, and what was taken back by which event."""

    told: list[Told] = field(default_factory=list)
    back: dict[int, int] = field(default_factory=dict)

    def at(self, when_ns: int, last: int) -> dict[int, tuple[str, str, str]]:
        """Door -> class, what its state is called, outline: of what was known up to an event."""
        hidden = {number for number, by in self.back.items() if by <= last}
        known = [t for t in self.told if t.number <= last and t.number not in hidden]
        counts = [t for t in known if t.when_ns <= when_ns]
        classes: dict[str, ClassDefined] = {}
        doors: dict[int, dict[str, str]] = {}
        for one in sorted(counts, key=lambda t: (t.when_ns, t.number)):
            match one.event:
                case ClassDefined():
                    classes[one.event.class_name] = one.event
                case DoorAdded():
                    doors[one.event.door_id] = {"state": one.event.state.name}
                case DoorObserved():
                    doors[one.event.door_id]["state"] = one.event.state.name
                case DoorAnnotated() if one.event.door_id in doors:
                    doors[one.event.door_id][one.event.key] = one.event.value
        return {i: self._seen(said, classes) for i, said in doors.items()}

    @staticmethod
    def _seen(said: dict[str, str], classes: dict[str, ClassDefined]) -> tuple[str, str, str]:
        of = classes.get(said.get("class", ""))
        if of is None:
            return "door", said["state"], ""
        names = dict(zip(("OPEN", "CLOSED", "MOVING"), of.states.split(","), strict=False))
        outline = said.get("outline", "") if of.geometry == "polygon" else ""
        return of.class_name, names.get(said["state"], said["state"]), outline


def tell(path: Path, dice: random.Random, commits: int) -> Story:
    """Write a log, and remember all that it was told."""
    story, clock = Story(), SteadyClock()
    with sl.create(path, tz="UTC", clock=clock, durability="none", compact=False) as log:
        doors: list[int] = []
        for _ in range(commits):
            number = log.last_event() + 1
            late_ns = dice.choice([0, 0, 0, 5, 60]) * SECOND_NS
            event = _an_event(dice, doors)
            if event is None:
                mine = [t.number for t in story.told if t.number not in story.back
                        and not isinstance(t.event, DoorAdded)]  # fmt: skip
                if mine:
                    story.back[dice.choice(mine)] = number
                    log.retract(next(n for n, by in story.back.items() if by == number))
                continue
            begun = log.now_ns()
            happened_ns = max(begun - late_ns, 0) if late_ns else begun
            if isinstance(event, DoorAdded):
                happened_ns = 5
            event = type(event)(**{**_values(event), "happened_ns": happened_ns})
            log.append([event])
            recorded_ns = log.entry(number).recorded_ns
            when_ns = min(happened_ns, recorded_ns)
            story.told.append(Told(number, when_ns, recorded_ns, event))
    return story


def _values(event: Event) -> dict[str, object]:
    return {name: getattr(event, name) for name in type(event).rules.fields if name != "salt"}


def _an_event(dice: random.Random, doors: list[int]) -> Event | None:
    """Return a random event; None: something is to be taken back."""
    if not doors or dice.random() < 0.1:
        doors.append(len(doors) + 1)
        return DoorAdded(door_id=sl.DoorId(doors[-1]), x=1.0, y=2.0, theta=0.5, width=1.0)
    door = sl.DoorId(dice.choice(doors))
    match dice.randrange(8):
        case 0 | 1:
            return ClassDefined(class_name=dice.choice(CLASSES), geometry=dice.choice(GEOMETRIES),
                                states=dice.choice(WORDS), blocks="")  # fmt: skip
        case 2 | 3:
            return DoorAnnotated(door_id=door, key="class", value=dice.choice([*CLASSES, "x", ""]))
        case 4:
            corners = [(dice.randrange(9) * 1.0, dice.randrange(9) / 4) for _ in range(3)]
            return DoorAnnotated(door_id=door, key="outline", value=outline_text(corners))
        case 5:
            return None
        case _:
            return DoorObserved(door_id=door, state=dice.choice(list(sl.DoorState)))


def seen(door_map: sl.DoorMap) -> dict[int, tuple[str, str, str]]:
    """What a replay gives, in the form of `Story.at`."""
    return {
        int(i): (d.object_class.name, d.state_word,
                 d.annotations.get("outline", "") if d.outline else "")
        for i, d in door_map.doors.items()
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_any_moment_is_what_was_told_of_it(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By what is known today, and by what was known up to an event; from keyframes and without."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 30)
    dice = random.Random(seed)
    path = tmp_path / "log"
    story = tell(path, dice, 150)
    last = story.told[-1].number + 5

    def check(moments: list[Told]) -> None:
        log = sl.read(path)
        for one in dice.sample(moments, min(12, len(moments))):
            moment = min(one.recorded_ns + dice.randrange(3), log.end_ns())
            assert story.at(moment, last) == seen(log.replay(at=f"@{moment}"))
            assert story.at(EVER_NS, one.number) == seen(log.replay(event=one.number))
        assert story.at(EVER_NS, last) == seen(log.replay())
        assert 0 == verify(path).exit_code

    check(story.told)
    compact(path)
    check(story.told)
    trim_log(path, Retention(LogReader(path), story.told[len(story.told) // 2].recorded_ns))
    kept = sl.read(path)
    behind_ns = LogReader(path).horizon_ns
    check([t for t in story.told if t.number >= (kept.horizon() or 0) and t.when_ns > behind_ns])
