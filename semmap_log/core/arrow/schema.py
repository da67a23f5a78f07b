"""The schema in Arrow's own types, with what pandas must know to read whole numbers with gaps."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.table_columns import (
    CELLS,
    CHANGED,
    CHANGED_NAMES,
    KIND,
    KIND_NAMES,
    SCHEMA_VERSION,
    STATE,
    STATE_NAMES,
    TEXT,
    TIME,
    Column,
)

DICTIONARIES = {KIND: KIND_NAMES, STATE: STATE_NAMES, CHANGED: CHANGED_NAMES}

TYPES = {
    TIME: pa.timestamp("ns", "UTC"),
    CELLS: pa.list_(pa.int8()),
    "str": pa.string(),
    TEXT: pa.dictionary(pa.int32(), pa.string()),
    "bool": pa.bool_(),
    **{name: pa.dictionary(pa.int8(), pa.string()) for name in DICTIONARIES},
}

PANDAS_TYPES = {"bool": "boolean", "uint16": "UInt16", "uint32": "UInt32", "int64": "Int64"}
"""Our type -> pandas's own that can say `not given`; without a word pandas takes floats."""


def type_of(column: Column) -> pa.DataType:
    """Return a column's Arrow type."""
    return type_named(column.type)


def type_named(name: str) -> pa.DataType:
    """Return the Arrow type of what a column calls its type."""
    return TYPES[name] if name in TYPES else pa.type_for_alias(name)


def schema_of(
    columns: Iterable[Column], said: Mapping[str, str] = MappingProxyType({})
) -> pa.Schema:
    """Return the Arrow schema of these columns.

    Args:
        columns: In order; what each means becomes its `description`.
        said: More about the whole table, key -> text.
    """
    columns = tuple(columns)
    fields = [
        pa.field(
            column.name,
            type_of(column),
            nullable=column.nullable,
            metadata={"description": column.says},
        )
        for column in columns
    ]
    metadata = {"semmap_log.schema": str(SCHEMA_VERSION), **said, "pandas": _for_pandas(columns)}
    return pa.schema(fields, metadata=metadata)


def _for_pandas(columns: tuple[Column, ...]) -> str:
    """Return pandas's own notes, as it would write them, without the versions of the day."""
    told = [
        {
            "name": column.name,
            "field_name": column.name,
            "pandas_type": column.type,
            "numpy_type": PANDAS_TYPES[column.type],
            "metadata": None,
        }
        for column in columns
        if column.nullable and column.type in PANDAS_TYPES
    ]
    return json.dumps({"index_columns": [], "column_indexes": [], "columns": told})
