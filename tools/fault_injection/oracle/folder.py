"""A folder's files put together to one log, and what is wrong with it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from segment import Commit, SegmentFile, read_segment


@dataclass
class Log:
    """What the bytes of a folder say."""

    folder: Path
    segments: list[SegmentFile] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    @property
    def commits(self) -> list[Commit]:
        """Those of all segments, in order."""
        return [commit for segment in self.segments for commit in segment.commits]

    @property
    def events(self) -> list[dict[str, Any]]:
        """Those of all commits, in order."""
        return [event for commit in self.commits for event in commit.events]


def read_log(folder: Path) -> Log:
    """Read a log; nothing that is wrong with it raises, all of it stands in `problems`."""
    log = Log(folder)
    files = [read_segment(path) for path in sorted(folder.glob("*.mcap")) if path.is_file()]
    for file in files:
        log.problems += [f"{file.path.name}: {problem}" for problem in file.problems]
    whole = [file for file in files if file.head]
    ids = Counter(file.head["log_id"] for file in whole)
    if len(ids) > 1:
        log.problems.append(f"segments of {len(ids)} logs")
    if not whole:
        log.problems.append("no segment")
    _arrange(log, sorted(whole, key=lambda file: (file.number, -file.last_number)))
    return log


def _arrange(log: Log, files: list[SegmentFile]) -> None:
    """Put the files in order; one that is wholly in another is a leftover of a compaction."""
    for file in files:
        last = log.segments[-1] if log.segments else None
        expected = last.last_number + 1 if last else 0
        if last and file.last_number <= last.last_number and _is_in(file, last):
            continue
        if file.number != expected:
            log.problems.append(f"{file.path.name}: segment {file.number}, expected {expected}")
        if last:
            _check_follows(log, last, file)
        log.segments.append(file)


def _is_in(file: SegmentFile, whole: SegmentFile) -> bool:
    hashes = {commit.hash for commit in whole.commits}
    return file.path != whole.path and all(commit.hash in hashes for commit in file.commits)


def _check_follows(log: Log, last: SegmentFile, file: SegmentFile) -> None:
    if not last.closed:
        log.problems.append(f"{last.path.name}: not closed, and {file.path.name} follows it")
    if file.first_event != last.next_event:
        problem = f"begins with event {file.first_event}, expected {last.next_event}"
        log.problems.append(f"{file.path.name}: {problem}")
    elif file.head["hash_so_far"] != last.hash_at_end:
        log.problems.append(f"{file.path.name}: does not follow {last.path.name} by its hash")
