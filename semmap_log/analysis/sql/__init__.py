"""Questions in SQL: a log's events, and what follows from them, as the views of a DuckDB.

`sql_query` runs a query, `view_columns` says what the views hold, and the other files make their
rows when a query wants them. Only `duckdb_sdk` imports DuckDB.
"""

from semmap_log.analysis.sql import duckdb_sdk as duckdb_sdk
