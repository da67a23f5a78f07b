"""SQL queries: a log's events, and what follows from them, as the views of a DuckDB.

`sql_query` runs a query. `log_views` defines the columns of the views, and makes their rows when a
query wants them. `answer_rows` writes answers. Only `duckdb_sdk` imports DuckDB.
"""

from semmap_log.analysis.sql import duckdb_sdk as duckdb_sdk
