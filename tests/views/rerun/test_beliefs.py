"""What a recording shows of beliefs, read back without a viewer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import default_estimator, learn, typical_weeks
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import parse_instant
from semmap_log.views.rerun.belief_curves import TOLERANCE, times_of_curve
from semmap_log.views.rerun.recording import save_rrd
from semmap_log.views.rerun.scene import MOST_ROWS
from semmap_log.views.rerun.week_pictures import (
    NO_CELL,
    UNKNOWN_CELL,
    Sheet,
    axis_labels,
    door_labels,
    picture,
)
from tests.analysis.beliefs.patrolled import FRONT, VIENNA, patrolled
from tests.views.rerun.some_logs import Drawn, small_log, wild_log
from tests.views.rerun.test_blueprint import views_of

pytestmark = pytest.mark.viewer

FRONT_CURVE = "/map/doors/front/belief"
SCALARS = "Scalars:scalars"
RECORDINGS = Path(__file__).parents[3] / "recordings"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return patrolled(tmp_path_factory.mktemp("beliefs") / "log", days=10)


@pytest.fixture(scope="module")
def drawn(log: sl.DoorLog, tmp_path_factory: pytest.TempPathFactory) -> Drawn:
    path = tmp_path_factory.mktemp("beliefs-rrd") / "x.rrd"
    save_rrd(log, path)
    return Drawn(path)


@pytest.mark.slow
def test_the_curve_is_what_could_be_believed_then(log: sl.DoorLog, drawn: Drawn) -> None:
    """At each of its times, the estimator's answer from what had happened by then."""
    beliefs = learn(log, estimator=default_estimator())

    rows = drawn.rows(FRONT_CURVE, SCALARS)

    times_ns = np.array([time for time, _ in rows])
    shown = np.array([value[0] for _, value in rows])
    said = beliefs.predict(FRONT, times_ns, times_ns)
    believed = np.where(said.is_known, said.p_open, np.nan)
    np.testing.assert_allclose(shown, believed, atol=1e-9)  # learnt together: sums in another order
    assert len(times_ns) > 10
    assert [] == drawn.rows(FRONT_CURVE, SCALARS, "recorded")
    assert [] == drawn.rows(FRONT_CURVE, SCALARS, "event")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_curves_are_right_in_a_wild_log(seed: int, tmp_path: Path) -> None:
    """Of every door that has one: with late events, much taken back."""
    log = wild_log(tmp_path / "log", seed=seed)
    beliefs = learn(log, estimator=default_estimator())

    save_rrd(log, tmp_path / "x.rrd")

    drawn = Drawn(tmp_path / "x.rrd")
    curves = [entity for entity in drawn.entities if entity.endswith("/belief")]
    assert len(curves) > 1
    for entity in curves:
        door_id = DoorId(int(entity.split("/")[-2].removeprefix("door_")))
        rows = drawn.rows(entity, SCALARS)
        times_ns = np.array([time for time, _ in rows])
        said = beliefs.predict(door_id, times_ns, times_ns)
        believed = np.where(said.is_known, said.p_open, np.nan)
        np.testing.assert_allclose([value[0] for _, value in rows], believed, atol=1e-9)
        last = log.replay(at=int(times_ns[-1]))
        assert door_id in last.doors
        goes_on = door_id in log.replay().doors and not np.isnan(believed[-1])
        assert not goes_on or times_ns[-1] == log.end_ns()


def test_between_its_points_the_line_is_right(log: sl.DoorLog, drawn: Drawn) -> None:
    """Nowhere that the estimator was asked is it off by more than .01."""
    beliefs = learn(log, estimator=default_estimator())
    rows = drawn.rows(FRONT_CURVE, SCALARS)
    times_ns, shown = (np.array([row[i] for row in rows]).ravel() for i in (0, 1))

    added_ns = log.event(0).happened_ns
    requested_ns = times_of_curve(beliefs.evidence.door(FRONT), added_ns, log.end_ns())

    said = beliefs.predict(FRONT, requested_ns, requested_ns)
    line = np.interp(requested_ns - added_ns, times_ns.astype(np.int64) - added_ns, shown)
    known = said.is_known & np.isfinite(line)
    assert known.sum() > 100
    assert np.abs(line - said.p_open)[known].max() <= TOLERANCE + 1e-6


