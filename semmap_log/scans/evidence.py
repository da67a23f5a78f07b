"""What a visit has seen so far, as sums, and what they say at its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.scans.leaves import Leaves
from semmap_log.scans.likelihood import shift_log_weights
from semmap_log.scans.scan_model import ScanModel
from semmap_log.scans.visit import Visit


@dataclass(slots=True, kw_only=True)
class Evidence:
    """The sums of a visit that is still going on."""

    first_ns: int
    last_ns: int
    table: NDArray[np.float64]
    """(s, h): the sum of the log-likelihoods."""
    scans: int = 0
    looks: float = 0.0
    through: float = 0.0
    stopped: float = 0.0
    behind: float = 0.0
    """Sum over the looks that stopped: how far behind the line, m."""

    def judged(
        self, door_id: DoorId, leaves: Leaves, model: ScanModel, *, robot: str, laser: str
    ) -> Visit:
        """Return what the visit says."""
        weight = model.most_looks / (model.most_looks + self.looks)
        joint = self.table * weight + shift_log_weights()[:, None] + leaves.log_prior
        words = [_log_sum(joint[:, rows]) for rows in (leaves.open, leaves.ajar, leaves.shut)]
        total = _log_sum(joint)
        share = np.exp(joint - total).sum(0)
        p_open = float(1 / (1 + np.exp(np.clip(words[2] - words[0], -50, 50))))
        p_open = model.lapse / 2 + (1 - model.lapse) * p_open
        ajar = float(np.exp(words[1] - total))
        why = self._why(p_open, ajar, model)
        state = DoorState.UNKNOWN if why else DoorState.OPEN if p_open > 0.5 else DoorState.CLOSED
        return Visit(
            door_id=door_id,
            first_ns=self.first_ns,
            last_ns=self.last_ns,
            scans=self.scans,
            state=state,
            accuracy=max(p_open, 1 - p_open),
            opening=float(share @ leaves.clear),
            ajar=ajar,
            looks=self.looks,
            through=self.through,
            stopped=self.stopped,
            behind_m=self.behind / self.stopped if self.stopped else float("nan"),
            why=why,
            laser=laser,
            robot=robot,
            p_open=p_open,
        )

    def _why(self, p_open: float, ajar: float, model: ScanModel) -> str:
        """Return why the visit is undecided; empty: it is not."""
        if ajar > model.most_ajar:
            return "ajar"
        if max(p_open, 1 - p_open) < model.least_accuracy:
            return "as likely open as shut"
        if (self.through if p_open > 0.5 else self.stopped) < model.enough:
            return (
                "too few beams went through" if p_open > 0.5 else "too few beams ended on the line"
            )
        return ""


def _log_sum(values: NDArray[np.float64]) -> float:
    top = values.max()
    return float(top + np.log(np.exp(values - top).sum()))
