"""The figures of one run, as the thesis's GoalSender kept them (E.1), and a few of ours."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from navigation.records import Outcome, RunError, RunKey
from navigation.runs import Run, read_run
from navigation.wrong_beliefs import wrong_share
from semmap_log.core.model.events import DoorObserved


@dataclass(frozen=True)
class RunFigures:
    """What a run came to."""

    key: RunKey
    options: Mapping[str, Any]
    """What it was made with, beside its key."""
    took_s: tuple[float, ...]
    """Time to reach each goal that was reached, in their order."""
    total_s: float
    """From the first goal's start to the last one's end."""
    tried: int
    unreachable: int
    """Goals that could not be reached."""
    after_driving: int
    """Those of them that were given up too late to have been planned as unreachable."""
    on_the_spot: int
    """Those of these for which the robot made no step: it stood before the shut door already."""
    in_vain_s: float
    """Time spent on these."""
    path_m: float
    """Driven; NaN: the run does not tell."""
    wrong: float
    """Mean share of doors that the map had wrong."""
    told: int
    """Sightings that the map got."""
    folder: Path = field(default=Path(), compare=False, repr=False)
    """Where its logs are."""

    @property
    def building(self) -> str:
        """Its name, without what was not as usual: `clinic_L1` of `clinic_L1,near_m=1.0`."""
        return self.key.building.partition(",")[0]

    @property
    def reached(self) -> int:
        """The number of goals that were reached."""
        return len(self.took_s)

    @property
    def for_goals_s(self) -> float:
        """The total time spent reaching goals."""
        return math.fsum(self.took_s)

    @property
    def average_s(self) -> float:
        """To reach a goal; NaN: none was."""
        return self.for_goals_s / self.reached if self.took_s else math.nan

    @property
    def fastest_s(self) -> float:
        """To reach a goal; NaN: none was."""
        return min(self.took_s, default=math.nan)

    @property
    def slowest_s(self) -> float:
        """To reach a goal; NaN: none was."""
        return max(self.took_s, default=math.nan)

    @property
    def share(self) -> float:
        """Of the goals tried, those unreachable after driving."""
        return self.after_driving / self.tried


def figures_in(folder: Path) -> RunFigures:
    """Return the figures of the run that lies in a folder.

    Raises:
        RunError: Its logs are not those of a run, or no goal ended in it.
        SemmapError: They cannot be read.
    """
    return figures_of(read_run(folder))


def figures_of(run: Run) -> RunFigures:
    """Return the figures of a run.

    Raises:
        RunError: No goal ended in it.
    """
    goals = [goal for goal in run.goals if goal.outcome is not Outcome.UNFINISHED]
    if not goals:
        raise RunError(f"{run.folder}: no goal ended in this run.")
    ends = Counter(goal.outcome for goal in goals)
    in_vain = [goal for goal in goals if goal.outcome is Outcome.AFTER_DRIVING]
    key_names = set(RunKey.__dataclass_fields__)
    return RunFigures(
        key=run.key,
        options={name: v for name, v in run.parameters.items() if name not in key_names},
        took_s=tuple(goal.took_s for goal in goals if goal.outcome is Outcome.REACHED),
        total_s=(run.end_ns - run.begin_ns) / 1e9,
        tried=len(goals),
        unreachable=len(goals) - ends[Outcome.REACHED],
        after_driving=ends[Outcome.AFTER_DRIVING],
        on_the_spot=sum(goal.figures.get("path_m") == 0 for goal in in_vain),
        in_vain_s=math.fsum(goal.took_s for goal in in_vain),
        path_m=math.fsum(goal.figures.get("path_m", math.nan) for goal in goals),
        wrong=wrong_share(run),
        told=sum(map(len, run.belief.batches(kinds=[DoorObserved]))),
        folder=run.folder,
    )