def test_a_door_never_seen_has_no_curve(drawn: Drawn) -> None:
    """Nor a tile among the weeks."""
    assert "/map/doors/attic/belief" not in drawn.entities
    assert ["front", "store"] == drawn.statics["/weeks/labels", "Points2D:labels"]


def test_the_weeks_are_typical_weeks(log: sl.DoorLog, drawn: Drawn) -> None:
    """The first tile holds the front door's cells in percent; what nobody saw is marked."""
    (front,) = typical_weeks(log, doors=[FRONT])

    (buffer,), (shape,) = (
        drawn.statics["/weeks", f"SegmentationImage:{part}"] for part in ("buffer", "format")
    )
    cells = np.frombuffer(bytes(buffer), np.uint8).reshape(shape["height"], shape["width"])
    column, row = Sheet.of(2, 5).corner(0)
    shown = cells[row : row + 7, column : column + 24]
    known = front.hours.is_known
    np.testing.assert_array_equal(np.rint(100 * front.hours.p_open)[known], shown[known])
    assert {UNKNOWN_CELL} == set(shown[~known].tolist())
    assert {NO_CELL} == set(cells[:row, :].ravel().tolist())


LONG = 60
"""Letters of a name for which there is no room beside a week."""


@pytest.mark.parametrize("letters", [5, 12, LONG])
@pytest.mark.parametrize("doors", [1, 2, 5, 12, 13, 24, 36, 66, 133])
def test_tiles_do_not_overlap(doors: int, letters: int, log: sl.DoorLog) -> None:
    """For any number of doors, each has its 168 cells; labels and key lie beside them."""
    (front,) = typical_weeks(log, doors=[FRONT])
    sheet = Sheet.of(doors, letters)

    cells = picture([front] * doors, sheet)

    assert 168 * doors == np.count_nonzero(cells[:, : sheet.right] != NO_CELL)
    key = cells[:, sheet.right]
    assert [100, 0, UNKNOWN_CELL] == [key[key != NO_CELL][0], key[key <= 100][-1], key[-1]]
    for name, x, y in [*door_labels(["front"] * doors, sheet), *axis_labels(sheet)]:
        assert 0 <= x < sheet.width, name
        assert 0 <= y < sheet.height, name


@pytest.mark.parametrize(
    ("doors", "letters", "expected"),
    [(12, LONG, True), (14, 9, True), (24, 7, True), (36, 5, True), (36, 20, False),
     (14, LONG, False), (133, 5, False)],
)  # fmt: skip
def test_weeks_bear_names_where_there_is_room(doors: int, letters: int, expected: bool) -> None:
    """Beside more than twelve weeks: a name then ends before the week."""
    sheet = Sheet.of(doors, letters)

    assert expected == sheet.has_names
    if doors > 12 and expected:
        places = [sheet.corner(place) for place in range(doors)]
        names = list(door_labels(["x" * letters] * doors, sheet))
        for (left, _), (_, middle, _) in zip(places, names, strict=True):
            half = 0.45 * letters * sheet.line / 2
            assert middle + half <= left
            before = max((x + 24 for x, _ in places if x < left), default=0)
            assert before <= middle - half
        assert sheet.line <= 9


def test_hours_stand_below_the_lowest_week_of_each_column() -> None:
    """Of thirteen doors, one is alone in the last row: its hours are lower than the others'."""
    sheet = Sheet.of(13, LONG)

    noons = [(x, y) for label, x, y in axis_labels(sheet) if label == "12"]

    assert sheet.columns == len({x for x, _ in noons}) == len(noons)
    assert 2 == len({y for _, y in noons})


