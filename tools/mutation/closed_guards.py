"""What tells a log that was cut, put back or mixed up from a shorter one."""

from __future__ import annotations

from mutation.mutant import Mutant, guard

MARKS = (
    guard("closed.json is written at close", "SegmentChain.close_live",
          "write_mark(self.folder, end.mark(segment.header))", "",
          "test_closed_mark"),
    guard("a log without closed.json gets it", "SegmentChain.take_up",
          "read_mark(self.folder) != mark", "False", "test_closed_mark"),
    guard("digest of closed.json", "unsealed",
          "entries.pop(DIGEST_KEY) != _digest(entries)", "not entries.pop(DIGEST_KEY)",
          "test_closed_mark"),
    guard("the hash in closed.json is one", "mark_in",
          "len(bytes.fromhex(mark.head)) == HASH_BYTES", "True",
          "test_closed_mark"),
    guard("closed.json is no endless file", "read_mark",
          "folder.read_bytes(CLOSED_MARK_NAME, MOST_BYTES)", "folder.read_bytes(CLOSED_MARK_NAME)",
          "test_closed_mark"),
    guard("closed.json is read before the files are listed", "SegmentFolder.look",
          "mark = self.store.mark()\n"
          "listing = self.store.segments()", "listing = self.store.segments()\n"
          "mark = self.store.mark()", "test_closed_mark"),
    guard("closed.json is read again", "LocalSegments.mark",
          "version != self._mark[0]", "self._mark[0] is None",
          "test_closed_mark"),
    guard("a log reaches as far as it did", "SegmentFolder._checked",
          "check_reaches(mark, self.store.path / CLOSED_MARK_NAME, found.segments)", "",
          "test_closed_mark"),
    guard("a log holds what metadata.yaml lists", "SegmentFolder._checked",
          "check_listed(names, self.store.path / BAG_METADATA_NAME, found.segments)", "",
          "test_closed_mark"),
    guard("a log goes on from what it was", "SegmentFolder._checked",
          "check_goes_on(found.segments, self._earlier)", "",
          "test_folder"),
)  # fmt: skip

ENDS = (
    guard("closed.json of another log", "check_reaches",
          "mark.log_id != last.header.info.log_id", "False", "test_closed_mark"),
    guard("the last closed segment is there", "check_reaches",
          "last.header.last_number < mark.segment", "False", "test_closed_mark"),
    guard("the last closed segment ends where it did", "check_reaches",
          "(end := end_of(last)) < mark.next_event", "(end := end_of(last)) < 0",
          "test_closed_mark"),
    guard("the last closed commit is the one that was", "check_reaches",
          "head_before(segments, mark.next_event) != bytes.fromhex(mark.head)", "False",
          "test_closed_mark"),
    guard("a listed segment that was cut", "check_listed",
          "not last.closed and last.path.name in names", "False",
          "test_closed_mark"),
    guard("a listed segment that is missing", "check_listed",
          "numbers and max(numbers) > last.header.last_number", "False",
          "test_closed_mark"),
    guard("the commit that a reader has seen last", "check_goes_on",
          "end and head_before(segments, end) != earlier[-1].head", "False",
          "test_folder"),
    guard("another log is told of as such", "check_goes_on",
          "segments[-1].header.info.log_id != earlier[-1].header.info.log_id", "False",
          "test_folder"),
    guard("neighbours by what their heads tell", "check_adjoins",
          "_check_begins(segment, end_of(before), before.head, before)", "",
          "test_closed_mark"),
    guard("neighbours by the hash in their heads", "check_adjoins",
          "before.head", "segment.header.hash_so_far", "test_closed_mark"),
    guard("neighbours by their times", "check_adjoins",
          "0 < start_ns <= end_ns", "False", "test_guards"),
    guard("neighbours under all questions", "LogReader._check_order",
          "check_adjoins(segment, before)", "", "test_closed_mark"),
    guard("neighbours under questions for events", "LogReader.batches",
          "self._check_order()", "", "test_closed_mark"),
    guard("neighbours under questions for commits", "LogReader.find_commit",
          "self._check_order()", "", "test_closed_mark"),
    guard("neighbours under questions for what was known", "LogReader.event_known_at",
          "self._check_order()", "", "test_closed_mark"),
    guard("neighbours under all records", "LogReader.pages",
          "self._check_order()", "", "test_closed_mark"),
    guard("another log under a reader", "LogReader.refresh",
          "self._check_same_log(found.segments[0])", "", "test_folder"),
)  # fmt: skip

VERIFIED = (
    guard("what closed.json tells, verified", "Verifier._folder",
          "mark_findings(found, self.chain.next_event, self._marked)", "mark_findings and []",
          "test_closed_mark"),
    guard("closed.json of another log, verified", "mark_findings",
          "last.header is not None and last.header.info.log_id != mark.log_id", "False",
          "test_closed_mark"),
    guard("an end before closed.json, verified", "mark_findings",
          "next_event < mark.next_event", "False", "test_closed_mark"),
    guard("another commit than closed.json's, verified", "mark_findings",
          "mark.next_event and head is not None and head.hex() != mark.head", "False",
          "test_closed_mark"),
    guard("the hash where closed.json ends, verified", "Verifier._commit",
          "self._marked = commit.hash", "", "test_closed_mark"),
    guard("closed.json is read before the files are listed, verified", "folder_files.arrange",
          "found.mark = _mark(found)\n"
          "found.listed = frozenset(listed_names(place.bag_metadata() or ''))\n"
          "try:\n"
          "    names = sorted(place.files())\n"
          "except OSError as error:\n"
          '    raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error',
          "try:\n"
          "    names = sorted(place.files())\n"
          "    found.mark = _mark(found)\n"
          "    found.listed = frozenset(listed_names(place.bag_metadata() or ''))\n"
          "except OSError as error:\n"
          '    raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error',
          "test_closed_mark"),
    guard("what metadata.yaml names only now, verified", "bag_metadata_findings",
          "name not in found.listed", "False", "test_closed_mark"),
    guard("damage of closed.json itself, verified", "_mark",
          'found.findings.append(_damage("mark", error.path, error.problem))', "",
          "test_closed_mark"),
)  # fmt: skip

CLOSED_PARTS: tuple[Mutant, ...] = (*MARKS, *ENDS, *VERIFIED)
