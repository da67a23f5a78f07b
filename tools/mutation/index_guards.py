"""Every check that an answer from the tables by door rests on, one by one."""

from __future__ import annotations

from mutation.mutant import guard

INDEX = (
    guard("tables are of this very segment", "segment_tables._check_told",
          "told.get(name) != value", "False", "test_read_model"),
    guard("tables end as they were written", "segment_tables._check_told",
          "_seal(file) != files[part]", "False", "test_read_model"),
    guard("pages of tables are what was written", "open_checked",
          "page_checksum_verification=True", "page_checksum_verification=False",
          "test_read_model"),
    guard("what is damaged in a table is no answer", "_Reading.__exit__",
          'raise StaleIndexError(f"{self._path}: is damaged: {error}") from None', "raise",
          "test_read_model"),
    guard("times told by how late they were recorded", "events_in",
          'heads["recorded_ns"] - heads[LATE]', 'heads["recorded_ns"]', "test_read_model"),
    guard("what a retraction before an event changed", "ChangeFinder.look_at_rows",
          "(len(before) and before[-1] >= begin)", "False", "test_read_model"),
    guard("what a retraction behind the last event changed", "ChangeFinder.look_at_rows",
          "len(borders) and borders[-1] >= begin", "False", "test_read_model"),
    guard("parts of the log between segments with tables", "events_about.events_about",
          "yield from read(at, segment.header.first_event)", "", "test_read_model"),
    guard("the live end behind the last table", "events_about.events_about",
          "yield from read(at)\n", "", "test_read_model"),
    guard("one process makes an index", "indexing._alone",
          "fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)", "", "test_read_model"),
    guard("a folder of tables is no link", "indexing.index",
          "folder.is_symlink()", "False", "test_read_model"),
)  # fmt: skip
