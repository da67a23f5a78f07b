"""What visits say of a door whose state is known; what makes no difference to them."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorState
from tests.analysis.scans.scenes import (
    DOOR,
    LINE,
    WALLS,
    WIDTH,
    Drive,
    Segment,
    cast,
    joined,
    leaf,
    moved,
    past,
    places,
    replaced,
    seen,
    the_visit,
)

SHUT = leaf(0)
SCANS_PAST_A_SHUT_DOOR = past(SHUT).scans()
SCANS_PAST_AN_OPEN_DOOR = past(leaf(90)).scans()
HALF = WIDTH / 2


def much_the_same(one: Visit, other: Visit) -> bool:
    return (
        (one.state, one.scans, one.why) == (other.state, other.scans, other.why)
        and one.p_open == pytest.approx(other.p_open, abs=1e-3)
        and one.looks == pytest.approx(other.looks)
        and one.opening == pytest.approx(other.opening, abs=1e-2)
    )


@settings(max_examples=12, deadline=None)
@given(
    turn=st.floats(-pi, pi),
    away=st.floats(0.6, 1.8),
    width=st.floats(0.7, 1.3),
    recess=st.floats(-0.03, 0.06),
    heading=st.floats(-1.0, 1.0),
)
def test_wherever_a_door_lies_shut_is_never_open_nor_open_shut(
    turn: float, away: float, width: float, recess: float, heading: float
) -> None:
    walls = ((-20.0, 1, 0, 1), (width, 1, 20, 1), (-2, 1, -2, 4), (3, 1, 3, 4), (-2, 4, 3, 4))
    track = tuple((x, 1 - away, heading) for x in np.arange(-1.5, 2.6, 0.5).tolist())
    c, s = cos(turn), sin(turn)
    line = (-s + 3, c - 2, turn, width)
    for leaves, wrong in [
        (((0.0, 1 + recess, width, 1 + recess),), DoorState.OPEN),
        ((), DoorState.CLOSED),
    ]:
        scans = [moved(scan, 3, -2, turn) for scan in Drive((*walls, *leaves), track).scans()]
        (visit,) = seen(scans, places(line))
        assert visit.state is not wrong


@pytest.mark.parametrize("recess", [-0.02, 0, 0.05])
@pytest.mark.parametrize("sd_xy", [0.02, 0.05, 0.1])
def test_a_shut_door_is_closed(recess: float, sd_xy: float) -> None:
    visit = the_visit(past(leaf(0, recess=recess), sd_xy=sd_xy).scans(), places())

    assert (DOOR, DoorState.CLOSED, "") == (visit.door_id, visit.state, visit.why)
    assert visit.accuracy > 0.95
    assert visit.opening < 0.1


@pytest.mark.parametrize("angle", [80, 90, 110])
@pytest.mark.parametrize("at_end", [False, True])
def test_an_open_door_is_open(angle: float, at_end: bool) -> None:
    visit = the_visit(past(leaf(angle, at_end=at_end)).scans(), places())

    assert DoorState.OPEN is visit.state
    assert visit.accuracy > 0.95
    assert visit.opening > 0.8


def test_a_doorway_without_a_leaf_is_open() -> None:
    visit = the_visit(past().scans(), places())

    assert DoorState.OPEN is visit.state
    assert () == visit.leaves


@pytest.mark.parametrize("angle", [15, 30, 40])
@pytest.mark.parametrize("at_end", [False, True])
@pytest.mark.parametrize("side", [1, -1])
def test_a_leaf_that_is_ajar_is_not_open_whichever_way_it_swings(
    angle: float, at_end: bool, side: int
) -> None:
    visit = the_visit(past(leaf(angle, at_end=at_end, side=side)).scans(), places())

    assert visit.state is not DoorState.OPEN
    assert visit.ajar > 0.5 or angle < 30
    assert visit.opening == pytest.approx(1 - cos(radians(angle)), abs=0.15)


@pytest.mark.parametrize("angle", [30, 41])
@pytest.mark.parametrize("y", [-0.8, -0.5])
def test_a_leaf_that_hides_the_wall_beside_the_door_is_ajar(angle: float, y: float) -> None:
    """The robot comes from where the leaf would latch."""
    track = tuple((x, y, 2.6) for x in np.arange(4.2, 2.4, -0.25).tolist())

    visit = the_visit(Drive((*WALLS, leaf(angle, side=-1)), track).scans(), places())

    assert "it may be ajar" == visit.why


@pytest.mark.parametrize("side", [-0.05, -0.1])
def test_a_wall_behind_the_door_does_not_open_it(side: float) -> None:
    """More beams end on that wall, which looks like an open leaf, than on the leaf that is ajar."""
    track = tuple((x, -0.5, 1.6) for x in np.arange(3.4, 1.9, -0.25).tolist())
    world = (*WALLS, leaf(30, at_end=True), (-0.05, 1, side, 4))

    visit = the_visit(Drive(world, track).scans(), places())

    assert "it may be ajar" == visit.why


@pytest.mark.parametrize("every", [2, 3])
def test_a_beam_now_and_then_through_a_wall_is_no_visit(every: int) -> None:
    """Lasers tell nonsense now and then."""
    scans = past(SHUT, (-20, 0.4, 20, 0.4), start=-1, stop=2).scans()
    strays = []
    for scan in scans[::every]:
        ranges = scan.ranges.copy()
        bearing = np.arctan2(*(np.array([0.45, 1]) - scan.origins[0])[::-1])
        ranges[np.abs(scan.bearings - bearing).argmin()] = 4.0
        strays.append(replaced(scan, ranges=ranges))

    assert [] == seen(strays, places())


def test_the_likeliest_leaf_lies_where_the_leaf_is() -> None:
    visit = the_visit(past(leaf(36, at_end=True)).scans(), places())

    assert visit.leaves == (pytest.approx(leaf(36, at_end=True), abs=0.05),)


@pytest.mark.parametrize(
    ("kind", "leaves", "state"),
    [
        ("double", [(0, 1, HALF, 1), (HALF, 1, WIDTH, 1)], DoorState.CLOSED),
        ("double", [(0, 1, 0, 1 + HALF), (WIDTH, 1, WIDTH, 1 + HALF)], DoorState.OPEN),
        ("double", [(0, 1, HALF, 1), (WIDTH, 1, WIDTH, 1 + HALF)], DoorState.OPEN),
        ("sliding", [(0, 1, WIDTH, 1)], DoorState.CLOSED),
        ("sliding", [], DoorState.OPEN),
        ("folding", [(0, 1, WIDTH, 1)], DoorState.CLOSED),
        ("folding", [], DoorState.OPEN),
        ("no such kind", [(0, 1, WIDTH, 1)], DoorState.CLOSED),
    ],
)
def test_doors_of_other_kinds(kind: str, leaves: list[Segment], state: DoorState) -> None:
    visit = the_visit(past(*leaves).scans(), places(kind=kind))

    assert (state, "") == (visit.state, visit.why)


@pytest.mark.parametrize("end", [0.35, 0.65])
def test_a_sliding_door_that_stands_half_way_is_told_by_its_opening(end: float) -> None:
    visit = the_visit(past((0, 1, end * WIDTH, 1)).scans(), places(kind="sliding"))

    assert visit.opening == pytest.approx(1 - end, abs=0.12)


def test_half_of_a_double_door() -> None:
    """The leaf at the line's start is shut, the other one open: both are found."""
    leaves = [(0, 1, HALF, 1), (WIDTH, 1, WIDTH, 1 + HALF)]

    visit = the_visit(past(*leaves).scans(), places(kind="double"))

    assert 2 == len(visit.leaves)
    assert visit.leaves[0] == pytest.approx(leaves[0], abs=0.02)
    assert visit.leaves[1] == pytest.approx(leaves[1], abs=0.02)


