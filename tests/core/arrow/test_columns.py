"""The schema: nothing of an event is forgotten."""

from __future__ import annotations

import pytest

from semmap_log.core.arrow.table import COLUMNS, HISTORY_COLUMNS
from semmap_log.core.model.events import KINDS, Event, field_names


@pytest.mark.parametrize("kind", KINDS)
def test_every_field_of_every_kind_has_a_column(kind: type[Event]) -> None:
    """A new kind, or a new field, cannot be left out of the tables by mistake."""
    shown = {column.field_name for column in COLUMNS if kind.kind in column.kinds}

    assert set(field_names(kind)) - {"salt"} == shown


def test_no_two_columns_bear_the_same_name() -> None:
    """In SQL the second one would be out of reach."""
    names = [column.name for column in HISTORY_COLUMNS]

    assert sorted(set(names)) == sorted(names)
