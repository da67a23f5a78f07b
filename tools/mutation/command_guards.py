"""What a segment says of its commits, and the memory of commands that rests on it."""

from __future__ import annotations

from mutation.mutant import Mutant

LOG = "semmap_log/log/"
INDEX = LOG + "command_index.py"
CLOSING = LOG + "verification/closing.py"
MEMORY = LOG + "writing/command_memory.py"
STORED = LOG + "writing/stored_commands.py"
ROWS = LOG + "reading/command_rows.py"
AT_CLOSING = ("tests/log/test_closing.py",)
REMEMBERED = ("tests/log/writing/test_command_memory.py",)

COMMAND_INDEXES = (
    Mutant("head of a segment that was closed before heads were told", LOG + "reading/scan.py",
           "        if stored is not None:\n            return stored\n",
           "        return stored or self.header.hash_so_far\n", AT_CLOSING),
    Mutant("head of a segment of one commit and more", INDEX,
           "self._last, self._last_at = records, at", "pass", AT_CLOSING),
    Mutant("all commits of a compacted chunk in the index", INDEX,
           "data[end - size : end]", "data[end - 16 : end]", AT_CLOSING),
    Mutant("order of the index", INDEX, "    rows.sort()\n", "", AT_CLOSING),
    Mutant("a head that is another's", CLOSING,
           "if head is not None and head != contents.closing_head():", "if False:", AT_CLOSING),
    Mutant("an index of commands that is another's", CLOSING,
           'yield "the index of commands", data', 'yield "x", file[data_end:data_end + len(data)]',
           AT_CLOSING),
    Mutant("a torn index of commands told from damage", CLOSING,
           "crc = zlib.crc32(data, crc)", "crc = zlib.crc32(file[:data_end + len(data)])",
           AT_CLOSING),
    Mutant("commits of a segment without an index", ROWS,
           "_rows_of_commits(segment) if stored is None else stored",
           "np.empty(0, np.uint64) if stored is None else stored", REMEMBERED),
    Mutant("checksum of an index of commands", ROWS,
           'if zlib.crc32(body) != int.from_bytes(crc, "little"):', "if False:", REMEMBERED),
    Mutant("commands told apart by their ids", STORED,
           "commit is not None and commit.command_id == command_id", "commit is not None",
           REMEMBERED),
    Mutant("numbers of events beyond 32 bits", STORED,
           "range(row & 0xFFFF_FFFF, self._end, _ALL)", "[row & 0xFFFF_FFFF]", REMEMBERED),
    Mutant("commands of a continued segment, once", STORED,
           "new = offsets + first >= np.uint64(self._end)", "new = offsets >= np.uint64(0)",
           REMEMBERED),
    Mutant("commands of a segment that was closed since", MEMORY,
           "            self._stored.add(segment.name, segment.header.first_event, "
           "segment.command_rows)", "            pass", REMEMBERED),
    Mutant("commands of the live segment from before somebody asked", MEMORY,
           "                self._look_at(live)\n", "                pass\n", REMEMBERED),
    Mutant("commands of the live segment since somebody asked", MEMORY,
           "            self._known[commit.command_id] = commit.first_event\n", "", REMEMBERED),
    Mutant("ids of a closed segment forgotten", MEMORY,
           "            self._forget_live(None)\n", "            pass\n", REMEMBERED),
    Mutant("what is held back, before the live segment is read", MEMORY,
           "        self._flush()\n", "", REMEMBERED),
)  # fmt: skip
