"""Reads every byte of a log and says what is not as it was written."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path, PurePath

from mcap.opcode import Opcode

from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.core.messages import decode
from semmap_log.core.model.events import HistoryTrimmed
from semmap_log.core.texts import counted
from semmap_log.errors import LogError
from semmap_log.store.bag_metadata import ClosedSegment
from semmap_log.store.byte_layout import FORMAT_MINOR, FORMAT_VERSION, NO_HASH
from semmap_log.store.clock_check import ClockCheck
from semmap_log.store.header import SegmentHeader
from semmap_log.store.manifest import ShippedSegment
from semmap_log.store.newer import NOTHING_NEWER, is_later_kind
from semmap_log.store.newer import name_of as name_of_kind
from semmap_log.store.records import MESSAGE
from semmap_log.store.removed_part import rest_of_environment
from semmap_log.store.verification import closing, hash_chain, keyframe_place
from semmap_log.store.verification.file_heads import SegmentFile, bytes_of, first_bytes, name_of
from semmap_log.store.verification.file_place import DiskPlace, FileBytes, FilePlace, Vanished
from semmap_log.store.verification.findings import (
    CommitEnd,
    Finding,
    FolderFiles,
    Severity,
    Verification,
    arrange,
    bag_metadata_findings,
    mark_findings,
    merged_finding,
)
from semmap_log.store.verification.pieces import Flaw, Gap, Piece, SegmentWalk

Progress = Callable[[int, int], None]
"""Called with (bytes done, bytes in all)."""

TORN_KINDS = ("message index", "times")
"""Flaws around a chunk that a crash in the middle of its write can leave."""

_ATTEMPTS = 5
"""How often to begin again when a compaction replaces files during the reading."""


def verify(
    path: PurePath | FilePlace,
    new_check: keyframe_place.NewKeyframeCheck,
    head: bytes | None = None,
    progress: Progress | None = None,
    *,
    ends: Collection[int] = (),
) -> Verification:
    """Read all of a log, or one segment of it, and return what is wrong.

    Nothing is written, and no lock is taken. While a writer is at work, a commit that is half
    written looks like a torn tail.

    Args:
        path: The log's folder, one .mcap file, or the URL of a log in
            a store; or another place.
        new_check: Makes what compares keyframes with the events.
        head: Hash of a commit that the log must hold, kept elsewhere: shows whether commits were
            cut off since.
        progress: Called with the number of bytes read.
        ends: Event numbers: whether a commit ends before each of them, and with which hash.

    Raises:
        LogAccessError: The file system does not let us read it.
        LogError: It is of another format version.
    """
    if isinstance(path, PurePath):
        path = place_of(path)
    if isinstance(path, UrlPath):
        path = keyframe_place.ObjectPlace(ObjectStore(path))
    rest_at = rest_of_environment()
    if isinstance(path, Path) and path.is_dir() and rest_at is not None:
        path = keyframe_place.DiskAndStorePlace(path, ObjectStore(rest_at))
    for _ in range(_ATTEMPTS):
        with suppress(Vanished):
            return Verifier(path, new_check, head, progress, ends=ends).run()
    where = path if isinstance(path, Path) else path.path
    raise LogError(f"{where}: its files change faster than they can be read; try again.")


class Verifier:
    """One reading of a log."""

    def __init__(
        self,
        path: Path | FilePlace,
        new_check: keyframe_place.NewKeyframeCheck,
        head: bytes | None = None,
        progress: Progress | None = None,
        on_commit: hash_chain.OnCommit | None = None,
        *,
        on_gone: hash_chain.OnGone | None = None,
        keep_parts: bool = False,
        ends: Collection[int] = (),
    ) -> None:
        """Prepare to read.

        Args:
            path: As for `verify`.
            new_check: As for `verify`.
            head: As for `verify`.
            progress: As for `verify`.
            on_commit: Takes each commit that is whole and in its place.
            on_gone: Takes what stands for whole commits that were taken out, in its place.
            keep_parts: Whether it wants the commit's records: a long commit is in memory then.
            ends: As for `verify`.
        """
        self._place = DiskPlace(path) if isinstance(path, Path) else path
        self.path = self._place.path
        self.chain = hash_chain.Chain(
            self._report, self._commit, on_gone=self._run_gone, keep_parts=keep_parts
        )
        self.arrangement = FolderFiles(self._place)
        self.findings: list[Finding] = []
        self._head = head
        self._progress = progress
        self._on_commit, self._on_gone = on_commit, on_gone
        self._clock = ClockCheck()
        self._keyframes = new_check(self._report, self._reread)
        self._bytes = self._todo = 0
        self._head_event: int | None = -1 if head == NO_HASH else None
        self._breaks = 0
        self._merged: dict[int, tuple[PurePath, bytes]] = {}
        """Last event of a leftover -> its file, and the hash of that event's commit."""
        self._closed: list[ClosedSegment] = []
        self._entries: list[ShippedSegment] = []
        self._current, self._at = PurePath(), 0
        self.headers: list[SegmentHeader] = []
        """Of the segments so far, with what later versions have put there."""
        self.newer: Counter[str] = Counter()
        """How many events there are of each kind that is unknown here."""
        self.has_unknown_changes = False
        """Whether some of them may have changed more than themselves."""
        self.trimming: HistoryTrimmed | None = None
        """The last event that records a removal of records."""
        self._trimming_before = 0
        self._wanted_ends = frozenset(ends)
        self._ends: dict[int, CommitEnd] = {}
        self._first_event = self._closed_before = 0
        """With which it begins; below which events lie in closed segments."""
        self._recorded_ns: int | None = None
        """When the last commit was recorded; None: it was taken out, or there is none."""
        self._segment_ends: list[int] = []
        self._ends_gone: set[int] = set()
        self._head_unvouched = 0
        """How many records the given head does not bind."""
        self._marked: bytes | None = None
        """Hash of the commit that ends where its mark says that the log ended once."""

    def run(self) -> Verification:
        """Return what was found."""
        self.arrangement = found = arrange(self._place)
        self.findings += found.findings
        if not found.segments:
            return Verification(self.path, tuple(self.findings))
        self._todo = sum(file.size for file in (*found.segments, *found.leftovers))
        self._check_merged(found.leftovers)
        self._begin(found.segments[0])
        for i in range(len(found.segments)):
            self._segment(i)
        self.chain.end()
        self._keyframes.finish()
        if self._place.is_folder():
            self._folder(found)
        self._check_head()
        self._check_trimming()
        if self.newer or any(header.minor > FORMAT_MINOR for header in self.headers):
            self.findings.append(self._newer_finding())
        return self._result(found)

    def _begin(self, first: SegmentFile) -> None:
        """Begin at event 0; a single file of a log's middle, where its header says."""
        is_middle = self.path == first.path or self.arrangement.removed is not None
        if is_middle and first.header is not None:
            self.chain.start_at(first.header)
        if self.chain.next_event == 0:
            self._keyframes.begin()
        self._first_event = self._closed_before = self.chain.next_event
        self._ends[self._first_event] = CommitEnd(
            self.chain.head, 0, None, self.chain.unbound.digest
        )

    def _segment(self, i: int) -> None:
        file = self.arrangement.segments[i]
        self._current, self._at = file.path, i
        is_last = i == len(self.arrangement.segments) - 1
        is_live = is_last and not file.is_closed
        contents = closing.Contents(file.header_end, file.header, is_complete=file.header_end > 0)
        self._check_place(file, contents)
        with bytes_of(self._place, file) as data:
            self._bytes += len(data)
            data.try_all()
            walk = SegmentWalk(data, file.header_end, file.header)
            is_whole = self._chunks(i, walk, contents, is_live=is_live)
            contents.header = walk.header
            if walk.header is not None:
                self.headers.append(walk.header)
            if is_whole:
                self._end_of_segment(file, walk, contents, is_live=is_live)
            for start, end in data.unreadable:
                self._damage("unreadable", start, f"the disk does not give bytes {start}..{end}")
        if not is_live:
            self._closed_before = self.chain.next_event
            self._segment_ends.append(self._closed_before)
            self._ends[self._closed_before] = self._end
        if self.chain.breaks != self._breaks:
            self._breaks = self.chain.breaks
            self._keyframes.forget()

    def _check_place(self, file: SegmentFile, contents: closing.Contents) -> None:
        """Check what the head says, and that nothing is missing before it."""
        missing_from = self.arrangement.missing.get(file.number)
        if missing_from is not None and self.path != file.path:
            many = file.number - missing_from
            what = (
                f"segment {missing_from} is"
                if many == 1
                else (f"segments {missing_from}..{file.number - 1} are")
            )
            path = name_of(file, missing_from)
            self.chain.wrong("missing", path, None, f"{what} missing before {file.path.name}")
        if file.problem:
            at = 0 if "magic" in file.problem else len(first_bytes())
            self._damage("header", at, file.problem)
            contents.is_flawless = False
        self.chain.begin_segment(file.path, file.header)
        if self._is_trimmed:
            self._keyframes.forget()

    def _chunks(
        self, i: int, walk: SegmentWalk, contents: closing.Contents, *, is_live: bool
    ) -> bool:
        """Take all chunks of a segment; return False where the rest of it is a torn tail."""
        chain, path = self.chain, self._current
        for item in walk:
            if isinstance(item, Piece):
                self._note_newer(item, walk)
                self._piece(item, keyframe_place.KeyframePlace(i, item.stored.offset))
                if is_live and not item.is_compressed_as_usual(walk.file):
                    self._report(_unusual(path, item.stored.offset))
                contents.add(item)
                if self._progress is not None:
                    self._progress(self._bytes - len(walk.file) + item.end, self._todo)
                del item  # or it would be in memory while the next one is unpacked
            elif isinstance(item, Flaw):
                contents.is_flawless = False
                is_head = not contents.chunks  # the keyframe: synced before the file has its name
                if not self._flaw(item, walk, is_live=is_live and not is_head):
                    return False
            elif is_live and self._is_torn(item, walk):
                chain.forget_unfinished()
                self._torn(item.start, len(walk.file), item.text)
                return False
            else:
                contents.is_complete = False
                chain.wrong("chunk", path, item.start, f"{item.text}; to byte {item.end}")
                self._keyframes.forget()
        return True

    def _piece(self, piece: Piece, place: keyframe_place.KeyframePlace) -> None:
        expected, breaks = self.chain.next_event, self._breaks
        self.chain.add(piece)
        self._breaks = self.chain.breaks
        if self._breaks != breaks:
            self._keyframes.forget()
        elif not self._is_trimmed:  # else what is left is not all that the keyframes know
            self._keyframes.add(self._current, piece, place, expected)
        self._note_trimming(piece)

    @property
    def place(self) -> int:
        """Which of the segments of `arrangement` is being read."""
        return self._at

    @property
    def _is_trimmed(self) -> bool:
        """Whether records were taken out of the segment under way, as far as it can be known."""
        header = self.arrangement.segments[self._at].header
        return header is None or header.trimmed is not None

    def _note_trimming(self, piece: Piece) -> None:
        """Remember the last event that records a removal of records."""
        if HistoryTrimmed.kind not in piece.counts:
            return
        for channel, sequence, *_, start, end in piece.messages:
            if channel == HistoryTrimmed.kind:
                with suppress(ValueError):  # which the check of keyframes reports
                    found = decode(channel, piece.records[start + MESSAGE.size : end], None)
                    assert isinstance(found, HistoryTrimmed)
                    header = self.arrangement.segments[self._at].header
                    if header is not None and _log_of(found) == header.info.log_id:
                        self.trimming = found
                        self._trimming_before = self.chain.number_of(sequence) + 1

    def _note_newer(self, piece: Piece, walk: SegmentWalk) -> None:
        """Count events of kinds unknown here; no keyframe can be folded after some of them."""
        unknown = {c: n for c, n in piece.counts.items() if is_later_kind(c)}
        if unknown:
            newer = walk.header.newer if walk.header is not None else NOTHING_NEWER
            self.newer.update({name_of_kind(c, newer.names): n for c, n in unknown.items()})
            if not unknown.keys() <= newer.harmless:
                self.has_unknown_changes = True
                self._keyframes.give_up()

    def _is_torn(self, gap: Gap, walk: SegmentWalk) -> bool:
        """Return whether a crash can have left a bad place in a live segment."""
        if gap.start == walk.head_end:
            return False  # the head and its keyframe are synced before the file has its name
        return not walk.is_durable_after(gap.end, self.chain.next_event)

    def _flaw(self, flaw: Flaw, walk: SegmentWalk, *, is_live: bool) -> bool:
        """Report a flaw around a chunk; return False where it makes the rest a torn tail."""
        is_torn = (
            is_live
            and flaw.kind in TORN_KINDS
            and not walk.is_durable_after(flaw.offset + 1, self.chain.next_event)
        )
        if not is_torn:
            self._damage(flaw.kind, flaw.offset, flaw.text)
            return True
        if flaw.kind == "message index":  # which is rewritten: the chunk before it counts
            self._torn(flaw.offset, flaw.offset, flaw.text)
            return True
        self.chain.forget_unfinished()
        self._torn(flaw.offset, len(walk.file), flaw.text)
        return False

    def _end_of_segment(
        self, file: SegmentFile, walk: SegmentWalk, contents: closing.Contents, *, is_live: bool
    ) -> None:
        data, at = walk.file, walk.pieces_end
        if is_live:
            self._end_of_live(walk, contents)
        elif (
            contents.is_complete
            and not file.is_closed
            and closing.is_whole_closing(data, at, contents)
        ):
            self._report_all(closing.closing_flaws(data, at, contents))
        elif not file.is_closed:
            text = "segments follow it, so it was closed once, but no footer ends it: it was cut"
            self.chain.wrong("shortened", file.path, at, text)
        elif not contents.is_complete:
            self._report_all(closing.summary_flaws(data))
        elif data[at : at + 1] == bytes([Opcode.METADATA]):
            self._report_all(closing.closing_flaws(data, at, contents))
            self._closed.append(contents.closed_segment(file.path.name))
            self._entries.append(contents.manifest_entry(file.path.name, len(data)))
        else:
            self.chain.wrong("chunk", file.path, at, walk.problem)
            self._report_all(closing.summary_flaws(data))

    def _end_of_live(self, walk: SegmentWalk, contents: closing.Contents) -> None:
        data, at = walk.file, walk.pieces_end
        unfinished = self.chain.forget_unfinished()
        if at <= walk.head_end:
            text = walk.problem or "the keyframe at its head is missing"
            self.chain.wrong("chunk", self._current, at, text)
        elif at == len(data):
            if unfinished:
                events = counted(unfinished, "event")
                text = f"a commit that was not finished: {events} without a Commit"
                self._torn(at, at, text)
        elif contents.is_complete and closing.is_torn_closing(data, at, contents):
            self._torn(at, len(data), "the closing was not finished")
        elif contents.is_complete and closing.is_whole_closing(data, at, contents):
            self._report_all(closing.closing_flaws(data, at, contents))
        else:
            self._torn(at, len(data), walk.problem)

    def _check_merged(self, files: list[SegmentFile]) -> None:
        """Read segments that were merged into others: their last hash must come again there."""
        for file in files:
            found: list[Finding] = []
            chain = hash_chain.Chain(found.append)
            if file.header is not None:
                chain.start_at(file.header)
            with bytes_of(self._place, file) as data:
                self._bytes += len(data)
                flaws = _flaws_of_merged(file, data, chain)
            if chain.commits:
                self._merged[chain.next_event - 1] = (file.path, chain.head)
            self.findings.append(merged_finding(file.path, is_whole=not (found or flaws)))

    def _commit(self, whole: hash_chain.ValidCommit) -> None:
        commit = whole.commit
        mark = self.arrangement.mark
        if mark is not None and mark.next_event == commit.last_event + 1:
            self._marked = commit.hash
        if commit.hash == self._head:
            self._head_event, self._head_unvouched = commit.last_event, self.chain.unvouched
        behind, self._recorded_ns = commit.last_event + 1, commit.recorded_ns
        if behind in self._wanted_ends:
            self._ends[behind] = self._end
        path, wanted = self._merged.pop(commit.last_event, (self._current, commit.hash))
        if wanted != commit.hash:
            text = "its number is that of a merged segment, but its commits are others"
            self.findings.append(Finding("duplicated", Severity.DAMAGE, path, None, None, text))
        suspect = self._clock.add(commit)
        if suspect is not None:
            events = (commit.first_event, commit.last_event)
            finding = Finding(
                "clock", Severity.NOTE, self._current, None, events, f"suspect: {suspect.text}"
            )
            self.findings.append(finding)
        if self._on_commit is not None:
            self._on_commit(whole)

    @property
    def _end(self) -> CommitEnd:
        """Where the last commit so far ends."""
        chain = self.chain
        commits = chain.commits + chain.taken_out.commits
        return CommitEnd(
            chain.head, commits, self._recorded_ns, chain.unbound.digest, chain.unvouched
        )

    def _run_gone(self, commits: hash_chain.GoneCommits) -> None:
        """Note which of the requested ends lie within whole commits that are gone."""
        gone = commits.tombstone
        self._recorded_ns = None
        if self._on_gone is not None:
            self._on_gone(commits)
        if gone.next_event in self._wanted_ends:
            self._ends[gone.next_event] = self._end
        within = (n for n in self._wanted_ends if gone.first_event < n < gone.next_event)
        self._ends_gone.update(within)

    def _folder(self, found: FolderFiles) -> None:
        """Compare what its mark and metadata.yaml know; a leftover's hash must have come."""
        mark = found.mark
        damaged = {f.path for f in self.findings if f.severity is Severity.DAMAGE}
        marks = mark_findings(found, self.chain.next_event, self._marked)
        self.findings += [finding for finding in marks if finding.path not in damaged]
        damaged = {f.path for f in self.findings if f.severity is Severity.DAMAGE}
        is_all = len(self._closed) == sum(file.is_closed for file in found.segments)
        closed = self._closed if is_all else None
        for finding in bag_metadata_findings(found, closed):
            if finding.path not in damaged:
                last = None if mark is None else mark.next_event - 1
                lost = (self.chain.next_event, last) if finding.kind == "missing" else None
                self.findings.append(replace(finding, events=lost))
        damaged = {f.path for f in self.findings if f.severity is Severity.DAMAGE}
        for path, text in self._place.differences(self._entries):
            if path not in damaged:
                self._report(Finding("manifest", Severity.DAMAGE, path, None, None, text))
        for path, _ in self._merged.values():
            text = "its number is that of a merged segment, but its commits are not in that one"
            self.findings.append(Finding("duplicated", Severity.DAMAGE, path, None, None, text))

    def _check_head(self) -> None:
        if self._head is None:
            return
        if self._head_event is not None:
            if self._head_unvouched:
                self.findings.append(self._unvouched())
            return
        gone = self.chain.taken_out.commits
        or_gone = f", or it is of one of the {counted(gone, 'commit')} that were taken out"
        text = (
            f"expected a commit with the hash {self._head.hex()}, but the log ends with event "
            f"{self.chain.next_event - 1} and the head {self.chain.head.hex()}: its tail was "
            f"cut, or the log was rewritten{or_gone if gone else ''}"
        )
        self.findings.append(Finding("head", Severity.DAMAGE, self.path, None, None, text))

    def _unvouched(self) -> Finding:
        text = (
            f"not vouched for: {counted(self._head_unvouched, 'record')} of commits that lack some "
            "of theirs, before commits that are gone, or of keyframes there: this head does not "
            "bind them; an officer's signature does (`verify --public-key`)"
        )
        return Finding("taken-out", Severity.NOT_AS_SIGNED, self.path, None, None, text)

    def _check_trimming(self) -> None:
        """Compare what was taken out with what the log's last event about it states."""
        taken, told = self.chain.taken_out, self.trimming
        is_part = self.path == self.arrangement.segments[0].path
        if is_part or (told is None and not taken.reasons):
            return
        what = f"{counted(taken.events, 'event')} and {counted(taken.notes, 'note')}"
        digest = "" if told is None else told.tombstones.rpartition(":")[2]
        if told is not None and digest == taken.digest.hexdigest():
            text = f"{what} were taken out ({told.reasons}); the last time: {told.rule}"
            self.findings.append(Finding("trimmed", Severity.NOTE, self.path, None, None, text))
            return
        if told is not None and not digest:
            text = f"{what} were taken out, and that was not finished: {told.rule}; do it again"
            self.findings.append(Finding("trimmed", Severity.WARNING, self.path, None, None, text))
            return
        text = (
            f"{what} are gone, but the log does not record exactly this removal: another program "
            "removed or restored records"
        )
        self.findings.append(Finding("trimmed", Severity.DAMAGE, self.path, None, None, text))

    def _newer_finding(self) -> Finding:
        minor = max((header.minor for header in self.headers), default=0)
        text = f"a newer version of semmap-log has written to it (format {FORMAT_VERSION}.{minor})"
        if self.newer:
            what = ", ".join(f"{count} {kind}" for kind, count in self.newer.items())
            text += f"; unknown here: {what}: their bytes and their place were checked, no more"
        if self.has_unknown_changes:
            text += "; nor were keyframes after them"
        return Finding("newer", Severity.NOTE, self.path, None, None, text)

    def _result(self, found: FolderFiles) -> Verification:
        chain = self.chain
        header = next((f.header for f in found.segments if f.header is not None), None)
        since = None if self._head_event is None else chain.next_event - 1 - self._head_event
        self._ends[chain.next_event] = self._end
        return Verification(
            path=self.path,
            findings=tuple(sorted(self.findings, key=_weight)),
            log_id="" if header is None else header.info.log_id,
            segments=len(found.segments),
            commits=chain.commits,
            events=chain.events,
            keyframes=self._keyframes.compared,
            size=self._bytes,
            head=chain.head,
            events_after_head=since,
            ends=self._ends,
            first_event=self._first_event,
            next_event=chain.next_event,
            closed_before=self._closed_before,
            segment_ends=tuple(self._segment_ends),
            ends_gone=frozenset(self._ends_gone),
            taken_before=chain.unbound.before,
            trimming_before=self._trimming_before,
            events_gone=chain.taken_out.events,
            notes_gone=chain.taken_out.notes,
        )

    def _reread(self, place: keyframe_place.KeyframePlace) -> Iterator[Piece]:
        """Yield the chunks from a place on, which were read before and were whole."""
        for i in range(place.file, len(self.arrangement.segments)):
            file = self.arrangement.segments[i]
            with bytes_of(self._place, file) as data:
                for item in SegmentWalk(data, file.header_end, file.header):
                    at_or_after = i > place.file or (
                        isinstance(item, Piece) and item.stored.offset >= place.offset
                    )
                    if isinstance(item, Piece) and at_or_after:
                        yield item

    def _torn(self, start: int, end: int, text: str) -> None:
        behind = f"{counted(end - start, 'byte')} after the last whole commit: "
        lost = behind if end > start else ""
        finding = Finding("torn", Severity.TORN, self._current, start, None, f"{lost}{text}")
        self.findings.append(finding)

    def _damage(self, kind: str, offset: int | None, text: str) -> None:
        self._report(Finding(kind, Severity.DAMAGE, self._current, offset, None, text))

    def _report_all(self, flaws: Iterable[Flaw]) -> None:
        for flaw in flaws:
            self._damage(flaw.kind, flaw.offset, flaw.text)

    def _report(self, finding: Finding) -> None:
        self.findings.append(finding)


