"""Cases: how likely the doors of a recording are open now."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import semmap_log as sl
from benchmark.case import Case, Near, Peer, Work
from benchmark.peers import OURS
from semmap_log.analysis.beliefs.door_beliefs import DoorBelief, ask, belief, probabilities
from semmap_log.core.model.doors import DoorId

CLINIC = Path(__file__).resolve().parents[2] / "recordings" / "clinic_week"
EACH = 6
"""So many doors are told from one to the next, where each is asked for by itself."""
ROUNDS = 2


def clinic_case(rounds: int | None, *, most: int | None) -> Case:
    """Return: how likely the doors of a shipped recording are open now, from the log on disk.

    Args:
        rounds: Rounds that count; None: `ROUNDS`.
        most: So many of its doors; None: all.
    """
    doors = sorted(sl.read(CLINIC).replay().doors)[:most]
    few = doors[::EACH]
    alone = _of_forecasts(_each_alone(few))
    peers = (
        Peer(OURS, partial(_at_once, doors), Near(alone, 0.01)),
        Peer(f"{OURS}, one by one, 1/{EACH}", partial(_alone, few), Near(alone, 1e-9),
             len(few) / len(doors)),
    )  # fmt: skip
    title = f"Now, {len(doors)} doors of a clinic"
    return Case("beliefs", title, "ms", peers, rounds or ROUNDS)


def _at_once(doors: list[DoorId]) -> Work:
    return Work(
        lambda _: probabilities(sl.read(CLINIC), doors=doors),
        answer=lambda said: _of_forecasts(said[::EACH]),
    )


def _alone(doors: list[DoorId]) -> Work:
    return Work(lambda _: _each_alone(doors), answer=_of_forecasts)


def _each_alone(doors: list[DoorId]) -> list[DoorBelief]:
    asked = ask(sl.read(CLINIC), at=None, estimator="filter", tz=None, doors=doors)
    return [belief(asked, door) for door in asked.doors]


def _of_forecasts(said: list[DoorBelief]) -> tuple[float, ...]:
    return tuple(one.p_open for one in said)
