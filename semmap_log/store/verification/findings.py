"""What a verification found, as values.

Also which files of a folder make up a log, in which order, and which do not.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import Path, PurePath

from semmap_log.core.io.disk import TEMPORARY_SUFFIX
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import CorruptLogError, LogAccessError
from semmap_log.store import byte_layout
from semmap_log.store.bag_metadata import ClosedSegment, bag_metadata_text, listed_names
from semmap_log.store.closed_mark import ClosedMark
from semmap_log.store.folder import not_a_folder
from semmap_log.store.removed_part import RemovedPart
from semmap_log.store.verification.file_heads import SegmentFile, look_at
from semmap_log.store.verification.file_place import FilePlace


@dataclass(slots=True)
class FolderFiles:
    """The files of a log, sorted out."""

    place: FilePlace
    segments: list[SegmentFile] = field(default_factory=list)
    """In the order of their numbers."""
    leftovers: list[SegmentFile] = field(default_factory=list)
    """Segments that were merged into others and not removed yet."""
    missing: dict[int, int] = field(default_factory=dict)
    """Number of a segment after a gap -> the first number that is missing before it."""
    findings: list[Finding] = field(default_factory=list)
    removed: RemovedPart | None = None
    """Its beginning, if it lies in a store only."""
    mark: ClosedMark | None = None
    """How far it reached, as was known before the files were listed."""
    listed: frozenset[str] = frozenset()
    """What metadata.yaml named as closed before the files were listed."""

    @property
    def folder(self) -> PurePath:
        """Where they lie, for messages."""
        return self.place.path

    def has(self, number: int) -> bool:
        """Return whether a segment exists for that number."""
        return any(s.number <= number <= s.last_number for s in self.segments)

    def lacks(self, number: int) -> bool:
        """Return whether segments that follow show that this one is missing."""
        return any(first <= number < behind for behind, first in self.missing.items())


def arrange(place: FilePlace) -> FolderFiles:
    """Return the segments of a log's folder, or of a single file.

    Raises:
        LogAccessError: Something cannot be read.
        LogError: It is of another format version.
        Vanished: A file was removed during that.
    """
    path, found = place.path, FolderFiles(place)
    if path.suffix == ".mcap" and not place.is_folder():
        one = look_at(place, path)
        found.segments = [one] if one else []
        if one is None:
            found.findings.append(_alien(path, "not a segment of a semmap log"))
        return found
    if not place.is_folder():
        text = "no such log: expected a folder, or one .mcap file"
        if isinstance(path, Path) and path.is_file():
            text = not_a_folder(path).removeprefix(f"{path}: ")
        found.findings.append(_alien(path, text))
        return found
    found.mark = _mark(found)
    found.listed = frozenset(listed_names(place.bag_metadata() or ""))
    try:
        names = sorted(place.files())
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    found.findings += [_damage("manifest", name, text) for name, text in place.flaws()]
    looked = {name: look_at(place, name) for name in names if name.suffix == ".mcap"}
    ours = [one for one in looked.values() if one is not None]
    for name in (name for name, one in looked.items() if one is None):
        if any(_has_name_of_part(name, one) for one in ours):
            found.findings.append(merged_finding(name, is_whole=False))
        else:
            text = "a foreign file: no segment of a semmap log; move it elsewhere"
            found.findings.append(_damage("foreign", name, text))
    if not ours:
        found.findings = [_alien(path, "no segment of a semmap log is in this folder")]
        return found
    found.findings += _notes(names)
    _sort_out(found, ours)
    _take_removed(found)
    return found


def _take_removed(found: FolderFiles) -> None:
    """Separate what was removed on purpose from what is missing: the rest must begin at its end."""
    try:
        part = found.place.removed()
    except CorruptLogError as error:
        found.findings.append(_damage("removed", error.path, error.problem))
        return
    first = found.segments[0]
    if part is None or first.header is None or first.number == 0:
        return
    told = next(
        (s.shipped for s in part.segments if s.shipped.header.last_number == first.number - 1), None
    )
    if told is None or set(found.missing) - {first.number}:
        return
    ours = (first.header.info, first.header.first_event, first.header.hash_so_far)
    if ours != (told.header.info, told.next_event, told.head):
        removed = byte_layout.REMOVED_NAME
        text = f"it does not begin where the segments in {removed} end: one is of another copy"
        found.findings.append(_damage("removed", first.path, text))
        return
    del found.missing[first.number]
    found.removed = part
    many = sum(one.shipped.header.last_number < first.number for one in part.segments)
    text = (
        f"{counted(many, 'segment')}, to event {told.next_event - 1}, were removed here once they "
        f"were shipped; they were not verified now: {command_line('verify', part.url)}"
    )
    path = found.folder / byte_layout.REMOVED_NAME
    found.findings.append(
        Finding("removed", Severity.NOTE, path, None, (0, told.next_event - 1), text)
    )


def bag_metadata_findings(found: FolderFiles, closed: list[ClosedSegment] | None) -> list[Finding]:
    """Compare metadata.yaml with the closed segments; it is a cache, but it knows what there was.

    What it names only now was closed while the files were read, and is no evidence against them.
    Nor is what it names in a log that has a mark: `cp -r` may copy it later than the segments.

    Args:
        found: The log's files.
        closed: What their own bytes say of the closed segments; None: not all can be read.
    """
    listing = BAG_METADATA_NAME
    path, text = found.folder / listing, found.place.bag_metadata()
    findings: list[Finding] = []
    if text is None:
        return findings
    for name in listed_names(text):
        if name not in found.listed or found.mark is not None:
            continue
        number = byte_layout.number_in(name)
        present = next((s for s in found.segments if s.path.name == name), None)
        if present is not None and not present.is_closed:
            problem = f"{listing} names it as closed, but no footer ends it: it was cut"
            findings.append(_damage("shortened", present.path, problem))
        is_known = number is None or found.has(number) or found.lacks(number)
        if present is None and not is_known:
            problem = f"{listing} names it, but it is missing: the log's tail was cut"
            findings.append(_damage("missing", found.folder / name, problem))
    expected = bag_metadata_text(closed) if closed else ""
    if closed is not None and text != expected and not findings:
        problem = (
            f"{listing}, which other tools use to open the folder, does not describe the "
            "closed segments; the next writer rewrites it"
        )
        findings.append(Finding("metadata", Severity.WARNING, path, None, None, problem))
    return findings


def mark_findings(found: FolderFiles, next_event: int, head: bytes | None) -> list[Finding]:
    """Compare how far the log reached, as its last mark states, with how far it reaches.

    Args:
        found: The log's files.
        next_event: The number after its last event.
        head: Hash of its commit that ends where the mark says; None: none ends there.
    """
    mark = found.mark
    if mark is None:
        return []
    path, last = found.folder / mark.file, found.segments[-1]
    if last.header is not None and last.header.info.log_id != mark.log_id:
        text = f"expected this log's id, got {mark.log_id}"
        return [_damage("mark", path, text)]
    if next_event < mark.next_event:
        where = last.path if last.last_number >= mark.segment else path
        text = (
            f"the log's last segment that was closed ended before event {mark.next_event} "
            f"({mark.file}), and now all ends before event {next_event}: a segment was "
            "cut, is missing, or is an older state of itself"
        )
        lost = (next_event, mark.next_event - 1)
        return [Finding("shortened", Severity.DAMAGE, where, None, lost, text)]
    if mark.next_event and head is not None and head.hex() != mark.head:
        text = (
            f"the commit before event {mark.next_event} is not the one in {mark.file}: "
            "one of the two is of another copy of this log"
        )
        return [_damage("mark", last.path, text)]
    return []


def _mark(found: FolderFiles) -> ClosedMark | None:
    try:
        return found.place.mark()
    except CorruptLogError as error:
        found.findings.append(_damage("mark", error.path, error.problem))
        return None


def _sort_out(found: FolderFiles, ours: list[SegmentFile]) -> None:
    """Separate the log's segments from those of other logs, leftovers and copies."""
    ids = Counter(f.header.info.log_id for f in ours if f.header is not None)
    log_id = max(ids, key=lambda one: ids[one], default="")
    last: SegmentFile | None = None
    for file in sorted(ours, key=lambda f: (f.number, -f.last_number, f.path.name)):
        if file.header is not None and file.header.info.log_id != log_id:
            other = file.header.info.log_id
            text = f"of another log: expected the log id {log_id}, got {other}; move it elsewhere"
            found.findings.append(_damage("foreign", file.path, text))
            continue
        if last is not None and file.number <= last.last_number:
            _add_second(found, file, last)
            continue
        expected = 0 if last is None else last.last_number + 1
        if file.number > expected:
            found.missing[file.number] = expected
        if file.header is not None and file.named_number not in (None, file.number):
            text = (
                f"its name says segment {file.named_number}, its header segment {file.number}: "
                "it was renamed, or two files were swapped"
            )
            found.findings.append(_damage("name", file.path, text))
        found.segments.append(file)
        last = file


