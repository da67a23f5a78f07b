"""What the sums of a visit say in the end."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.leaves import Leaves
from semmap_log.analysis.scans.visit import ScanModel
from semmap_log.analysis.scans.visit_sums import VisitSums
from semmap_log.core.model.doors import DoorState

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The posterior in a few numbers, and the word that they allow."""

    p_open: float
    """P(open | open or shut), both alike before."""
    ajar: float
    opening: float
    likeliest: int
    """Which stand of the leaves."""
    why: str
    """Why it is undecided; empty: it is not."""

    @property
    def state(self) -> DoorState:
        """OPEN, CLOSED, or UNKNOWN where it is undecided."""
        if self.why:
            return DoorState.UNKNOWN
        return DoorState.OPEN if self.p_open > 0.5 else DoorState.CLOSED

    @classmethod
    def of(cls, sums: VisitSums, leaves: Leaves, model: ScanModel, *, is_glass: bool) -> Verdict:
        """Return the verdict on a visit."""
        joint = sums.joint(leaves, model)
        total = _log_sum(joint)
        log_open, log_shut = _log_sum(joint[:, leaves.open]), _log_sum(joint[:, leaves.shut])
        ratio = np.clip(log_open - log_shut, -50, 50)
        p_open = float(model.lapse / 2 + (1 - model.lapse) / (1 + np.exp(-ratio)))
        share = np.exp(joint - total)
        ajar = float(share[:, leaves.ajar].sum())
        by_stand = share.sum(0)
        return cls(
            p_open=p_open,
            ajar=ajar,
            opening=float(np.clip(by_stand @ leaves.clear, 0, 1)),
            likeliest=int(by_stand.argmax()),
            why=_why(
                p_open, ajar, _Looks.of(sums, share, leaves, p_open), model, is_glass=is_glass
            ),
        )


@dataclass(frozen=True, slots=True)
class _Looks:
    """Looks through the line, on it, deep beyond it; with the laser's shift under the verdict."""

    through: float
    stopped: float
    deep: float
    hidden: float
    """Share of the looks towards the door that ended well before it."""

    @classmethod
    def of(cls, sums: VisitSums, share: Floats, leaves: Leaves, p_open: float) -> _Looks:
        by_shift = share[:, leaves.open if p_open > 0.5 else leaves.shut].sum(1)
        by_shift /= max(float(by_shift.sum()), np.finfo(float).tiny)
        through, stopped, deep = (
            float(by_shift @ looks) for looks in (sums.through, sums.stopped, sums.deep)
        )
        hidden = sums.hidden / max(sums.hidden + sums.looks, 1e-9)
        return cls(through, stopped, deep, hidden)


def _why(p_open: float, ajar: float, looks: _Looks, model: ScanModel, *, is_glass: bool) -> str:
    """Return why there is no verdict; empty: there is one.

    No OPEN without beams that went through, no CLOSED without beams that ended on the line, or with
    many that ended deep in the room beyond it (unless the door is of glass).
    """
    is_open = p_open > 0.5
    if ajar > (model.most_ajar_open if is_open else model.most_ajar_shut):
        return "it may be ajar"
    if max(p_open, 1 - p_open) < model.least_accuracy:
        return "open and shut are nearly as likely"
    if looks.hidden > model.most_hidden:
        return "something before it hides it"
    if is_open and looks.through < model.enough:
        return "too few beams went through"
    if not is_open and looks.stopped < model.enough:
        return "too few beams ended on the line"
    if not is_open and not is_glass and looks.deep > model.most_deep * looks.stopped:
        return "some beams ended on the line, others went through"
    return ""


def behind_m(sums: VisitSums) -> float:
    """Return how far beyond the line beams near it ended, on average, m; NaN: none did."""
    return sums.behind / sums.near if sums.near else nan


def _log_sum(values: Floats) -> float:
    top = float(values.max())
    return top + float(np.log(np.exp(values - top).sum()))
