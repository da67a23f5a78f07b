"""The page's data: what it says of the doors is what a replay says."""

from __future__ import annotations

import base64
import hashlib
import json
import random
import re
from itertools import accumulate
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved, LogExported, PatrolStarted
from semmap_log.errors import MomentError
from semmap_log.views.report import page_events
from semmap_log.views.report.content import report
from tests.conftest import SteadyClock
from tests.views.report.pages import (
    MS,
    data_of,
    log_of,
    replayed_at,
    retracted_log,
    shown_at,
    telling_moments,
    watched_log,
)
from tests.views.rerun.some_logs import SECOND, START, restless_log, small_log

RECORDINGS = Path(__file__).parents[3] / "recordings"
HOSTILE = "</script><img src=x onerror=alert(1)><!-- & 'a' \"b\" \u2028 ${x}"


@pytest.mark.parametrize("seed", range(3))
def test_the_doors_are_those_of_a_replay(tmp_path: Path, seed: int) -> None:
    """At any moment: state, last sighting, level, line and probabilities."""
    log = retracted_log(tmp_path / "log", seed=seed)

    data = data_of(report(log).html)

    for t in telling_moments(data, random.Random(seed), 25):
        assert replayed_at(log, data, t) == shown_at(data, t), t


def test_nothing_is_shown_a_nanosecond_early(tmp_path: Path) -> None:
    """What counts within a millisecond is not there at its begin; of two in one the later holds."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as writer:
        door = writer.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, state="closed")
        gone = writer.add_door(x=0.0, y=1.0, theta=0.0, width=1.0, state="closed")
        clock.now_ns = START + 9 * SECOND
        for ns, state in ((5 * MS + 1, "open"), (7 * MS - 1, "closed"), (7 * MS, "moving"),
                          (9 * MS + 1, "open"), (9 * MS + 2, "offline")):  # fmt: skip
            writer.observe(door, state, at=START + SECOND + ns)
        writer.remove_door(gone, at=START + SECOND + 3 * MS + 1)
    log = sl.read(tmp_path / "log")

    data = data_of(report(log).html)

    first = START // MS + 1000 - data["begin"]
    for t in range(first, first + 12):
        assert replayed_at(log, data, t) == shown_at(data, t), t
    assert "CLOSED" == shown_at(data, first + 5)[door]["state"]
    assert "OPEN" == shown_at(data, first + 6)[door]["state"]


@pytest.mark.parametrize("seed", range(2))
def test_a_part_of_a_log_is_right_too(tmp_path: Path, seed: int) -> None:
    """The state before `since` opens the page; at no moment of it the replay says otherwise."""
    log = restless_log(tmp_path / "log", seed=seed)
    since = START + 70 * 60 * SECOND + 123
    until = START + 200 * 60 * SECOND + 456

    data = data_of(report(log, since=since, until=until).html)

    assert -(-since // MS) == data["begin"]
    assert data["begin"] + data["end"] <= (until - 1) // MS
    for t in telling_moments(data, random.Random(seed), 25):
        assert replayed_at(log, data, t) == shown_at(data, t), t


def test_a_page_ends_before_until(tmp_path: Path) -> None:
    """Within a millisecond, too: its last one is whole."""
    clock = SteadyClock(START)
    until = START + SECOND + 7 * MS + 456
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as writer:
        door = writer.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, state="closed")
        clock.now_ns = START + 2 * SECOND
        writer.observe(door, "open", at=until - 1)

    data = data_of(report(sl.read(tmp_path / "log"), until=until).html)

    assert until // MS == data["begin"] + data["end"]
    assert "CLOSED" == shown_at(data, data["end"])[door]["state"]


def test_what_is_told_of_a_door_that_is_gone_is_no_change(tmp_path: Path) -> None:
    """Somebody saw it open afterwards: it is not among the changes."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as writer:
        door = writer.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, state="closed")
        clock.now_ns = START + 60 * SECOND
        writer.observe(door, "open", at=START + 50 * SECOND)
        writer.remove_door(door, at=START + 40 * SECOND)

    changes = data_of(report(sl.read(tmp_path / "log")).html)["changes"]

    assert "removed from the map" == changes[0]["what"]
    assert 2 == len(changes)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_part_of_some_doors_in_another_zone_is_right_too(tmp_path: Path, seed: int) -> None:
    """
    Whatever is chosen: at each moment that the page can show, the doors asked for are a replay's.
    """
    rng = random.Random(seed)
    log = retracted_log(tmp_path / "log", seed=seed)
    since, until = sorted(START + rng.randrange(300 * 60 * SECOND) for _ in range(2))
    ever = sorted({each.door_id for each in log.history() if each.door_id is not None})
    chosen = rng.sample(ever, rng.randint(1, len(ever)))
    how = {"doors": chosen, "tz": rng.choice(["Asia/Kathmandu", "America/St_Johns"])}

    data = data_of(report(log, since=since, until=until, **how).html)

    moments = [0, data["end"], *(rng.randint(0, data["end"]) for _ in range(25))]
    for t in moments + (telling_moments(data, rng, 25) if data["doors"] else []):
        expected = {i: door for i, door in replayed_at(log, data, t).items() if i in chosen}
        assert expected == shown_at(data, t), t
    assert how["tz"] == data["log"]["tz"]