def _add_second(found: FolderFiles, file: SegmentFile, last: SegmentFile) -> None:
    """Take in a file whose number another one has, or stands for."""
    is_inside = (file.number, file.last_number) != (last.number, last.last_number)
    if file.header is None:
        is_inside = _has_name_of_part(file.path, last)
    if is_inside and file.last_number <= last.last_number:
        found.leftovers.append(file)
        return
    text = f"segment {file.number} is there twice: {last.path.name} has it, too"
    found.findings.append(_damage("duplicated", file.path, text))


def _has_name_of_part(path: PurePath, whole: SegmentFile) -> bool:
    """Return whether a file has the name of a segment that was merged into that one."""
    if whole.header is None:
        return False
    return byte_layout.is_named_as_part(path.name, whole.path.name, whole.number, whole.last_number)


def merged_finding(path: PurePath, *, is_whole: bool) -> Finding:
    """Return the finding about a segment that was merged into another."""
    text = "was merged into another segment; the next writer removes it"
    if is_whole:
        return Finding("leftover", Severity.NOTE, path, None, None, text)
    text = f"{text}; its own bytes are damaged, which costs nothing"
    return Finding("leftover", Severity.WARNING, path, None, None, text)


def _notes(names: list[PurePath]) -> list[Finding]:
    """Return the harmless files next to the segments."""
    findings = []
    for path in names:
        if byte_layout.TORN_SUFFIX in path.name:
            text = "a torn tail that a crash left after the last whole commit; you may remove it"
        elif path.name.startswith(".") and path.name.endswith(TEMPORARY_SUFFIX):
            text = "a file that a writer did not finish; the next one removes it"
        elif path.name == byte_layout.RECOVERING_NAME:
            line = command_line("recover", path.parent)
            text = f"a recovery was interrupted at its last step; to finish it: {line}"
        else:
            continue
        findings.append(Finding("leftover", Severity.NOTE, path, None, None, text))
    return findings


