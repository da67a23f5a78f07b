"""The peer SQLite: the same answers from one table, by its indexes."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

Rows = list[tuple[Any, ...]]

_FIELDS = {"place": "x", "state": "state", "open": "prob_open", "closed": "prob_closed",
           "named": "name"}  # fmt: skip
"""What is set together -> a column that has a value where it is."""


def _latest(column: str) -> str:
    """Return the number of the event that set a column of door `d` last."""
    return f"""(
        SELECT number FROM events
        WHERE door_id = d.door_id AND {column} IS NOT NULL AND happened <= :at
        ORDER BY happened DESC, number DESC LIMIT 1
    )"""  # noqa: S608


_VALUES = """
    place.level, place.x, place.y, place.theta, place.width, state.state, open.prob_open,
    closed.prob_closed, state.happened, named.name
"""

_MOMENT = f"""
    WITH latest AS (
        SELECT door_id, {", ".join(f"{_latest(col)} AS {name}" for name, col in _FIELDS.items())}
        FROM events AS d
        WHERE added IS NOT NULL AND happened <= :at AND NOT EXISTS (
            SELECT 1 FROM events
            WHERE door_id = d.door_id AND removed IS NOT NULL AND happened <= :at))
    SELECT latest.door_id, {_VALUES}
    FROM latest
    JOIN events AS place ON place.number = latest.place
    JOIN events AS state ON state.number = latest.state
    JOIN events AS open ON open.number = latest.open
    JOIN events AS closed ON closed.number = latest.closed
    LEFT JOIN events AS named ON named.number = latest.named
    ORDER BY latest.door_id
"""  # noqa: S608
"""Each field's last writer is one step in its own partial index: no scan."""


def _last_of_all(column: str) -> str:
    """Return door and number of the events that set a column last, by reading all that did."""
    return f"""(
        SELECT door_id, number FROM (
            SELECT door_id, number, row_number() OVER (
                PARTITION BY door_id ORDER BY happened DESC, number DESC
            ) AS place FROM events WHERE {column} IS NOT NULL
        ) WHERE place = 1
    )"""  # noqa: S608


_WHOLE = f"""
    WITH {", ".join(f"last_{name} AS {_last_of_all(col)}" for name, col in _FIELDS.items())}
    SELECT d.door_id, {_VALUES}
    FROM (SELECT door_id FROM events WHERE added IS NOT NULL EXCEPT
          SELECT door_id FROM events WHERE removed IS NOT NULL) AS d
    JOIN last_place USING (door_id) JOIN events AS place ON place.number = last_place.number
    JOIN last_state USING (door_id) JOIN events AS state ON state.number = last_state.number
    JOIN last_open USING (door_id) JOIN events AS open ON open.number = last_open.number
    JOIN last_closed USING (door_id) JOIN events AS closed ON closed.number = last_closed.number
    LEFT JOIN last_named ON last_named.door_id = d.door_id
    LEFT JOIN events AS named ON named.number = last_named.number
    ORDER BY d.door_id
"""  # noqa: S608

LAST_NS = 2**63 - 1


def connected(path: Path) -> sqlite3.Connection:
    """Return a new connection that only reads."""
    return sqlite3.connect(f"file:{path}?mode=ro", uri=True)


def door_map(connection: sqlite3.Connection, at_ns: int = LAST_NS) -> Rows:
    """Return the doors at a moment, as `answer_of_rows` takes them."""
    return connection.execute(_MOMENT, {"at": at_ns}).fetchall()


def whole_fold(connection: sqlite3.Connection) -> Rows:
    """Return the doors now, by reading every event that says something of them."""
    return connection.execute(_WHOLE).fetchall()


def history(connection: sqlite3.Connection, door: int) -> Rows:
    """Return all events about a door, number and happened time first."""
    query = "SELECT number, happened, * FROM events WHERE door_id = ? ORDER BY number"
    return connection.execute(query, (door,)).fetchall()


def between(connection: sqlite3.Connection, since_ns: int, until_ns: int) -> Rows:
    """Return all events that happened in a range, number and happened time first."""
    query = "SELECT number, happened, * FROM events WHERE happened >= ? AND happened < ?"
    return connection.execute(query, (since_ns, until_ns)).fetchall()
