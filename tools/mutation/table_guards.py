"""What keeps the rows of a log's tables, and of what notebooks show, true: one by one."""

from __future__ import annotations

from mutation.mutant import guard

TABLES = (
    guard("tables: an event's own commit, where the page lacks it", "SaidFinder.commits_of",
          "numbers[commits.places_of(numbers) < 0]", "numbers[:0]", "test_history_table"),
    guard("tables: commits with others between them", "CommitColumns.places_of",
          "(begins[1:] == ends[:-1]).all() and len(begins)", "len(begins)", "test_history_table"),
    guard("tables: a name from before the door was added", "NamesThen.door_names",
          "each[1] > self._added.get(each[0], _NEVER)", "True", "test_log_tables"),
    guard("tables: a level from before the door was added", "NamesThen._levels_of_doors",
          "(happened > ns) | ((happened == ns) & (number_of >= number))", "happened >= 0",
          "test_log_tables"),
    guard("tables: the name of door 0, and of no door", "NamesThen.door_names",
          "0 in self._doors.codes", "False", "test_door_zero"),
    guard("tables: the level of door 0, and of no door", "NamesThen._levels_of",
          "0 in self._moved", "False", "test_door_zero"),
    guard("tables: a name as it was then", "LastWritten.at",
          "happened_ns.min() > self._latest_ns", "True", "test_log_tables"),
    guard("tables: of the same instant the later number", "LastWritten._behind",
          "self._numbers[middle] <= numbers", "True", "test_last_written"),
    guard("tables: nobody was called anything before", "LastWritten._behind",
          "np.where(low > first, low, 0)", "low", "test_last_written"),
    guard("tables: a door that moved to another level", "asked_tables.names_then",
          "with_levels and len(levels) > 1", "False", "test_log_tables"),
    guard("tables: names that were taken back", "asked_tables.names_then",
          "names.apply(known.visible(batch))", "names.apply(batch)", "test_log_tables"),
    guard("tables: one dictionary for all parts", "history_table.joined",
          "pa.concat_tables(parts).unify_dictionaries()", "pa.concat_tables(parts)",
          "test_log_tables"),
    guard("notebooks: a text is no tag", "html_table._cell",
          "escape(text)", "text", "test_notebook"),
    guard("notebooks: nor is one below a table", "html_table._parts",
          "escape(str(shown))", "str(shown)", "test_notebook"),
)  # fmt: skip
