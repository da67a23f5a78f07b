"""Which views there are, and their columns, in words: for who named another."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from semmap_log.analysis.sql.view_columns import ANNOTATIONS, EVENTS, FUNCTIONS, VIEWS
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.event_view import EVENT_VIEW
from semmap_log.core.arrow.table_columns import Column

COLUMNS_OF: Mapping[str, tuple[Column, ...]] = {
    EVENTS: EVENT_VIEW,
    **{
        name: (*columns, ANNOTATIONS) if name.startswith("doors") else columns
        for name, columns in (*VIEWS.items(), *FUNCTIONS.items())
    },
}
"""The columns of each view and function."""


def columns_table() -> pa.Table:
    """Return a row for each column of each view: what it means."""
    rows = [
        {
            "view": f"{name}('now')" if name in FUNCTIONS else name,
            "column": column.name,
            "meaning": column.says,
        }
        for name, columns in COLUMNS_OF.items()
        for column in columns
    ]
    return pa.Table.from_pylist(rows)


def views_in_words(logs: Sequence[str]) -> str:
    """Return which views there are, of logs by the names that stand before them."""
    functions = [f"{name}('2h ago')" for name in FUNCTIONS]
    told = f"There are {', '.join([EVENTS, *VIEWS, *functions])}."
    named = [name for name in logs if name]
    if named:
        told += f" The same of other logs: {', '.join(f'{name}.{EVENTS}' for name in named)}, …"
    return f"{told} `describe events` shows the columns of one."


def columns_in_words(query: str) -> str:
    """Return the columns of the views that a query names; of all where it names none."""
    views = {name: [column.name for column in columns] for name, columns in COLUMNS_OF.items()}
    named = [name for name in views if re.search(rf"\b{name}\b", query, re.IGNORECASE)]
    return "\n".join(f"{name}: {', '.join(views[name])}" for name in named or views)
