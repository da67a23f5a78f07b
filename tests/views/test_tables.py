"""Tables for people, as they come out of a pipe."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
from rich.console import Console, RenderableType

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    LevelAdded,
    Retracted,
)
from semmap_log.views.tables import (
    age,
    diff_table,
    door_table,
    entry_table,
    history_pages,
    history_table,
    summary_table,
)
from tests.conftest import SteadyClock
from tests.golden_text import GoldenText
from tests.views.rerun.some_logs import SECOND, START, restless_log, small_log

NOW_NS = START + 7200 * SECOND


def printed(*tables: RenderableType, width: int = 80) -> str:
    """What a pipe gets: no colours."""
    out = io.StringIO()
    console = Console(file=out, width=width, highlight=False)
    for table in tables:
        console.print(table)
    return "\n".join(line.rstrip() for line in out.getvalue().splitlines())


def test_the_door_table(tmp_path: Path, golden: GoldenText) -> None:
    """Ids ascending, three decimals, a dash for what is not known, the age of each state."""
    log = small_log(tmp_path / "log")

    golden("replay", "doors", printed(door_table(log.replay(at=START + 900 * SECOND), tz="UTC")))


def test_columns_that_no_door_fills_are_left_out(tmp_path: Path, golden: GoldenText) -> None:
    """Sensors without a place and without names have a state, and how old it is."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=DoorId(7), state=DoorState.OFFLINE)])

    text = printed(door_table(sl.read(tmp_path / "log").replay(), tz="UTC"))

    golden("replay", "a sensor without a place", text)


def test_a_long_name_goes_on_in_the_next_line(tmp_path: Path) -> None:
    """Nothing is cut off at 80 columns, and square brackets are just characters."""
    name = "L1_left_consult_rm_13_outer [blue]"
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([LevelAdded(level=1, name="first floor")])
        log.append([
            DoorAdded(door_id=DoorId(123), level=1, x=-15.25, y=-41.5, theta=-2.25, width=1.25,
                      prob_open=0.5, prob_closed=0.5),
            DoorAnnotated(door_id=DoorId(123), key="name", value=name),
        ])  # fmt: skip

    text = printed(door_table(sl.read(tmp_path / "log").replay(), tz="UTC"))

    assert name.replace(" ", "") in "".join(line[4:19] for line in text.splitlines()).replace(
        " ", ""
    )
    assert max(len(line) for line in text.splitlines()) <= 80


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [(0, "0 s"), (-5, "0 s"), (119, "119 s"), (120, "2 min"), (7_199, "119 min"), (7_200, "2 h"),
     (2 * 86_400, "2 d"), (700 * 86_400, "700 d"), (730 * 86_400, "2 y")],
)  # fmt: skip
def test_age_is_told_in_the_largest_unit_that_fits_twice(seconds: int, expected: str) -> None:
    """`119 min` says more than `1 h`."""
    assert expected == age(START, START + seconds * SECOND)


def test_an_age_that_nobody_knows_is_a_dash() -> None:
    """A door whose state was never told."""
    assert "-" == age(None, NOW_NS)