def glazed(share_through: float) -> list:
    """Return scans of a shut door of glass, through which this share of the beams goes."""
    rng = np.random.default_rng(2)
    return [
        replaced(shut, ranges=np.where(rng.random(361) < share_through, free.ranges, shut.ranges))
        for shut, free in zip(SCANS_PAST_A_SHUT_DOOR, past().scans(), strict=True)
    ]


def test_a_shut_door_of_glass_is_open_to_who_does_not_know() -> None:
    assert DoorState.CLOSED is not the_visit(glazed(0.65), places()).state
    assert DoorState.CLOSED is the_visit(glazed(0.65), places(glass=True)).state
    assert DoorState.OPEN is the_visit(SCANS_PAST_AN_OPEN_DOOR, places(glass=True)).state


def test_no_beams_through_no_open_door() -> None:
    """Cupboards before the door hide it: nothing is said, however long they are looked at."""
    cupboards = (-3.0, 0.7, 4.0, 0.7)

    assert [] == [v for v in seen(past(cupboards).scans(), places()) if v.state]


def test_somebody_in_the_doorway_of_an_open_door_does_not_shut_it() -> None:
    box = [(0.1, 0.9, 0.5, 0.9), (0.1, 1.1, 0.5, 1.1), (0.1, 0.9, 0.1, 1.1), (0.5, 0.9, 0.5, 1.1)]

    visit = the_visit(past(*box).scans(), places())

    assert visit.state is not DoorState.CLOSED
    assert visit.through > 1 < visit.stopped


