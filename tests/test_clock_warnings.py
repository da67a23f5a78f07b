"""Who asks about a span of time hears that the robot's clock was not set for some of it."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs import probabilities
from semmap_log.cli import main
from semmap_log.errors import ClockWarning
from semmap_log.views.report.content import report
from tests.conftest import SteadyClock

DAY_NS = 86_400 * 10**9
IN_1970, IN_1971, IN_2026, IN_2262 = 0, 400 * DAY_NS, 1_772_400_000 * 10**9, 292 * 365 * DAY_NS


def log_of(folder: Path, *begins_ns: int) -> sl.DoorLog:
    """Return a log of a door that is seen twice, by a clock that begins anew at some times."""
    clock = SteadyClock(begins_ns[0])
    with sl.create(folder, tz="UTC", clock=clock, compact=False) as log:
        front = log.add_door(name="front", x=1.0, y=1.0, theta=0.0, width=0.9)
        for begin_ns in begins_ns:
            clock.now_ns = max(clock.now_ns, begin_ns)
            for state in ("open", "closed"):
                log.observe(front, state, accuracy=0.9)
    return sl.read(folder)


@pytest.mark.parametrize(
    ("begins_ns", "expected"),
    [
        ((IN_1970, IN_2026), "4 events happened in 1970, before the robot's clock was set: "),
        ((IN_1970, IN_1971, IN_2026), "6 events happened in 1970 to 1971, before the robot's "),
        ((IN_2026, IN_2262), "2 events happened in 2261, where the robot's clock was wrong: "),
    ],
)
def test_events_of_a_wrong_clock_are_counted(
    tmp_path: Path, begins_ns: tuple[int, ...], expected: str
) -> None:
    """With the years that it said, and how to find the commits."""
    log = log_of(tmp_path / "log", *begins_ns)

    with pytest.warns(ClockWarning) as told:
        probabilities(log)

    (text,) = (str(each.message) for each in told)
    assert text.startswith(expected)
    assert text.endswith(f"semmap-log info {log.path}")


def test_it_is_said_once_for_a_log(tmp_path: Path) -> None:
    """Whatever is asked: a report asks for beliefs, too."""
    log = log_of(tmp_path / "log", IN_1970, IN_2026)

    with pytest.warns(ClockWarning) as told:  # noqa: PT031 - over all of it
        report(log)
        log.timeline("front")

    assert 1 == len(told)


@pytest.mark.parametrize("begins_ns", [(IN_2026,), (IN_1970,), (IN_1970, IN_1971), (IN_2262,)])
def test_nothing_is_said_of_times_that_fit_together(
    tmp_path: Path, begins_ns: tuple[int, ...]
) -> None:
    """Nor where all are of a clock that was never set: no span of time is too long."""
    log = log_of(tmp_path / "log", *begins_ns)

    with warnings.catch_warnings():
        warnings.simplefilter("error", ClockWarning)
        probabilities(log)


def test_nothing_is_said_of_a_span_that_begins_later(tmp_path: Path) -> None:
    """Who asks from 2026 on has seen to it."""
    log = log_of(tmp_path / "log", IN_1970, IN_2026)

    with warnings.catch_warnings():
        warnings.simplefilter("error", ClockWarning)
        log.timeline("front", since="2026-01-01")
    with pytest.warns(ClockWarning):
        log.timeline("front", since="1970-01-01")


@pytest.mark.parametrize(
    ("verb", "is_told"),
    [
        (("probabilities",), True), (("timeline", "front"), True), (("best-time", "front"), True),
        (("why", "front"), True), (("report", "OUT.html"), True), (("export", "OUT.mcap"), True),
        (("export", "OUT.html"), True), (("costmap", "OUT.mcap"), True),
        (("replay",), False), (("history",), False), (("tail",), False), (("info",), False),
        (("export", "OUT.jsonl"), False), (("diff", "event:0", "now"), False),
    ],
)  # fmt: skip
def test_verbs_that_answer_about_a_span_say_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: tuple[str, ...], is_told: bool
) -> None:
    """On stderr; a list of events shows itself when they happened."""
    log_of(tmp_path / "log", IN_1970, IN_2026)
    name, *rest = (part.replace("OUT", f"{tmp_path}/out") for part in verb)

    with pytest.raises(SystemExit) as left:
        main([name, str(tmp_path / "log"), *rest])

    said = capsys.readouterr().err
    assert 0 == left.value.code, said
    assert is_told == ("4 events happened in 1970" in said)
