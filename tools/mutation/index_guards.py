"""Every check that an answer from the tables by door rests on, one by one."""

from __future__ import annotations

from mutation.mutant import guard

INDEX = (
    guard("tables are of this very segment", "SegmentTables.of",
          "told.get(name) != value", "False", "test_read_model"),
    guard("tables that are read are those that were checked", "SealedParquet._checked",
          'zlib.crc32(data) != self._seal["crcs"][piece]', "False", "test_read_model"),
    guard("each group of rows is what was written", "SealedParquet.group",
          "self._checked(group)", "", "test_read_model"),
    guard("no pipe or device is read as a table", "SealedParquet._check_end",
          "stat.S_ISREG(status.st_mode)", "True", "test_read_model"),
    guard("a table of another length is none", "SealedParquet._check_end",
          "status.st_size != size", "False", "test_read_model"),
    guard("tables of a segment have all its events", "SegmentTables._check_count",
          "rows != len(self.numbers)", "False", "test_read_model"),
    guard("tables of a segment have no other events", "SegmentTables._check_numbers",
          "found[0] in self.numbers and found[-1] in self.numbers", "True", "test_read_model"),
    guard("commits of a segment are all its commits", "CommitTable.__init__",
          "np.array_equal(ends, np.append(self._firsts, numbers.stop))", "True",
          "test_read_model"),
    guard("what is damaged in a table is no answer", "SegmentTables._opened",
          "(OSError, ValueError, KeyError, IndexError, TypeError)", "ZeroDivisionError",
          "test_read_model"),
    guard("files in an index that are not ours stay", "indexing._tidied",
          "_OURS.fullmatch(file.name)", "True", "test_read_model"),
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