@pytest.mark.parametrize("y", [0.1, 0.2, 0.3, -0.2])
def test_a_pose_that_is_worse_than_told_opens_no_shut_door(y: float) -> None:
    """Four times the error that the model believes in: the visit's own misfit tells."""
    visits = seen(past(SHUT, error=(0.1, y, 0.0)).scans(), places())

    assert [] == [visit for visit in visits if visit.state is DoorState.OPEN]
    assert [y] * len(visits) == [pytest.approx(v.behind_m, abs=0.03) for v in visits]


@pytest.mark.parametrize("turn", [4, -4])
def test_a_heading_that_is_worse_than_told_opens_no_shut_door(turn: float) -> None:
    visit = the_visit(past(SHUT, error=(0.0, 0.0, radians(turn))).scans(), places())

    assert visit.state is not DoorState.OPEN


@pytest.mark.parametrize("tremble_m", [0.0, 0.01])
def test_a_robot_that_parks_proves_little_more(tremble_m: float) -> None:
    """Also where its localisation trembles."""
    rng = np.random.default_rng(7)
    track = [(HALF + x, y, 0.0) for x, y in rng.normal(0, tremble_m, (200, 2)).tolist()]
    once = seen(Drive((*WALLS, SHUT), tuple(track[:1])).scans(), places())
    parked = seen(Drive((*WALLS, SHUT), tuple(track), every_s=0.1).scans(), places())

    assert 1 == len(once) == len(parked)
    assert once[0].looks <= parked[0].looks < 2 * once[0].looks


def test_a_faster_laser_proves_no_more() -> None:
    slow = past(SHUT).scans()
    track = tuple((x, 0.0, 0.0) for x in np.arange(-2, 2.76, 0.025).tolist())
    fast = Drive((*WALLS, SHUT), track, every_s=0.05).scans()

    assert the_visit(fast, places()).looks == pytest.approx(
        the_visit(slow, places()).looks, rel=0.2
    )