def test_the_history_table(tmp_path: Path, golden: GoldenText) -> None:
    """Number, local time, door, what, who and why; late events and undone ones say so."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="Europe/Vienna", clock=clock) as log:
        log.append(
            [DoorAdded(door_id=DoorId(1))], note=sl.Note(actor="survey", reason="first plan")
        )
        log.append([
            DoorObserved(door_id=DoorId(1), state=DoorState.OPEN, accuracy_open=0.9,
                         accuracy_closed=0.9, happened_ns=START - 7200 * SECOND),
        ])  # fmt: skip
        log.append([Retracted(first_event=1, last_event=1)], note=sl.Note(actor="anna"))
    opened = sl.read(tmp_path / "log")

    names = {DoorId(1): "a \x1b[2J"}
    text = printed(history_table(opened.history(), tz=opened.info.timezone, names=names))

    golden("history", "late and taken back", text)


def test_a_history_tells_apart_what_the_clocks_show_twice(tmp_path: Path) -> None:
    """In the hour that comes twice a time has its offset below; elsewhere none."""
    with sl.create(tmp_path / "log", tz="Europe/Vienna") as log:
        door = log.add_door(name="front", at="2025-10-26T01:30")
        for offset in ("+02:00", "+01:00"):
            log.observe(door, "open", at=f"2025-10-26T02:30:00{offset}")

    text = printed(history_table(sl.read(tmp_path / "log").history(), tz="Europe/Vienna"))
    times = [line[7:17].strip() for line in text.splitlines()[1:]]

    day, *clocks = [time for time in times if time]
    assert "2025-10-26" == day
    assert ["02:30:00", "+02:00", "02:30:00", "+01:00"] == clocks[-4:]
    assert {"01:30:00"} == set(clocks[:-4])


@pytest.mark.slow
def test_pages_of_a_long_history_line_up(tmp_path: Path) -> None:
    """Printed one by one, as a long history must be, they are the table; one head for all."""
    log = restless_log(tmp_path / "log", seed=1, events=1100)

    pages = list(history_pages(log.history(), tz="UTC"))

    assert 3 == len(pages)
    assert printed(*pages) == printed(history_table(log.history(), tz="UTC"))
    assert 1 == printed(*pages).count("who: why")


def test_the_diff_table(tmp_path: Path, golden: GoldenText) -> None:
    """Doors added, removed, and each field that is another; then the events, without poses."""
    log = small_log(tmp_path / "log")

    for case, seconds in (("of some minutes", 2000), ("no difference", 61)):
        found = log.diff(START + 60 * SECOND, START + seconds * SECOND)
        golden("diff", case, printed(diff_table(found, tz="UTC")))


def test_one_event_with_all_that_is_known(tmp_path: Path) -> None:
    """Its fields, times, note and command id."""
    log = small_log(tmp_path / "log")

    text = printed(entry_table(log.entry(1), tz="UTC"))

    for line in ("kind         DoorAdded", "state        CLOSED", "width        1.000",
                 "happened     2026-03-01 21:20:00", "reason       first plan"):  # fmt: skip
        assert line in text


def test_the_summary_table(tmp_path: Path) -> None:
    """Doors, events by kind, spans, size, the hash to keep elsewhere."""
    log = small_log(tmp_path / "log")
    summary = log.summary()

    text = printed(summary_table(summary))

    assert "robot       rover" in text
    assert "doors       1" in text
    assert "                   10 RobotPose" in text
    assert "durability  event 19" in text
    assert f"head        {summary.head.hex()}" in text


def test_colours_are_for_terminals(tmp_path: Path) -> None:
    """A terminal gets green and red; a pipe gets plain text."""
    table = door_table(small_log(tmp_path / "log").replay(), tz="UTC")
    out = io.StringIO()

    Console(file=out, width=80, force_terminal=True, color_system="standard").print(table)

    assert "\x1b[31mCLOSED" in out.getvalue()
    assert "\x1b" not in printed(table)


def test_history_shows_what_was_before(tmp_path: Path, golden: GoldenText) -> None:
    """One field: its value; several: each with its name; nothing where nothing was, or changed."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(x=0, y=0, theta=0, width=0.9, state="closed")
        log.observe(door, "closed")
        log.observe(door, "open")
        log.update_door(door, width=0.8)
        log.update_door(door, state="closed", prob_open=0.25)
        log.update_door(door, state="open", prob_open=0.5)

    text = printed(history_table(sl.read(tmp_path / "log").history(door), tz="UTC"), width=200)

    rows = [line for line in text.splitlines() if " 1  " in line]
    what = [re.sub(r".* 1 {2,}", "", line).strip() for line in rows]
    golden("history", "what was before", "\n".join(what))
