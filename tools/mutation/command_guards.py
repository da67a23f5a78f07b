"""What a segment says of its commits, and the memory of commands that rests on it."""

from __future__ import annotations

from mutation.mutant import guard

AT_CLOSING = ("tests/store/test_closing.py",)

REMEMBERED = ("tests/store/writing/test_command_memory.py",)

COMMAND_INDEXES = (
    guard("head of a segment that was closed before heads were told", "Segment.head",
          "if stored is not None: return stored", "return stored or self.header.hash_so_far",
          "test_closing"),
    guard("head of a segment of one commit and more", "WrittenCommits._add",
          "self._last, self._last_at = records, at", "", "test_closing"),
    guard("all commits of a compacted chunk in the index", "_places_in",
          "end - size", "end - 16", "test_closing"),
    guard("order of the index", "command_index.command_rows", "rows.sort()", "", "test_closing"),
    guard("a head that is another's", "closing._index",
          "head is not None and head != contents.closing_head()", "False",
          "test_closing"),
    guard("an index of commands that is another's", "_records_behind",
          '"the index of commands", data', '"x", file[data_end:data_end + len(data)]',
          "test_closing"),
    guard("a torn index of commands told from damage", "_records_behind",
          "crc32(data, crc)", "crc32(file[:data_end + len(data)])",
          "test_closing"),
    guard("commits of a segment without an index", "command_rows.rows_of",
          "_rows_of_commits(segment)", "np.empty(0, np.uint64)",
          "test_command_memory"),
    guard("checksum of an index of commands", "_rows_in",
          'zlib.crc32(body) != int.from_bytes(crc, "little")', "False",
          "test_command_memory"),
    guard("commands told apart by their ids", "StoredCommands.find",
          "commit.command_id == command_id", "True", "test_command_memory"),
    guard("numbers of events beyond 32 bits", "StoredCommands._events",
          "range(row & 0xFFFF_FFFF, self._end, _ALL)", "[row & 0xFFFF_FFFF]",
          "test_command_memory"),
    guard("commands of a continued segment, once", "StoredCommands._take",
          "offsets + first >= np.uint64(self._end)", "offsets >= np.uint64(0)",
          "test_command_memory"),
    guard("commands of a segment that was closed since", "CommandMemory.closed",
          "self._stored.add(segment.name, segment.header.first_event, segment.command_rows)", "",
          "test_command_memory"),
    guard("commands of the live segment from before somebody asked", "CommandMemory.find",
          "self._look_at(live)", "", "test_command_memory"),
    guard("commands of the live segment since somebody asked", "CommandMemory.add",
          "self._known[commit.command_id] = commit.first_event", "",
          "test_command_memory"),
    guard("ids of a closed segment forgotten", "CommandMemory.closed",
          "self._forget_live(None)", "", "test_command_memory"),
    guard("what is held back, before the live segment is read", "CommandMemory._read_live",
          "self._flush()", "", "test_command_memory"),
)  # fmt: skip