def _weight(finding: Finding) -> tuple[int, bool]:
    """Return what comes first: the worst, and what was taken out before other notes."""
    return -finding.severity, finding.kind != "trimmed"


def _log_of(told: HistoryTrimmed) -> str:
    """Return the id of the log that an event is about: imports bring those of others."""
    return told.tombstones.partition(":")[0]


def _flaws_of_merged(
    file: SegmentFile, data: FileBytes, chain: hash_chain.Chain
) -> list[Flaw | Gap]:
    """Take the chunks of a segment that was merged into another; return what is not as written."""
    if file.header is None:
        return [Flaw("header", 0, file.problem)]
    contents = closing.Contents(file.header_end, file.header)
    flaws: list[Flaw | Gap] = [Flaw("header", 0, file.problem)] if file.problem else []
    walk = SegmentWalk(data, file.header_end, file.header)
    for item in walk:
        if isinstance(item, Piece):
            chain.add(item)
            contents.add(item)
        else:
            flaws.append(item)
    contents.header = walk.header
    return flaws or list(closing.closing_flaws(data, walk.pieces_end, contents))


def _unusual(path: PurePath, offset: int) -> Finding:
    text = (
        "a chunk is compressed to other bytes than this zstd makes: another version wrote it, or "
        "a bit of it that means nothing is not as it was. Its records are as they were"
    )
    return Finding("compression", Severity.WARNING, path, offset, None, text)
