"""What tells a log that was cut, put back or mixed up from a shorter one."""

from __future__ import annotations

from mutation.mutant import Mutant, guard

MARKS = (
    guard("a mark is written at close", "SegmentChain.close_live",
          "write_mark(self.folder, end.mark(segment.header))", "",
          "test_closed_mark"),
    guard("a log without a mark gets it", "SegmentChain.take_up",
          "read_mark(self.folder) != mark", "False", "test_closed_mark"),
    guard("digest of a mark", "unsealed",
          "entries.pop(DIGEST_KEY) != _digest(entries)", "not entries.pop(DIGEST_KEY)",
          "test_closed_mark"),
    guard("the hash in a mark is one", "mark_in",
          "len(bytes.fromhex(mark.head)) == HASH_BYTES", "True",
          "test_closed_mark"),
    guard("a mark is no endless file", "read_named_mark",
          "folder.read_bytes(name, MOST_BYTES)", "folder.read_bytes(name)",
          "test_closed_mark"),
    guard("a mark is read before the files are listed", "SegmentFolder.look",
          "mark = self.store.mark()\n"
          "listing = self.store.segments()", "listing = self.store.segments()\n"
          "mark = self.store.mark()", "test_closed_mark"),
    guard("a mark is read again", "LocalSegments.mark",
          "found != self._mark[0]", "not self._mark[0]",
          "test_closed_mark"),
    guard("a log reaches as far as it did", "SegmentFolder._checked",
          "check_reaches(mark, self.store.path / mark.file, found.segments)", "",
          "test_closed_mark"),
    guard("a log holds what metadata.yaml lists", "SegmentFolder._checked",
          "check_listed(names, self.store.path / BAG_METADATA_NAME, found.segments)", "",
          "test_closed_mark"),
    guard("a log goes on from what it was", "SegmentFolder._checked",
          "check_goes_on(found.segments, self._earlier)", "",
          "test_folder"),
)  # fmt: skip

ENDS = (
    guard("a mark of another log", "check_reaches",
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
    guard("what a mark tells, verified", "Verifier._folder",
          "mark_findings(found, self.chain.next_event, self._marked)", "mark_findings and []",
          "test_closed_mark"),
    guard("a mark of another log, verified", "mark_findings",
          "last.header is not None and last.header.info.log_id != mark.log_id", "False",
          "test_closed_mark"),
    guard("an end before the mark, verified", "mark_findings",
          "next_event < mark.next_event", "False", "test_closed_mark"),
    guard("another commit than the mark's, verified", "mark_findings",
          "mark.next_event and head is not None and head.hex() != mark.head", "False",
          "test_closed_mark"),
    guard("the hash where the mark ends, verified", "Verifier._commit",
          "self._marked = commit.hash", "", "test_closed_mark"),
    guard("a mark is read before the files are listed, verified", "folder_files.arrange",
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
    guard("damage of the mark itself, verified", "_mark",
          'found.findings.append(_damage("mark", error.path, error.problem))', "",
          "test_closed_mark"),
)  # fmt: skip

COPIES = (
    guard("a mark is told before metadata.yaml", "SegmentChain.close_live",
          "write_mark(self.folder, end.mark(segment.header))\n"
          "self._list(segment.closed_segment())",
          "self._list(segment.closed_segment())\n"
          "write_mark(self.folder, end.mark(segment.header))", "test_closed_mark"),
    guard("a mark has a name of its own", "mark_name",
          'f"closed-{segment}-{next_event}.json"', "OLD_MARK_NAME", "test_closed_mark"),
    guard("marks that others have followed stay", "closed_mark._superseded",
          "now_s - written[follower] > KEPT_S or is_crowded", "True", "test_closed_mark"),
    guard("a mark stays from when another followed", "closed_mark._superseded",
          "now_s - written[follower]", "now_s - written[name]", "test_closed_mark"),
    guard("merged files stay for copies", "MergedFiles.remove",
          "time.time() - last_s < (MERGED_KEPT_S if keep_s is None else keep_s)", "False",
          "test_segment_set"),
    guard("what is copied is verified before it has its name", "StagedFile.verify",
          "self._check(found)", "pass", "test_copying"),
    guard("a copy that went another way", "check_is_earlier",
          "ours != theirs", "False", "test_copying"),
    guard("a copy that is longer", "check_is_earlier",
          "end > most", "False", "test_copying"),
    guard("another log where a copy is made", "check_is_earlier",
          "source.info.log_id != copy.info.log_id", "False", "test_copying"),
    guard("what was merged in a copy holds all", "_stands_for",
          "end_of(there) >= end_of(segment)", "True", "test_copying"),
    guard("a copy tells how far it reaches", "_Copying._end",
          "write_mark(self.copy, mark)", "pass", "test_copying"),
)  # fmt: skip

CLOSED_PARTS: tuple[Mutant, ...] = (*MARKS, *ENDS, *VERIFIED, *COPIES)