def test_some_doors_are_shown_without_the_others(tmp_path: Path) -> None:
    """Only what was asked for, in doors and in changes; the rounds stay."""
    log = small_log(tmp_path / "log")

    data = data_of(report(log, doors=[DoorId(1)]).html)

    assert [1] == [door["id"] for door in data["doors"]]
    assert {1, None} == {change["door"] for change in data["changes"]}
    ((start, end, *said),) = data["rounds"]
    assert (600_000, 1_200_000) == pytest.approx((start, end), abs=1000)
    assert ["round 1", ""] == said


def test_a_span_that_ends_before_it_begins_is_refused(tmp_path: Path) -> None:
    """Rather than a page of nothing."""
    log = small_log(tmp_path / "log")

    with pytest.raises(MomentError, match="swap them"):
        report(log, since=START + 2 * SECOND, until=START)


def test_the_same_log_makes_the_same_page(tmp_path: Path) -> None:
    """Byte for byte; no clock of the machine is on it."""
    log = restless_log(tmp_path / "log", seed=1)

    assert report(log).html == report(sl.read(tmp_path / "log")).html


@pytest.mark.slow
def test_a_week_of_132_doors_stays_small() -> None:
    """Far below the 5 MB that a mail takes."""
    made = report(sl.read(RECORDINGS / "clinic_week"))

    assert 133 == made.doors
    assert len(made.html.encode()) < 1_000_000


def test_nothing_in_the_data_can_become_markup(tmp_path: Path) -> None:
    """A hostile name, actor or reason is within the data as it was, and nowhere as itself."""
    log = log_of(tmp_path / "log", HOSTILE)

    html = report(log).html

    assert HOSTILE == data_of(html)["doors"][0]["name"]
    assert "<img" not in html
    assert 2 == html.count("</script>")


def test_the_title_is_inert_too(tmp_path: Path) -> None:
    """A building may be called anything."""
    with sl.create(tmp_path / "log", tz="UTC", building="</title><b>&") as log:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0)

    html = report(sl.read(tmp_path / "log")).html

    assert "<title>log · &lt;/title&gt;&lt;b&gt;&amp;: door report</title>" in html