@pytest.mark.parametrize("turn", [0.7, 3.0, -1.9])
@pytest.mark.parametrize("scans", [SCANS_PAST_A_SHUT_DOOR, past(leaf(30)).scans()])
def test_the_same_world_told_otherwise_is_the_same_visit(turn: float, scans: list) -> None:
    """Turned and moved; the line from its other end; bearings that descend."""
    c, s = cos(turn), sin(turn)
    line = (c * LINE[0] - s * LINE[1] + 5, s * LINE[0] + c * LINE[1] - 8, turn, WIDTH)
    descending = [
        replaced(s, bearings=s.bearings[::-1], ranges=s.ranges[::-1], origins=s.origins[::-1])
        for s in scans
    ]
    visit = the_visit(scans, places())

    assert much_the_same(visit, the_visit([moved(s, 5, -8, turn) for s in scans], places(line)))
    assert much_the_same(visit, the_visit(scans, places((WIDTH, 1.0, pi, WIDTH))))
    assert much_the_same(visit, the_visit(descending, places()))


@pytest.mark.parametrize("seam", [0.0, 0.9, 1.1, 1.2, 1.3, pi / 2, 3.0, 5.5, 7.4])
def test_where_a_whole_turn_begins_makes_no_difference(seam: float) -> None:
    """A laser that sees all around: its first beam may point at the door."""
    angles = np.linspace(0, 2 * pi, 720, endpoint=False)
    scan = SCANS_PAST_A_SHUT_DOOR[8]
    x, y = scan.origins[0].tolist()
    round_about = replaced(
        scan,
        origins=np.tile([x, y], (720, 1)),
        bearings=seam + angles,
        ranges=cast((x, y, seam), (*WALLS, SHUT), angles),
    )

    visit = the_visit([round_about], places())

    assert DoorState.CLOSED is visit.state
    assert 4 == visit.looks == pytest.approx(visit.stopped)


@pytest.mark.parametrize("at_once", [1, 3, 7, 33])
def test_how_scans_are_cut_into_calls_makes_no_difference(at_once: int) -> None:
    """Long enough for several visits: up and down the corridor, in twos and with rests."""
    track = [(x, 0.0, 0.0) for x in [*np.arange(-2.013, 3, 0.1), *np.arange(3.007, -2, -0.1)]]
    scans = Drive((*WALLS, leaf(90)), tuple(track * 2), every_s=0.6).scans()

    all_at_once = seen(scans, places())
    some = seen(scans, places(), at_once=at_once)

    assert len(all_at_once) == len(some) >= 4
    assert [(v.first_ns, v.last_ns) for v in all_at_once] == [(v.first_ns, v.last_ns) for v in some]
    assert all(much_the_same(a, b) for a, b in zip(all_at_once, some, strict=True))


def test_a_thousand_doors_elsewhere_make_no_difference_nor_does_their_order() -> None:
    rng = np.random.default_rng(3)
    others = [
        places((x, y, t, 0.9), door=100 + i)
        for i, (x, y, t) in enumerate(rng.uniform(20, 200, (1000, 3)).tolist())
    ]
    shuffled = [others[i] for i in rng.permutation(1000).tolist()]

    alone = the_visit(SCANS_PAST_A_SHUT_DOOR, places())
    first = the_visit(SCANS_PAST_A_SHUT_DOOR, joined([places(), *others]))
    among = the_visit(SCANS_PAST_A_SHUT_DOOR, joined([*shuffled[:500], places(), *shuffled[500:]]))

    assert alone == first == among


def test_two_doors_of_two_kinds_are_judged_each_by_its_own() -> None:
    """A shut door of two leaves across the corridor."""
    other = places((0.0, -1.0, 0.0, WIDTH), kind="double", door=9)

    visits = seen(past(leaf(90)).scans(), joined([other, places()]))

    assert [(7, "OPEN"), (9, "CLOSED")] == sorted((v.door_id, v.state.name) for v in visits)
    assert the_visit(past(leaf(90)).scans(), other) in visits


def test_a_door_on_another_level_is_not_met() -> None:
    assert [] == seen([replaced(scan, level=1) for scan in SCANS_PAST_A_SHUT_DOOR], places())


