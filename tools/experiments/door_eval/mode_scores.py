"""The scores of one mode: of one evaluation, or of one a seed where the readings are random."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from door_eval.day_losses import LOSSES, DoorLosses
from door_eval.paired import Difference, difference, standard_error
from semmap_log.analysis.beliefs.evaluation import Evaluation
from semmap_log.interop.formats.json.evaluation_json import scores_to_json

Figures = Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class ModeScores:
    """What came of a mode."""

    evaluations: Sequence[Evaluation]
    """Of each seed; one where nothing is random."""
    losses: Mapping[str, Sequence[DoorLosses]]
    """Estimator -> of each of them."""

    @property
    def seeds(self) -> list[int]:
        """Of the readings; empty: nothing is random."""
        patrols = [evaluation.protocol.patrol for evaluation in self.evaluations]
        return [patrol.seed for patrol in patrols if patrol is not None]

    @property
    def figures(self) -> dict[str, Figures]:
        """Estimator -> its figures, means over the seeds."""
        return {name: _means(self._each(name)) for name in self.losses}

    def standard_error(self, name: str, figure: str) -> float | None:
        """Return that of a figure over the seeds; None: there are no two."""
        values = [found[figure] for found in self._each(name)]
        known = [value for value in values if value is not None]
        return standard_error(known) if len(known) > 1 else None

    def difference(self, ours: str, other: str, figure: str) -> Difference | None:
        """Return a figure of one estimator minus that of another; None: no forecasts."""
        return difference(self.losses[ours], self.losses[other], figure)

    def details(self, ours: str) -> dict[str, Any]:
        """Return all of it as a document.

        Args:
            ours: The estimator that is held against each other one.
        """
        return {
            "seeds": self.seeds,
            "doors": len(self.evaluations[0].doors),
            "estimators": {
                name: {
                    figure: {
                        "mean": value,
                        "standard_error": self.standard_error(name, figure),
                        "by_seed": [found[figure] for found in self._each(name)],
                    }
                    for figure, value in figures.items()
                }
                for name, figures in self.figures.items()
            },
            "under_test": ours,
            "differences": {
                other: {
                    figure: _document(self.difference(ours, other, figure)) for figure in LOSSES
                }
                for other in self.losses
                if other != ours
            },
        }

    def _each(self, name: str) -> list[Figures]:
        return [scores_to_json(evaluation.mean[name]) for evaluation in self.evaluations]


def _means(each: Sequence[Figures]) -> Figures:
    return {
        figure: None if each[0][figure] is None else float(np.mean([one[figure] for one in each]))
        for figure in each[0]
    }


def _document(found: Difference | None) -> dict[str, Any] | None:
    return None if found is None else asdict(found)
