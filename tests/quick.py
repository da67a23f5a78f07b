"""Which tests a plain `pytest` runs, and which only `pytest --all`.

A plain run leaves out

- what `slow_tests.txt` lists: each took more than `LIMIT_S` of CPU time when it was measured;
- the tests of experiments, in `tools/experiments`: they run where they are named, too;
- what is marked `slow`, or has a fixture that is: a real ROS, packages from npm, later versions;
- most examples of a property that does not say how many it wants.

`--long` runs what a plain run leaves out: the two together are `--all`. Tests that are named by
their id, or chosen by a marker (`-m`), are never left out.

`--measure` rewrites the lines of the list that concern the tests that ran. It loads all modules
first, so that no test pays for another's imports, and shares the cost of a fixture of a module or
a session among the tests that use it.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings

LIMIT_S = 0.25
"""CPU time of a quick test, its own processes included, in seconds."""
LEAVES_S = 0.2
"""A test that is listed leaves the list below this one, so that no noise moves it."""
LIST = Path(__file__).with_name("slow_tests.txt")
LISTED = frozenset(LIST.read_text().split("\n"))
"""Ids of tests, or of functions, where all their cases are slow."""

EXPERIMENTS = "tools/experiments"
QUICK_EXAMPLES = 20
SLOW_FIXTURES = {"ros", "ros1", "every_ros", "jazzy", "kilted", "node_packages", "newer"}

HEAVY = (
    "rerun", "pyarrow.parquet", "pandas", "polars", "duckdb", "matplotlib.pyplot", "PIL.Image",
    "scipy.optimize", "distributed", "moto.server", "cryptography.x509", "mcap_ros2.decoder",
    "rosbags.highlevel", "nbclient", "rich.table", "pydantic", "obstore", "py_trees",
)  # fmt: skip
"""What takes long to import, and is imported by those tests alone that need it."""

_STEADY = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True)
settings.register_profile("steady", _STEADY)
"""The same examples at each run, however slow the machine is; for others, some day:
`pytest --all --hypothesis-profile default`."""
settings.register_profile("quick", _STEADY, max_examples=QUICK_EXAMPLES)

_LEFT_OUT = pytest.StashKey[int]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("semmap-log")
    group.addoption("--all", action="store_true", help="run every test, the slow ones too")
    group.addoption("--long", action="store_true", help="run only what a plain run leaves out")
    group.addoption("--measure", action="store_true", help="rewrite the list of slow tests")
    group.addoption("--golden", action="store_true", help="rewrite golden files of wordings")


def pytest_configure(config: pytest.Config) -> None:
    is_quick = _is_quick(config) or config.option.measure
    settings.load_profile("quick" if is_quick else "steady")
    if config.option.measure:
        _load_all()
        config.pluginmanager.register(Costs(), "costs")

    is_whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    if is_whole and (config.option.all or config.option.long):
        config.args.append(EXPERIMENTS)


def _is_quick(config: pytest.Config) -> bool:
    is_asked_for = config.option.markexpr or any("::" in each for each in config.args)
    return not (config.option.all or config.option.long or is_asked_for)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is long, or what is not."""
    if not (_is_quick(config) or config.option.long):
        return
    if config.option.long:
        chosen = [item for item in items if _is_long(item)]
    else:
        chosen = [item for item in items if not is_slow(item)]
    left_out = set(items).difference(chosen)
    config.stash[_LEFT_OUT] = len(left_out)
    config.hook.pytest_deselected(items=list(left_out))
    items[:] = chosen


def is_slow(item: pytest.Item) -> bool:
    """Return whether a plain run leaves a test out."""
    fixtures = getattr(item, "fixturenames", ())
    if not LISTED.isdisjoint((item.nodeid, _function(item.nodeid))):
        return True
    return item.get_closest_marker("slow") is not None or not SLOW_FIXTURES.isdisjoint(fixtures)


def _is_long(item: pytest.Item) -> bool:
    """Return whether `--long` runs a test."""
    return is_slow(item) or _has_examples(item) or item.nodeid.startswith(f"{EXPERIMENTS}/")


def _has_examples(item: pytest.Item) -> bool:
    """Return whether a plain run tries fewer examples."""
    return is_hypothesis_test(getattr(item, "obj", None))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Tell the process that others run tests for how many were left out."""
    output: dict[str, Any] | None = getattr(session.config, "workeroutput", None)
    if output is not None:
        output["left_out"] = session.config.stash.get(_LEFT_OUT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Hear from a worker of pytest-xdist how many it left out; all leave out the same."""
    node.config.stash[_LEFT_OUT] = getattr(node, "workeroutput", {}).get("left_out", 0)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    config = terminalreporter.config
    left_out = config.stash.get(_LEFT_OUT, 0)
    if left_out and not config.option.long:
        terminalreporter.write_line(f"{left_out} long tests left out: pytest --all runs them, too")


class Costs:
    """Measures the CPU time of tests, and rewrites the list of slow ones from it."""

    def __init__(self) -> None:
        self._own: dict[str, float] = {}
        """Id of a test -> seconds, without the fixtures that it shares."""
        self._fixtures: defaultdict[str, float] = defaultdict(float)
        """Name of a shared fixture -> seconds."""
        self._users: defaultdict[str, set[str]] = defaultdict(set)
        """Name of a shared fixture -> ids of the tests that use it."""
        self._shared_s = 0.0

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        """Measure a fixture that lives longer than one test."""
        before = _cpu_s()
        try:
            return (yield)
        finally:
            if fixturedef.scope != "function":
                name, took = f"{fixturedef.baseid}::{fixturedef.argname}", _cpu_s() - before
                self._fixtures[name] += took
                self._shared_s += took

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Measure a test."""
        before, shared_before = _cpu_s(), self._shared_s
        try:
            return (yield)
        finally:
            shared = self._shared_s - shared_before
            item.user_properties.append(("cpu_s", _cpu_s() - before - shared))
            self._own[item.nodeid] = _cpu_s() - before - shared
            for name, definitions in item._fixtureinfo.name2fixturedefs.items():  # type: ignore[attr-defined]
                if definitions[-1].scope != "function":
                    self._users[f"{definitions[-1].baseid}::{name}"].add(item.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Rewrite the lines of the list that concern the tests that ran."""
        costs = self._own
        for name, took in self._fixtures.items():
            for user in self._users[name]:
                costs[user] += took / len(self._users[name])
        slow = {
            test for test, took in costs.items()
            if took > (LEAVES_S if {test, _function(test)} & LISTED else LIMIT_S)
        }  # fmt: skip
        kept = {line for line in LISTED if line and line not in costs}
        ran, slow_ones = Counter(map(_function, costs)), Counter(map(_function, slow))
        whole = {name for name, number in slow_ones.items() if number == ran[name] > 1}
        kept -= {name for name in ran if name not in whole}
        lines = kept | whole | {test for test in slow if _function(test) not in whole}
        LIST.write_text("".join(f"{line}\n" for line in sorted(lines)))


def _function(test: str) -> str:
    return test.partition("[")[0]


def _cpu_s() -> float:
    """Return the CPU time of this process and of those that it has waited for."""
    return sum(os.times()[:4])


def _load_all() -> None:
    """Import all of ours, and what it imports at its edges."""
    import semmap_log

    for module in pkgutil.walk_packages(semmap_log.__path__, "semmap_log."):
        with suppress(ImportError):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)
    for name in HEAVY:
        with suppress(ImportError):
            importlib.import_module(name)
