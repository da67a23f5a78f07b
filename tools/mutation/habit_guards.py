"""Every rule by which output suits people and scripts: tables, errors, times, completion."""

from __future__ import annotations

from mutation.mutant import guard

HABITS = (
    guard("cells of a line are plain", "column_table.line_of",
          "(plain_cell(cell) for cell in cells)", "cells", "test_pipes"),
    guard("columns yield where it is narrow", "ColumnTable._fitting",
          "del needs[place]", "", "test_pipes"),
    guard("what is left out is said", "Printer._draw",
          "left_out and left_out != self._left_out", "False",
          "test_pipes"),
    guard("an empty line between tables", "Printer._tell",
          "table.has_head and self._tables", "False", "test_pipes"),
    guard("NO_COLOR is the strongest", "colours_wanted",
          'os.environ.get("NO_COLOR")', "False", "test_pipes"),
    guard("a reader that goes", "_reader_may_go",
          "sys.exit(READER_GONE)", "sys.exit(1)", "test_pipes"),
    guard("an error as a document", "main",
          "fail(error, as_json=asks_for_json(ours))", "fail(error, as_json=False)",
          "cli.test_failures"),
    guard("a document that has begun stays one", "_tell_machine",
          "has_begun or is_output_lost", "False", "cli.test_failures"),
    guard("words behind -- are no options", "asks_for_json",
          "arguments[:end]", "arguments", "cli.test_failures"),
    guard("old names of ranges", "Verb.make_parser",
          "new in options and old not in options", "False", "cli.test_failures"),
    guard("two ends and a third", "range_of", '".." in since', "False", "cli.test_failures"),
    guard("problems of a kind are counted", "_without_values",
          '_VALUES.sub("…", text)', "text", "test_repeats"),
    guard("completion is quiet", "completion._map",
          "with suppress(Exception), warnings.catch_warnings():", "with warnings.catch_warnings():",
          "test_completion"),
    guard("names that need quotes", "completion._doors",
          "_NEEDS_NO_QUOTES.fullmatch(name) and not name.isdecimal()", "name",
          "test_completion"),
    guard("which keys are needed", "_keys", "name not in needed", "True", "test_event_json_keys"),
)  # fmt: skip
