"""A day of the doors as the JSON that `info --json` prints."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.domain.moments import format_utc
from semmap_log.door_log.day import Day


def day_to_json(day: Day) -> dict[str, Any]:
    """Return the half hours' edges, and of each door how much of each it was open.

    `open` is the share of the time known to be open or closed (null: none was), `known` is that
    time's share of the half hour.
    """
    return {
        "date": day.date,
        "edges": [format_utc(edge) for edge in day.edges_ns.tolist()],
        "doors": [
            {
                "door_id": door.door_id,
                "name": door.label,
                "changes": door.changes,
                "open": _rounded(door.shares.opened),
                "known": _rounded(door.shares.known),
            }
            for door in day.doors
        ],
    }


def _rounded(shares: NDArray[np.float64]) -> list[float | None]:
    return [None if np.isnan(share) else round(share, 4) for share in shares.tolist()]
