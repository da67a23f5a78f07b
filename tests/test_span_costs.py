"""An answer costs what its events take, not the years that lie between them."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from tests.conftest import SteadyClock

DAY_NS = 86_400 * 10**9
IN_1970, IN_2026, IN_2261 = 0, 1_772_409_600 * 10**9, 291 * 365 * DAY_NS
MORE_BYTES = 120 * 2**20
"""So much more than the process has anyhow; a row for each day of 56 years, of a door, is more."""
MOST_S = 20
"""Of a processor: many times what it takes."""
LOG, OUT = "{log}", "{out}"


def log_of(folder: Path, *begins_ns: int, step_ns: int = DAY_NS) -> Path:
    """Return a log of two doors that are set and seen for three days, by a clock that jumps."""
    clock = SteadyClock(begins_ns[0])
    with sl.create(folder, tz="Europe/Vienna", clock=clock, compact=False) as log:
        doors = [log.add_door(x=x, y=0.0, theta=0.0, width=0.9, state="open") for x in (0.0, 3.0)]
        for begin_ns in begins_ns:
            for day in range(3):
                clock.now_ns = max(clock.now_ns, begin_ns + day * step_ns)
                log.update_door(doors[0], state=("open", "closed")[day % 2])
                log.observe(doors[1], ("closed", "open")[day % 2], accuracy=0.9)
    return folder


LOGS: dict[str, Callable[[Path], Path]] = {
    "at 1970 first": lambda folder: log_of(folder, IN_1970, IN_2026),
    "at 2261 then": lambda folder: log_of(folder, IN_2026, IN_2261),
    "every ten years": lambda folder: log_of(folder, IN_1970, IN_2026, step_ns=3650 * DAY_NS),
}
VERBS = (
    ("probabilities", LOG), ("probabilities", LOG, "--by", "week"),
    ("probabilities", LOG, "--estimator", "count"), ("probabilities", LOG, "--horizon", "60d"),
    ("best-time", LOG, "1"), ("why", LOG, "2"), ("patrol-plan", LOG, "--from", "0,1"),
    ("go", LOG, "0,1", "2"), ("report", LOG, f"{OUT}/page.html"), ("timeline", LOG, "1"),
    ("info", LOG, "--all-doors"), ("export", LOG, f"{OUT}/bag.mcap"),
    ("costmap", LOG, f"{OUT}/costs.mcap", "--by", "belief"),
)  # fmt: skip
AS_ROS = VERBS[-2:]
OTHERS = (
    ("view", LOG, "--save", f"{OUT}/view.rrd"), ("history", LOG, "--plot", f"{OUT}/lanes.svg"),
    ("probabilities", LOG, "--plot", f"{OUT}/weeks.svg"), ("evaluate", LOG, "--step", "600"),
    ("evaluate", LOG, "--step", "600", "--prequential"), ("sql", LOG, "from beliefs('now')"),
    ("sql", LOG, "from intervals"), ("export", LOG, f"{OUT}/table.parquet"),
)  # fmt: skip
"""They load more, or take longer."""


@pytest.mark.parametrize("log", LOGS)
@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_memory_goes_by_events(verb: tuple[str, ...], log: str, tmp_path: Path) -> None:
    """Whatever the clock said before, or says after."""
    is_told = verb in AS_ROS and log != "at 1970 first"  # in ROS time ends in 2038
    assert int(is_told) == ended(verb, LOGS[log](tmp_path / "log"), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("log", LOGS)
@pytest.mark.parametrize("verb", OTHERS, ids=" ".join)
def test_memory_of_what_loads_more_goes_by_events(
    verb: tuple[str, ...], log: str, tmp_path: Path
) -> None:
    """With room for what a verb imports. Of three days there may be nothing to evaluate."""
    code = ended(verb, LOGS[log](tmp_path / "log"), tmp_path, 10 * MORE_BYTES)

    assert code == 0 or (verb[0] == "evaluate" and code == 1)


def ended(verb: tuple[str, ...], log: Path, out: Path, more_bytes: int = MORE_BYTES) -> int:
    """Return the exit code of a verb in a process of little memory and time."""
    child = os.fork()
    if child == 0:
        _run([part.replace(LOG, str(log)).replace(OUT, str(out)) for part in verb], more_bytes)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status)


def _run(arguments: list[str], more_bytes: int) -> None:
    code = 99
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + more_bytes
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_S, MOST_S))
        main(arguments)
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else 98
    finally:
        os._exit(code)
