"""What tells a log that was cut, put back or mixed up from a shorter one."""

from __future__ import annotations

from mutation.mutant import Mutant

LOG = "semmap_log/log/"
MARK = "tests/log/test_closed_mark.py"
FOLDER = "tests/log/test_folder.py"
GUARDED = "tests/log/test_guards.py"
VERIFICATION = "tests/log/verification/test_verification.py"


def _without(name: str, file: str, snippet: str, *tests: str, put: str = "pass") -> Mutant:
    return Mutant(name, LOG + file, snippet, put, tests)


MARKS = (
    _without("closed.json is written at close", "writing/segment_chain.py",
             "            write_mark(self.folder, end.mark(segment.header))\n", MARK, put=""),
    _without("a log without closed.json gets it", "writing/segment_chain.py",
             "            if read_mark(self.folder) != mark:\n", MARK,
             put="            if False:\n"),
    _without("digest of closed.json", "closed_mark.py",
             "digest == _digest(entries) and ", MARK, put=""),
    _without("the hash in closed.json is one", "closed_mark.py",
             " and len(bytes.fromhex(mark.head)) == HASH_BYTES", MARK, put=""),
    _without("closed.json is no endless file", "closed_mark.py",
             "read_bytes(CLOSED_MARK_NAME, MOST_BYTES)", MARK, put="read_bytes(CLOSED_MARK_NAME)"),
    _without("closed.json is read before the files are listed", "reading/segment_folder.py",
             "            mark = self._mark_now()  # first: what is closed meanwhile is no concern "
             "of ours\n            listing = list_segments(self.folder)\n", MARK,
             put="            listing = list_segments(self.folder)\n"
             "            mark = self._mark_now()\n"),
    _without("closed.json is read again", "reading/segment_folder.py",
             "if version != self._mark[0]:", MARK, put="if self._mark[0] is None:"),
    _without("a log reaches as far as it did", "reading/segment_folder.py",
             "check_reaches(mark, self.folder / CLOSED_MARK_NAME, found.segments)", MARK),
    _without("a log holds what metadata.yaml lists", "reading/segment_folder.py",
             "check_listed(self._listed(), self.folder / BAG_METADATA_NAME, found.segments)",
             MARK),
    _without("a log goes on from what it was", "reading/segment_folder.py",
             "check_goes_on(found.segments, self._earlier)", FOLDER),
)  # fmt: skip

ENDS = (
    _without("closed.json of another log", "reading/segment_set.py",
             "if mark.log_id != last.header.info.log_id:", MARK, put="if False:"),
    _without("the last closed segment is there", "reading/segment_set.py",
             "    if last.header.last_number < mark.segment:", MARK, put="    if False:"),
    _without("the last closed segment ends where it did", "reading/segment_set.py",
             "elif (end := end_of(last)) < mark.next_event:", MARK,
             put="elif (end := end_of(last)) < 0:"),
    _without("the last closed commit is the one that was", "reading/segment_set.py",
             "elif head_before(segments, mark.next_event) != bytes.fromhex(mark.head):", MARK,
             put="elif False:"),
    _without("a listed segment that was cut", "reading/segment_set.py",
             "if not last.closed and last.path.name in names:", MARK, put="if False:"),
    _without("a listed segment that is missing", "reading/segment_set.py",
             "if numbers and max(numbers) > last.header.last_number:", MARK, put="if False:"),
    _without("the commit that a reader has seen last", "reading/segment_set.py",
             "if end and head_before(segments, end) != earlier[-1].head:", FOLDER, put="if False:"),
    _without("another log is told of as such", "reading/segment_set.py",
             "    if segments[-1].header.info.log_id != earlier[-1].header.info.log_id:\n", FOLDER,
             put="    if False:\n"),
    _without("neighbours by what their heads tell", "reading/segment_set.py",
             "_check_begins(segment, end_of(before), before.head, before)", MARK),
    _without("neighbours by the hash in their heads", "reading/segment_set.py",
             "_check_begins(segment, end_of(before), before.head, before)", MARK,
             put="_check_begins(segment, end_of(before), segment.header.hash_so_far, before)"),
    _without("neighbours by their times", "reading/segment_set.py",
             "if 0 < start_ns <= end_ns:", GUARDED, put="if False:"),
    _without("neighbours under all questions", "reading/reader.py",
             "                check_adjoins(segment, before)", MARK, put="                pass"),
    _without("neighbours under questions for events", "reading/reader.py",
             "        self._check_order()\n        passage = Passage(", MARK,
             put="        passage = Passage("),
    _without("neighbours under questions for commits", "reading/reader.py",
             "        self._check_order()\n        place = self.segment_of(number)", MARK,
             put="        place = self.segment_of(number)"),
    _without("neighbours under questions for what was known", "reading/reader.py",
             "        self._check_order()\n        early =", MARK, put="        early ="),
    _without("neighbours under all records", "reading/reader.py",
             "        self._check_order()\n        last: Page | None = None\n        before:", MARK,
             put="        last: Page | None = None\n        before:"),
    _without("another log under a reader", "reading/reader.py",
             "            self._check_same_log(found.segments[0])\n", FOLDER, put=""),
)  # fmt: skip

VERIFIED = (
    _without("what closed.json tells, verified", "verification/run.py",
             "marks = mark_findings(found, self.chain.next_event, self._marked)", MARK,
             put="marks = mark_findings and []"),
    _without("closed.json of another log, verified", "verification/folder.py",
             "if last.header is not None and last.header.info.log_id != mark.log_id:", MARK,
             put="if False:"),
    _without("an end before closed.json, verified", "verification/folder.py",
             "    if next_event < mark.next_event:", MARK, put="    if False:"),
    _without("another commit than closed.json's, verified", "verification/folder.py",
             "if mark.next_event and head is not None and head.hex() != mark.head:", MARK,
             put="if False:"),
    _without("the hash where closed.json ends, verified", "verification/run.py",
             "            self._marked = commit.hash\n", MARK, put="            pass\n"),
    _without("closed.json is read before the files are listed, verified",
             "verification/folder.py",
             "    found.mark = _mark(found)\n    found.listed = frozenset(listed_names("
             "_bag_metadata_of(path)))\n    try:\n        names = sorted(p for p in "
             "path.iterdir())\n", MARK,
             put="    try:\n        names = sorted(p for p in path.iterdir())\n"
             "        found.mark = _mark(found)\n"
             "        found.listed = frozenset(listed_names(_bag_metadata_of(path)))\n"),
    _without("what metadata.yaml names only now, verified", "verification/folder.py",
             "        if name not in found.listed:\n", MARK, put="        if False:\n"),
    _without("damage of closed.json itself, verified", "verification/folder.py",
             'found.findings.append(_damage("mark", error.path, error.problem))', MARK),
)  # fmt: skip

CLOSED_PARTS: tuple[Mutant, ...] = (*MARKS, *ENDS, *VERIFIED)
