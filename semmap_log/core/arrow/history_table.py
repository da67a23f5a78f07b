"""The one wide table: events with who did it and why, and what doors were called then."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.rows_by_door import Commits
from semmap_log.core.arrow.schema import schema_of
from semmap_log.core.arrow.table import Events, column_of, texts_array
from semmap_log.core.arrow.table_columns import HISTORY_COLUMNS, RETRACTED, SAID, TEXT, THEN, Column
from semmap_log.core.model.commits import NOTE_TEXTS

TextsThen = Mapping[str, tuple[NDArray[np.intp], Sequence[str]]]
"""Column of `THEN` -> of each event the place of its text among some; an empty one is null."""


def history_table(
    events: Events,
    columns: Sequence[Column] = HISTORY_COLUMNS,
    *,
    retracted: NDArray[np.bool_],
    commits: Commits | None = None,
    then: TextsThen = MappingProxyType({}),
) -> pa.Table:
    """Return some columns of events; the others are not made.

    Args:
        events: Their numbers ascend.
        columns: Some of `HISTORY_COLUMNS`, in any order.
        retracted: Which events were taken back.
        commits: Those of the events, where a column of `SAID` is wanted.
        then: The columns of `THEN` that are wanted.
    """
    places = np.empty(0, np.intp) if commits is None else commits.places_of(events.number)
    arrays = []
    for column in columns:
        if column in SAID:
            assert commits is not None, "commits say who and why"
            arrays.append(_said(column.name, commits, places))
        elif column in THEN:
            arrays.append(texts_array(*then[column.name]))
        elif column == RETRACTED:
            arrays.append(pa.array(retracted))
        else:
            arrays.append(column_of(events, column))
    return pa.Table.from_arrays(arrays, schema=_schema(tuple(columns)))


@lru_cache(maxsize=16)
def _schema(columns: tuple[Column, ...]) -> pa.Schema:
    return schema_of(columns)


def joined(tables: Iterable[pa.Table], columns: Sequence[Column]) -> pa.Table:
    """Return tables of some columns as one, whose dictionaries are the same in all its parts."""
    parts = list(tables)
    if not parts:
        return _schema(tuple(columns)).empty_table()
    return pa.concat_tables(parts).unify_dictionaries()


def plain_texts(columns: Iterable[Column]) -> tuple[Column, ...]:
    """Return columns as files have them: texts that many rows share are texts all the same."""
    return tuple(replace(each, type="str") if each.type == TEXT else each for each in columns)


EXPORT_SCHEMA = schema_of(plain_texts(HISTORY_COLUMNS))
"""Of an exported file; a table of all columns becomes one by `cast`."""


def _said(name: str, commits: Commits, places: NDArray[np.intp]) -> pa.DictionaryArray:
    if name in NOTE_TEXTS:
        at = NOTE_TEXTS.index(name)
        return texts_array(commits.notes.take(places), [texts[at] for texts in commits.texts])
    return pa.DictionaryArray.from_arrays(pa.array(places.astype(np.int32)), _hex(commits))


def _hex(commits: Commits) -> pa.StringArray:
    """Return command ids in hexadecimal digits; no loop over them."""
    count, width = commits.command_id.shape
    digits = pa.py_buffer(commits.command_id.tobytes().hex().encode("ascii"))
    ends = pa.py_buffer(np.arange(count + 1, dtype=np.int32) * (2 * width))
    return pa.StringArray.from_buffers(count, ends, digits)