def _alien(path: PurePath, text: str) -> Finding:
    return Finding("not a log", Severity.NOT_A_LOG, path, None, None, text)


def _damage(kind: str, path: PurePath, text: str) -> Finding:
    return Finding(kind, Severity.DAMAGE, path, None, None, text)


EXIT_GOOD, EXIT_TORN, EXIT_DAMAGE, EXIT_NOT_A_LOG, EXIT_UNSIGNED = 0, 3, 4, 5, 6


class Severity(IntEnum):
    """How bad a finding is, from the harmless up."""

    NOTE = 0
    """Good to know: a suspect clock, a kept tail."""
    WARNING = 1
    """A cache is not as it should be; the log itself is."""
    TORN = 2
    """An unfinished end, as a crash leaves it; the next writer puts it in order."""
    UNSIGNED = 3
    """Events after all that is signed, or that the signer found there; nothing speaks against."""
    NOT_AS_SIGNED = 4
    """No signature vouches for it, or one says otherwise; each byte may fit the others."""
    DAMAGE = 5
    """Bytes are not what was written, or are missing."""
    NOT_A_LOG = 6
    """There is nothing of ours at that path."""


_EXIT_CODES = {
    Severity.TORN: EXIT_TORN,
    Severity.UNSIGNED: EXIT_UNSIGNED,
    Severity.NOT_AS_SIGNED: EXIT_DAMAGE,
    Severity.DAMAGE: EXIT_DAMAGE,
    Severity.NOT_A_LOG: EXIT_NOT_A_LOG,
}


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is not as it should be, or worth to know."""

    kind: str
    """One word for machines: `chunk`, `chain`, `missing`, `keyframe`, `clock` …"""
    severity: Severity
    path: PurePath
    offset: int | None
    """Where in the file; None: it is about the file as a whole."""
    events: tuple[int, int | None] | None
    """First and last number of the events it is about; last None: it cannot be known; None: it
    is about no event."""
    text: str
    """What was expected, what was found, and what to do."""


@dataclass(frozen=True, slots=True)
class CommitEnd:
    """Where a commit ends, and a log might."""

    head: bytes
    """Its hash: the head of a log that ends here."""
    commits: int
    """Up to here, of those that were read, with those that were taken out on purpose."""
    recorded_ns: int | None = None
    """When it was recorded; None: no commit before it was read, or it was taken out."""
    taken: bytes = b""
    """Digest of what no hash binds, up to here: `store.header`."""
    unvouched: int = 0
    """How many records up to here this head does not bind, since records were taken out."""


@dataclass(frozen=True, slots=True)
class Verification:
    """What reading every byte of a log has shown."""

    path: PurePath
    findings: tuple[Finding, ...]
    """The worst first; of equal ones in the order of the log."""
    log_id: str = ""
    segments: int = 0
    commits: int = 0
    """That are whole and in their place."""
    events: int = 0
    """In those commits."""
    keyframes: int = 0
    """That were compared with the replay."""
    size: int = 0
    """Bytes that were read."""
    head: bytes = byte_layout.NO_HASH
    """Hash of the last commit: kept elsewhere, it proves that nothing was cut off."""
    events_after_head: int | None = None
    """How many events came after the given head; None: none was given, or it was not found."""
    ends: Mapping[int, CommitEnd] = field(default_factory=dict)
    """The number after a commit's last event -> that end; the first, the last, and the
    requested ones."""
    first_event: int = 0
    """With which the reading began."""
    next_event: int = 0
    """The number after the last event."""
    closed_before: int = 0
    """Events below this number lie in closed segments."""
    segment_ends: tuple[int, ...] = ()
    """The number after the last event of each closed segment; `ends` has them, too."""
    ends_gone: frozenset[int] = frozenset()
    """Of the requested ends: those within whole commits that were taken out."""
    taken_before: int = 0
    """Number of the first event after all that was taken out; 0: nothing was."""
    trimming_before: int = 0
    """The number after the last event that records a trimming; 0: none does."""
    events_gone: int = 0
    """That were taken out on purpose."""
    notes_gone: int = 0

    @property
    def exit_code(self) -> int:
        """Return 0 good, 3 torn tail, 4 damage or not as signed, 5 not a log, 6 unsigned end."""
        worst = max((finding.severity for finding in self.findings), default=Severity.NOTE)
        return _EXIT_CODES.get(worst, EXIT_GOOD)

    def moved(self, source: PurePath, target: PurePath) -> Verification:
        """Return the same of a folder that people know by another path."""
        findings = tuple(
            replace(finding, path=target / finding.path.relative_to(source))
            for finding in self.findings
        )
        return replace(self, path=target, findings=findings)

    def of(self, *severities: Severity) -> list[Finding]:
        """Return the findings of these severities."""
        return [finding for finding in self.findings if finding.severity in severities]
