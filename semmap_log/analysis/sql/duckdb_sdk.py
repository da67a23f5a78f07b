"""The one place that imports DuckDB; without it, says how to get it."""

from __future__ import annotations

from semmap_log.errors import MissingExtraError

try:
    import duckdb
except ImportError:
    raise MissingExtraError("duckdb", "sql") from None

__all__ = ["duckdb"]
