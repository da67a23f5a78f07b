"""A `.db3` must hold tables: SQLite would run what a view or a computed column says, for ever."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from semmap_log.errors import FormatError

TABLES = ("schema", "metadata", "topics", "messages", "message_definitions")


def check_tables(path: Path) -> None:
    """Return if all that is read of a bag's database are plain tables.

    Raises:
        FormatError: One is not, or the file is no database.
    """
    name = quote(os.fsencode(path.absolute()))
    try:
        with closing(sqlite3.connect(f"file:{name}?mode=ro&immutable=1", uri=True)) as database:
            for kind, table, root in database.execute(
                "SELECT type, name, rootpage FROM sqlite_master"
            ):
                is_read = str(table).lower() in TABLES
                if is_read and (kind != "table" or not root or _is_computed(database, table)):
                    raise FormatError(
                        path,
                        f"expected {table} to be a table of rosbag2, got a {kind} that computes",
                    )
    except sqlite3.Error as error:
        raise FormatError(path, f"cannot be read as a bag: {error}") from None


def _is_computed(database: sqlite3.Connection, table: str) -> bool:
    columns = database.execute("SELECT hidden FROM pragma_table_xinfo(?)", (table,))
    return any(hidden for (hidden,) in columns)
