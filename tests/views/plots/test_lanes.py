"""State lanes: what is drawn, asked of matplotlib itself."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="not installed: pip install 'semmap-log[plots]'")

import semmap_log as sl
from semmap_log.core.folds.timeline import Timeline
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId, DoorState, reduced
from semmap_log.core.model.events import PatrolFinished, PatrolStarted
from semmap_log.core.model.moments import DAY_NS, HOUR_NS
from semmap_log.views.palette import COLOUR_BLIND, DEFAULT, Rgb
from semmap_log.views.plots.figures import letters_of
from semmap_log.views.plots.lanes import MOST_INTERVALS, Lanes, draw_lanes, plot_lanes
from tests.conftest import SteadyClock

OFFICE = Path(__file__).parents[3] / "recordings" / "office"


@pytest.fixture(scope="module")
def office() -> sl.DoorLog:
    return sl.read(OFFICE)


def bars(figure: Any) -> list[tuple[Rgb, float, float, float, float]]:
    """Return colour, begin (days), end, and the lane's upper and lower edge of each bar."""
    found = []
    for collection in figure.axes[0].collections:
        (colour,) = np.round(collection.get_facecolor()[:, :3] * 255).astype(int).tolist()
        for path in collection.get_paths():
            box = path.get_extents()
            found.append((tuple(colour), box.x0, box.x1, box.y0, box.y1))
    return found


def drawn_at(figure: Any, lane: int, ns: int) -> list[Rgb]:
    """Return the colours of the bars that stand in a lane at a time."""
    return [
        colour for colour, begin, end, *sides in bars(figure)
        if begin <= ns / DAY_NS < end and round(np.mean(sides)) == lane
    ]  # fmt: skip


@pytest.mark.slow
def test_at_any_moment_a_lane_has_the_colour_that_a_replay_shows(office: sl.DoorLog) -> None:
    """A lane a door below that of the rounds, in the order of their ids."""
    dice = random.Random(7)
    lanes = Lanes.of(office)

    figure = draw_lanes(lanes)

    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert ["rounds of tinyRobot1", "main_door", "coe_door", "hardware_door"] == labels
    for _ in range(60):
        ns = dice.randrange(lanes.start_ns, lanes.end_ns)
        doors = office.replay(at=f"@{ns}").doors
        for lane, door_id in enumerate(lanes.doors, 1):
            expected = [DEFAULT.of_state(doors[door_id].state)] if door_id in doors else []
            assert expected == drawn_at(figure, lane, ns), (lane, ns)


def test_a_round_is_drawn_from_its_start_to_its_end(tmp_path: Path, clock: SteadyClock) -> None:
    """A lane a robot; what goes on reaches the right edge, what nobody saw begin the left one."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        begin_ns = clock.now_ns - DAY_NS
        log.add_door(at=f"@{begin_ns}")
        for patrol, kind, hours, robot in (
            (1, PatrolStarted, 1, "a"), (1, PatrolFinished, 2, "a"),
            (2, PatrolFinished, 3, "b"), (3, PatrolStarted, 9, "b"),
        ):  # fmt: skip
            event = kind(patrol=patrol, happened_ns=begin_ns + hours * HOUR_NS)
            log.append([event], note=Note(actor=robot))
        lanes = Lanes.of(log, until=f"@{begin_ns + 12 * HOUR_NS}")

    figure = draw_lanes(lanes)

    hours = [
        (lane, round((begin - begin_ns / DAY_NS) * 24), round((end - begin_ns / DAY_NS) * 24))
        for colour, begin, end, *sides in bars(figure)
        for lane in [round(np.mean(sides))]
        if colour == DEFAULT.robot
    ]
    assert [(0, 1, 2), (1, 0, 3), (1, 9, 12)] == sorted(hours)


def test_heights_say_the_same_as_colours(office: sl.DoorLog) -> None:
    """Open is highest, unknown a line; in the colour-blind palette as well."""
    for palette in (DEFAULT, COLOUR_BLIND):
        found = bars(draw_lanes(Lanes.of(office), palette))

        heights = {colour: round(high - low, 2) for colour, _, _, low, high in found}
        assert {palette.open: 0.8, palette.closed: 0.4, palette.unknown: 0.12} == {
            palette.of_state(state): heights[palette.of_state(state)]
            for state in (DoorState.OPEN, DoorState.CLOSED, DoorState.UNKNOWN)
        }


def test_of_very_many_intervals_each_column_shows_the_longest() -> None:
    """A door that is open for 9 s of every 10 s, for a month, is drawn in some thousand bars."""
    start = np.arange(250_000, dtype=np.int64) * 10 * 10**9
    start = np.stack([start, start + 9 * 10**9], -1).ravel()
    state = np.tile(np.array([DoorState.OPEN, DoorState.CLOSED], np.uint8), 250_000)
    count = np.arange(len(start))
    busy = Timeline(DoorId(1), start, np.append(start[1:], start[-1] + 10**9), state, count, count)
    lanes = Lanes({DoorId(1): busy}, {}, [], int(start[0]), int(start[-1]), "UTC")

    found = bars(draw_lanes(lanes))

    assert {DEFAULT.of_state(reduced(DoorState.OPEN))} == {colour for colour, *_ in found}
    assert len(found) <= MOST_INTERVALS


def test_many_lanes_do_not_look_at_each_other(office: sl.DoorLog) -> None:
    """The axes are set, not found anew from all bars at each lane: thousands would take minutes."""
    panel = draw_lanes(Lanes.of(office)).axes[0]

    assert (False, False) == (panel.get_autoscalex_on(), panel.get_autoscaley_on())


@pytest.mark.parametrize("name", ["a.svg", "a.png"])
def test_the_same_lanes_are_the_same_file(name: str, office: sl.DoorLog, tmp_path: Path) -> None:
    """No time of making, no random names in it."""
    plot_lanes(Lanes.of(office), tmp_path / name)
    first = (tmp_path / name).read_bytes()

    plot_lanes(Lanes.of(office), tmp_path / name)

    assert first == (tmp_path / name).read_bytes()


@pytest.mark.filterwarnings("error")
def test_a_log_of_one_moment_has_a_picture(tmp_path: Path, clock: SteadyClock) -> None:
    """A door that was only just added; its name in letters that mean something to matplotlib."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.annotate(log.add_door(), "name", "a$b$ 門")
        lanes = Lanes.of(log)

    plot_lanes(lanes, tmp_path / "x.svg")

    assert "a$b$ 門" in (tmp_path / "x.svg").read_text()