def test_the_layout_has_curves_and_weeks(log: sl.DoorLog, tmp_path: Path) -> None:
    """A tab for each door with a curve; without beliefs, neither."""
    with_them = views_of(log, tmp_path)
    without = views_of(log, tmp_path, beliefs=False)

    week = "Typical week (Monday on top, Europe/Vienna)"
    curves = {f"{name} (UTC)" for name in ("front", "store")}
    assert {week, *curves} <= set(with_them)
    assert not {week, *curves, "attic (UTC)"} & set(without)


@pytest.mark.slow
def test_weeks_of_the_liveliest_doors_are_called_so(tmp_path: Path) -> None:
    """Each level of the clinic has more doors than can be read."""
    names = views_of(sl.read(RECORDINGS / "clinic_week"), tmp_path, costmap=False)

    assert {
        "L1 typical week, 36 liveliest (Monday on top, Europe/Vienna)",
        "L2 typical week, 36 liveliest (Monday on top, Europe/Vienna)",
    } == {name for name in names if "week" in name}


def test_they_can_be_left_out(log: sl.DoorLog, tmp_path: Path) -> None:
    """No entity is left of them."""
    save_rrd(log, tmp_path / "x.rrd", beliefs=False)

    entities = Drawn(tmp_path / "x.rrd").entities
    assert not [name for name in entities if name.endswith("/belief") or "weeks" in name]


def test_a_jump_is_drawn_as_one(drawn: Drawn) -> None:
    """The viewer is told not to draw points that are near each other as their mean."""
    import rerun as rr

    policy = drawn.statics[FRONT_CURVE, "SeriesLines:aggregation_policy"]

    assert [rr.components.AggregationPolicy.Off.value] == policy


def test_a_day_without_habits_has_curves_all_the_same(tmp_path: Path) -> None:
    """In the office the doors were seen six times each: what was believed is drawn."""
    save_rrd(sl.read(RECORDINGS / "office"), tmp_path / "x.rrd")

    drawn = Drawn(tmp_path / "x.rrd")
    rows = drawn.rows("/map/doors/coe_door/belief", SCALARS)
    assert 1 < sum(np.isfinite(value[0]) for _, value in rows)


def test_a_log_that_tells_too_little_has_no_weeks(tmp_path: Path) -> None:
    """Two sightings are no habit, and a door never seen has no curve either."""
    save_rrd(small_log(tmp_path / "log"), tmp_path / "x.rrd")

    entities = Drawn(tmp_path / "x.rrd").entities
    assert "/weeks" not in entities
    assert "/map/doors/door_2/belief" not in entities


def test_a_part_ends_with_its_last_moment(log: sl.DoorLog, tmp_path: Path) -> None:
    """With `until` no point lies later, and the week is as known then."""
    until_ns = parse_instant("2026-03-09T12:00", tz=VIENNA)

    save_rrd(log, tmp_path / "x.rrd", until=until_ns, doors=[FRONT])

    drawn = Drawn(tmp_path / "x.rrd")
    assert max(time for time, _ in drawn.rows(FRONT_CURVE, SCALARS)) < until_ns
    assert ["front"] == drawn.statics["/weeks/labels", "Points2D:labels"]
    (earlier,) = typical_weeks(log, at=until_ns, doors=[FRONT])
    (buffer,) = drawn.statics["/weeks", "SegmentationImage:buffer"]
    sheet = Sheet.of(1, 5)
    column, row = sheet.corner(0)
    monday_11 = row * sheet.width + column + 10
    assert round(100 * earlier.hours.p_open[0, 10]) == bytes(buffer)[monday_11]


@pytest.mark.slow
def test_a_week_of_132_doors_stays_small(tmp_path: Path) -> None:
    """At most a tenth more, and no chunk longer than rerun likes."""
    clinic = sl.read(RECORDINGS / "clinic_week")

    sizes = [save_rrd(clinic, tmp_path / f"{n}.rrd", beliefs=n == 1).bytes for n in (0, 1)]

    assert sizes[1] < 1.1 * sizes[0]
    assert Drawn(tmp_path / "1.rrd").most_rows <= MOST_ROWS
