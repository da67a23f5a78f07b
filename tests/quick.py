"""Which tests a plain `pytest` runs, in some minutes, and which only `pytest --all`.

A plain run meets every room, and leaves out

- what is marked `slow`, or has a fixture that is: a real ROS, packages from npm, later versions;
- most examples of a property that does not say how many it wants.

`--long` runs what a plain run leaves out: the two together are `--all`. Tests that are named by
their id, or chosen by a marker (`-m`), are never left out.
"""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings

QUICK_EXAMPLES = 20
SLOW_FIXTURES = {"ros", "ros1", "ros_1_or_2", "jazzy", "kilted", "node_packages", "newer"}

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


def pytest_configure(config: pytest.Config) -> None:
    settings.load_profile("quick" if _is_quick(config) else "steady")


def _is_quick(config: pytest.Config) -> bool:
    is_asked_for = config.option.markexpr or any("::" in each for each in config.args)
    return not (config.option.all or config.option.long or is_asked_for)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is long, or what is not."""
    if not (_is_quick(config) or config.option.long):
        return
    if config.option.long:
        chosen = [item for item in items if is_slow(item) or _has_examples(item)]
    else:
        chosen = [item for item in items if not is_slow(item)]
    left_out = set(items).difference(chosen)
    config.stash[_LEFT_OUT] = len(left_out)
    config.hook.pytest_deselected(items=list(left_out))
    items[:] = chosen


def is_slow(item: pytest.Item) -> bool:
    """Return whether a plain run leaves a test out."""
    fixtures = getattr(item, "fixturenames", ())
    return item.get_closest_marker("slow") is not None or not SLOW_FIXTURES.isdisjoint(fixtures)


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