@pytest.mark.slow
def test_days_are_told_by_their_names_above_many_lanes_too() -> None:
    """Over the clinic's week each midnight says which day begins; of three doors, below only."""
    clinic = draw_lanes(Lanes.of(sl.read(OFFICE.parent / "clinic_week")))
    few = draw_lanes(Lanes.of(sl.read(OFFICE)))

    for figure, is_above in ((clinic, True), (few, False)):
        figure.canvas.draw()
        axis = figure.axes[0].xaxis
        assert is_above == axis.get_major_ticks()[0].label2.get_visible()
    days = [label.get_text() for label in clinic.axes[0].get_xticklabels()]
    names = ["Tue 3 Mar", "Wed 4 Mar", "Thu 5 Mar", "Fri 6 Mar", "Sat 7 Mar", "Sun 8 Mar"]
    assert 2 * names == days


def test_names_are_written_in_a_font_that_has_their_letters(
    tmp_path: Path, clock: SteadyClock
) -> None:
    """Where there is a font with Chinese letters, two names of one length are two pictures."""
    from matplotlib import font_manager

    if not {"Noto Sans CJK SC", "Noto Sans CJK JP"} & set(font_manager.get_font_names()):
        pytest.skip("no Chinese font here: apt-get install fonts-noto-cjk")
    pictures = []
    for name in ("东门", "西窗"):
        with sl.create(tmp_path / name, tz="UTC", clock=clock) as log:
            log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, name=name, at=HOUR_NS)
        plot_lanes(Lanes.of(sl.read(tmp_path / name)), tmp_path / f"{name}.png")
        pictures.append((tmp_path / f"{name}.png").read_bytes())

    assert pictures[0] != pictures[1]


def test_the_axis_is_true_where_clocks_are_turned_back(tmp_path: Path) -> None:
    """New York, 1 November 2026: one o'clock comes twice, and labels lie beside each other."""
    with sl.create(tmp_path / "log", tz="America/New_York", clock=SteadyClock(2 * 10**18)) as log:
        door = log.add_door(x=0, y=0, theta=0, width=1, at="2026-11-01T00:00")
        log.observe(door, "open", at="2026-11-01T03:00")

    figure = draw_lanes(Lanes.of(sl.read(tmp_path / "log")))
    figure.canvas.draw()

    shown = [label for label in figure.axes[0].get_xticklabels() if label.get_text()]
    again = "01:00 \N{MINUS SIGN}05:00"
    said = ["Sun 1 Nov", "00:30", "01:00", "01:30", again, "01:30", "02:00", "02:30", "03:00"]
    assert said == [label.get_text() for label in shown]
    start, end = figure.axes[0].get_xlim()
    at = (figure.axes[0].get_xticks() - start) / (end - start) * 240
    assert [30 * n for n in range(9)] == np.rint(at).tolist()
    edges = [edge for label in shown for edge in label.get_window_extent().intervalx]
    assert edges == sorted(edges)


def test_a_name_without_letters_gives_way_to_the_number(tmp_path: Path, clock: SteadyClock) -> None:
    """In a .png, of doors and of robots; an .svg keeps what it is told."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([PatrolStarted(patrol=1)], note=Note(actor="\U00013002"))
        for name in ("front", "\U00013000\U00013001", "Tür 2 🚪"):
            log.annotate(log.add_door(), "name", name)
        lanes = Lanes.of(log)

    png, svg = (
        [label.get_text() for label in draw_lanes(lanes, letters=letters).axes[0].get_yticklabels()]
        for letters in (letters_of(Path("x.png")), letters_of(Path("x.svg")))
    )

    assert ["rounds of robot 1", "front", "2"] == png[:3]
    assert png[3].startswith("Tür 2")
    assert ["rounds of \U00013002", "front", "\U00013000\U00013001", "Tür 2 🚪"] == svg