def test_nothing_is_fetched() -> None:
    """No address is in the page but SVG's name; and its policy forbids to load anything."""
    html = report(sl.read(RECORDINGS / "office")).html

    addresses = {piece.split('"')[0] for piece in html.split("http")[1:]}
    assert {"-equiv=", "://www.w3.org/2000/svg"} == addresses
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', html)
    allowed = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert "'none'" == allowed["default-src"]
    assert "data:" == allowed["img-src"]
    for kind in ("style", "script"):
        (text,) = re.findall(rf"<{kind}>(.*?)</{kind}>", html, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"'sha256-{digest}'" == allowed[f"{kind}-src"]


def test_of_very_many_sightings_only_repeats_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """States stay those of a replay; `last seen` lags by no more than the page says."""
    monkeypatch.setattr(page_events, "MOST_STATES", 100)
    clock = SteadyClock(START)
    rng = random.Random(3)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as writer:
        door = writer.add_door(x=0.0, y=0.0, theta=0.0, width=1.0)
        sightings = [
            DoorObserved(door_id=door, happened_ns=START + (60 + 7 * i) * SECOND,
                         state=DoorState.OPEN if rng.random() < 0.95 else DoorState.CLOSED)
            for i in range(2000)
        ]  # fmt: skip
        clock.now_ns = START + 20_000 * SECOND
        writer.append(sightings)
    log = sl.read(tmp_path / "log")

    data = data_of(report(log).html)

    assert len(data["doors"][0]["t"]) < 600
    assert data["seenWithin"] > 0
    for t in telling_moments(data, rng, 60):
        said, true = shown_at(data, t)[1], replayed_at(log, data, t)[1]
        assert true["state"] == said["state"]
        assert 0 <= true["seen"] - said["seen"] < data["seenWithin"]
    assert replayed_at(log, data, data["end"]) == shown_at(data, data["end"])


def test_changes_tell_who_and_why(tmp_path: Path) -> None:
    """The latest first; sightings that repeat a state are not changes."""
    changes = data_of(report(small_log(tmp_path / "log")).html)["changes"]

    assert ["seen CLOSED", "removed from the map", "given up after 12 s", "P(open) 0.50",
            "seen OPEN (90%)"] == [change["what"] for change in changes[:5]]  # fmt: skip
    assert ("anna", "a wall now") == (changes[1]["actor"], changes[1]["reason"])


@pytest.mark.slow
def test_typical_weeks_come_with_the_doors_of_which_enough_is_known() -> None:
    """168 hours in percent, -1 where nobody looked; and P(open) with its interval."""
    data = data_of(report(sl.read(RECORDINGS / "clinic_week")).html)

    door = data["doors"][0]
    assert 168 == len(door["week"])
    assert -1 == min(door["week"])
    assert 75 < max(door["week"]) <= 100
    p, low, high = door["p"]
    assert 0 <= low <= p <= high <= 1


def test_another_zone_is_that_of_all_times() -> None:
    """The hours of weeks and of clocks."""
    log = sl.read(RECORDINGS / "office")

    data = data_of(report(log, tz="Asia/Tokyo").html)

    assert "Asia/Tokyo" == data["log"]["tz"]
    assert [9 * 3600] == [seconds for _, seconds in data["offsets"]]
    assert data["health"]["happened"][0].endswith("+09:00")


def test_events_about_no_door_make_a_page(tmp_path: Path) -> None:
    """Rounds and exports alone: no doors, one level without a plan."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([PatrolStarted(patrol=1), LogExported(format="yaml", file_name="x", at_ns=0)])

    data = data_of(report(sl.read(tmp_path / "log")).html)

    assert not data["isEmpty"]
    assert [] == data["doors"]
    assert ["Level 0"] == [level["name"] for level in data["levels"]]
    assert ["exported as yaml: x"] == [change["what"] for change in data["changes"]]


def test_the_data_is_plain_json(tmp_path: Path) -> None:
    """No NaN, which browsers refuse."""
    data = data_of(report(log_of(tmp_path / "log", "a", "b", placed=False)).html)

    assert data == json.loads(json.dumps(data, allow_nan=False))


@pytest.mark.parametrize("hours", [None, (12, 60)])
def test_it_tells_when_a_door_was_not_seen(tmp_path: Path, hours: tuple[int, int] | None) -> None:
    """From when a sighting no longer holds to the next one, of the page's own time."""
    log = watched_log(tmp_path / "log")
    since, until = (None, None) if hours is None else (START + h * 3600 * SECOND for h in hours)
    timeline = log.timeline("front", at=until and until - 1, since=since)

    data = data_of(report(log, since=since, until=until).html)

    (door,) = data["doors"]
    edges = [data["begin"] + t for t in accumulate(door["lapses"])]
    assert edges[::2] == [-(-ns // MS) for ns in timeline.lapse_start_ns.tolist()]
    assert edges[1::2] == [-(-ns // MS) for ns in timeline.lapse_end_ns.tolist()]
    assert len(edges) == (6 if hours is None else 4)
    assert door["holds"] == 3 * 3600 * 1000
