"""What keeps a query to the log, and its answer the same whatever it was read from."""

from __future__ import annotations

from mutation.mutant import guard

QUERIES = (
    guard("a query sees no variable, and spills into no file", "open_session",
          "dict(CONFIG)", "{}", "test_closed_session"),
    guard("a query reads no file", "open_session",
          'connection.execute("SET enable_external_access = false")', "", "test_closed_session"),
    guard("a query changes no setting", "open_session",
          'connection.execute("SET lock_configuration = true")', "", "test_closed_session"),
    guard("a query only reads", "_check_is_question",
          "kind != duckdb.StatementType.SELECT", "False", "test_closed_session"),
    guard("a query is one statement", "_check_is_question",
          "len(statements) != 1", "not statements", "test_closed_session"),
    guard("an instant of a query has seen its microsecond", "query_session._moment",
          "ns + 999", "ns", "test_sql_query"),
    guard("rows about no door can pass a filter", "possible_doors",
          'asked.possible([each & equal("door_name", None) for each in strangers])', "False",
          "test_views"),
    guard("a query's kinds", "possible_windows",
          'asked.filters_by("kind")', "False", "test_pushdown"),
    guard("a query's times and numbers", "possible_windows",
          "not any(map(asked.filters_by, BOUNDED))", "True", "test_pushdown"),
    guard("all names of a door", "asked_doors.names_ever",
          "found[event.door_id].add(event.value)", "found[event.door_id] = {event.value}",
          "test_views"),
    guard("a damaged table is not used by a query", "unordered_tables._rows_of",
          "not_used(error)", "raise", "test_sql_query"),
    guard("a segment is read once", "unordered_tables.unordered_tables",
          "continue", "pass",
          "test_views"),
    guard("a query counts an event when it counts", "as_event_view",
          "np.minimum(_ns(history[HAPPENED]), _ns(history[RECORDED]))", "_ns(history[HAPPENED])",
          "test_views"),
    guard("an update says only what it sets, also in a query", "stored_rows._of_field",
          '("kind", field, "changed") if field in PART_OF else ("kind", field)',
          '("kind", field)', "test_views"),
    guard("a query in vain says why", "Query._in_our_words",
          "isinstance(ours, SemmapError)", "False", "test_sql_query"),
)  # fmt: skip
