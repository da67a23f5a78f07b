"""Runs by what they are of: building, series, setup, and the option that was swept."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from navigation.options import RunOptions
from navigation.records import RunError
from navigation.setups import SETUPS
from navigation.tables.figures import RunFigures

SERIES = ("fixed", "random")
"""In the order in which they are told; others come behind."""

USUAL = asdict(RunOptions())
"""What `run` takes without being told."""


def title_of(setup: str) -> str:
    """Return what people call a setup; an unknown one by its own name."""
    return SETUPS[setup].title if setup in SETUPS else setup


def has_map(setup: str) -> bool:
    """Return whether the robot has a map of doors in that setup; an unknown one has."""
    return setup not in SETUPS or SETUPS[setup].map


class GroupedRuns:
    """Runs to choose from. An option was swept if runs of one building and setup differ in it."""

    def __init__(self, figures: Sequence[RunFigures]) -> None:
        """Take runs.

        Raises:
            RunError: One is there twice.
        """
        self.all = sorted(figures, key=lambda run: (run.key, _text(run.options)))
        for one, other in zip(self.all, self.all[1:], strict=False):
            if (one.key, one.options) == (other.key, other.options):
                raise RunError(f"{one.key}: this run is there twice; give each folder once.")
        self.swept = {name: _swept(runs) for name, runs in self._by_building().items()}
        """Building -> option that was swept -> its values, each as JSON, the usual one first."""

    def _by_building(self) -> dict[str, list[RunFigures]]:
        found: dict[str, list[RunFigures]] = defaultdict(list)
        for run in self.all:
            found[run.building].append(run)
        return found

    @property
    def buildings(self) -> list[str]:
        """Their names."""
        return sorted({run.building for run in self.all})

    def series(self, building: str) -> list[str]:
        """Return the series that there are of a building, those with the usual options first."""
        found = {run.key.series for run in self.all if run.building == building}
        return sorted(
            found, key=lambda name: (not self.by_setup(building, name), _place(SERIES, name), name)
        )

    def setups(self, building: str, series: str) -> list[str]:
        """Return the setups that there are, the thesis's first."""
        found = {r.key.setup for r in self.all if (r.building, r.key.series) == (building, series)}
        return sorted(found, key=lambda name: (_place(list(SETUPS), name), name))

    def by_setup(self, building: str, series: str) -> dict[str, list[RunFigures]]:
        """Return the runs of each setup, with the usual options."""
        found = {name: self.of(building, series, name) for name in self.setups(building, series)}
        return {name: runs for name, runs in found.items() if runs}

    def of(
        self, building: str, series: str, setup: str, *, but: tuple[str, str] | None = None
    ) -> list[RunFigures]:
        """Return runs by ascending seed, each swept option at its usual value.

        Args:
            building: Of which building.
            series: Of which series.
            setup: Of which setup.
            but: An option, and its value as JSON in place of the usual one.
        """
        wanted = {name: values[0] for name, values in self.swept[building].items()}
        wanted |= dict([but] if but else [])
        return [
            run for run in self.all
            if (run.building, run.key.series, run.key.setup) == (building, series, setup)
            and all(_value(run, name) == value for name, value in wanted.items())
        ]  # fmt: skip

    def beside_usual(
        self, building: str, series: str, setup: str, but: tuple[str, str]
    ) -> tuple[list[RunFigures], list[RunFigures]]:
        """Return runs with another value of an option, and those with the usual one beside them.

        In the series `fixed` these are of the same seeds: a seed in which the robot was locked in
        would else look like what the option does.
        """
        others = self.of(building, series, setup, but=but)
        usual = self.of(building, series, setup)
        if series != "fixed":
            return others, usual
        shared = {run.key.seed for run in others} & {run.key.seed for run in usual}
        others, usual = (
            [run for run in found if run.key.seed in shared] for found in (others, usual)
        )
        return others, usual


def _swept(runs: Sequence[RunFigures]) -> dict[str, list[str]]:
    """Return the options in which runs of one setup differ, and their values, the usual first.

    Usual is what most runs have, of all swept options together; of equally many, what `run` does
    without being told.
    """
    options = sorted({name for run in runs for name in run.options})
    within: dict[tuple[str, str], set[str]] = defaultdict(set)
    for run in runs:
        for name in options:
            within[name, run.key.setup].add(_value(run, name))
    names = sorted({name for (name, _), found in within.items() if len(found) > 1})
    counts = Counter(tuple(_value(run, name) for name in names) for run in runs)
    plain = tuple(_text(USUAL.get(name)) for name in names)
    usual = min(counts, key=lambda values: (-counts[values], values != plain, values))
    return {
        name: [usual[place], *sorted({v[place] for v in counts} - {usual[place]}, key=by_value)]
        for place, name in enumerate(names)
    }


def by_value(text: str) -> tuple[bool, float, str]:
    """Return by what values of an option, as JSON, are put in order: numbers first."""
    value = json.loads(text)
    is_number = isinstance(value, int | float)
    return not is_number, float(value) if is_number else 0.0, text


def value_said(text: str) -> str:
    """Return an option's value, given as JSON, as people write it."""
    value = json.loads(text)
    return value if isinstance(value, str) else text


def _value(run: RunFigures, option: str) -> str:
    """Return an option's value as JSON; a run that is older than the option had the usual one."""
    return _text(run.options.get(option, USUAL.get(option)))


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)


def _place(names: Sequence[str], name: str) -> int:
    return names.index(name) if name in names else len(names)
