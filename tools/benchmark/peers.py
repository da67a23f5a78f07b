"""What the peers are called, and the tables that some of them read."""

from __future__ import annotations

from pathlib import Path

from benchmark.daily_snapshots import write_snapshots
from benchmark.logs import Workshop
from benchmark.tables import write_parquet, write_sqlite

OURS = "semmap-log"
MCAP = "mcap + mcap-ros2-support, fold"
DUCKDB = "DuckDB, Parquet"
SNAPSHOTS = "DuckDB, daily snapshots"
SQLITE = "SQLite, indexed"


def on_cores(name: str, cores: int) -> str:
    """Return a peer's name with the cores that it is held on."""
    return f"{name}, {cores} core{'s' if cores > 1 else ''}"


def sqlite_table(shop: Workshop, count: int) -> Path:
    """Return a patrol as a SQLite database."""
    return shop.table("events.db", count, write_sqlite)


def parquet_table(shop: Workshop, count: int) -> Path | None:
    """Return a patrol as a Parquet file; None: what writes it is not installed."""
    try:
        return shop.table("events.parquet", count, write_parquet)
    except ModuleNotFoundError:
        return None


def snapshot_table(shop: Workshop, count: int) -> Path | None:
    """Return a patrol with a snapshot a day; None: what writes it is not installed."""
    try:
        return shop.table("snapshots.duckdb", count, write_snapshots)
    except ModuleNotFoundError:
        return None


def there(path: Path | None) -> Path:
    """Return a table's path.

    Raises:
        ModuleNotFoundError: It could not be written: so its peer says, and nothing fails.
    """
    if path is None:
        raise ModuleNotFoundError(name="pyarrow")
    return path