def test_robots_have_visits_of_their_own() -> None:
    shut, open_door = SCANS_PAST_A_SHUT_DOOR, SCANS_PAST_AN_OPEN_DOOR
    other = [replaced(scan, robot="two") for scan in open_door]
    mixed = [scan for both in zip(shut, other, strict=True) for scan in both]

    visits = seen(mixed, places())

    assert {"": "CLOSED", "two": "OPEN"} == {v.robot: v.state.name for v in visits}
    assert the_visit(shut, places()) in visits


def test_a_visit_ends_when_the_door_was_out_of_sight() -> None:
    watcher = DoorWatcher()
    first = watcher.take(SCANS_PAST_A_SHUT_DOOR, places())
    away = past(SHUT, start=12, stop=14, start_s=1100).scans()

    ended = watcher.take(away, places())

    assert [] == first
    assert ["CLOSED"] == [visit.state.name for visit in ended]
    assert [] == watcher.close()


def test_a_visit_ends_after_a_while_though_the_door_is_in_sight() -> None:
    scans = Drive((*WALLS, SHUT), ((0.2, -0.3, 0.0),) * 200, every_s=0.5).scans()

    visits = seen(scans, places())

    assert [30, 30] == [round((v.last_ns - v.first_ns) / 1e9, -1) for v in visits[:2]]
    assert all(a.last_ns < b.first_ns for a, b in pairwise(visits))
    assert visits[1].looks < visits[0].looks, "the second visit saw what the first one had seen"


@pytest.mark.parametrize(
    "other",
    [
        places((0.0, 1.05, 0.0, WIDTH)),
        places(kind="sliding"),
        places(glass=True),
        places(door=8),
    ],
)
def test_a_door_that_changed_or_went_ends_its_visit_as_it_was(other) -> None:
    watcher = DoorWatcher()
    watcher.take(SCANS_PAST_A_SHUT_DOOR[:10], places())

    (ended,) = watcher.take([], other)

    assert the_visit(SCANS_PAST_A_SHUT_DOOR[:10], places()) == ended
    assert [] == watcher.close()


def test_a_door_that_stays_keeps_its_visit_when_others_come() -> None:
    watcher = DoorWatcher()
    watcher.take(SCANS_PAST_A_SHUT_DOOR[:10], places())
    added = joined([places((40.0, 1.0, 0.0, 1.0), door=3), places()])

    assert [] == watcher.take(SCANS_PAST_A_SHUT_DOOR[10:], added)
    (visit,) = watcher.close()
    assert the_visit(SCANS_PAST_A_SHUT_DOOR, places()) == visit


def test_stamps_that_repeat_or_go_back_are_dropped_and_counted() -> None:
    scans = SCANS_PAST_A_SHUT_DOOR
    watcher = DoorWatcher()

    visits = watcher.take([*scans[:10], scans[9], scans[4], *scans[10:]], places())

    assert [the_visit(scans, places())] == visits + watcher.close()
    assert {
        "its stamp is that of the scan before": 1,
        "its stamp is before that of the scan before": 1,
    } == watcher.dropped


def test_a_clock_that_was_set_back_ends_visits_and_begins_anew() -> None:
    watcher = DoorWatcher()

    visits = watcher.take(SCANS_PAST_A_SHUT_DOOR + past(leaf(90), start_s=10).scans(), places())

    assert ["OPEN", "CLOSED"] == [v.state.name for v in visits + watcher.close()][::-1]
    assert not watcher.dropped


def test_a_door_square_to_the_way_is_judged_too() -> None:
    """A door at the corridor's end, seen head on."""
    end = (6.0, 1.0, 6.0, -1.0)
    track = tuple((x, 0.0, 0.0) for x in np.arange(1.0, 5.0, 0.25).tolist())
    at_end = places((6.0, -0.45, pi / 2, 0.9))

    visit = the_visit(Drive((*WALLS, end), track).scans(), at_end)

    assert DoorState.CLOSED is visit.state
