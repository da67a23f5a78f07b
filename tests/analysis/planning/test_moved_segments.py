"""What a move of a piece of an order is said to cost, against the order that it makes."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.planning.best_order import _kinds, _Pieces, _Round
from tests.analysis.planning.rounds import a_round, plain_cost


@pytest.mark.parametrize("seed", range(3))
def test_each_move_costs_what_its_order_costs(seed: int) -> None:
    """Turned round, moved, or both; a way back does not take as long as there."""
    task = a_round(seed, 7)
    start = np.random.default_rng(seed).permutation(7)
    round_ = _Round.of(task)
    pieces = _Pieces.of(round_, np.concatenate([[round_.start], start, [round_.end]]))
    made = 0

    assert pieces.cost == pytest.approx(plain_cost(task, start.tolist()))
    for kind in _kinds(7):
        moves = kind(pieces)
        for move, cost in enumerate(moves.costs.tolist()):
            path = np.concatenate([pieces.path[block] for block in moves.blocks(move)])[1:-1]
            assert sorted(path.tolist()) == list(range(7))
            assert cost == pytest.approx(plain_cost(task, path.tolist()))
            made += 1
    assert made > 50
