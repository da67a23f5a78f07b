"""A log to damage: a copy, who knows what it should say, and where its commits lie."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fault_injection.fault import Outcome, Plan
from fault_injection.judging import Judge, Verdict, WrongAnswerError
from semmap_log.store.form import COMMIT_CHANNEL, KEYFRAME_CHANNEL
from semmap_log.store.pages import Page
from semmap_log.store.reading.segment_reading import read_chunk
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.records import MAGIC

MOST_KEPT = 20
"""Logs on which something went wrong; more are alike."""
MOST_KEPT_BYTES = 2**27
"""A larger file is not kept."""
MARKS = ("closed.json", "closed-*-*.json")
"""What is written at each closing; the first as earlier versions named it."""
TELL_THE_END = (*MARKS, "metadata.yaml")
"""What tells, beside the segments, where a closed log ended."""


@dataclass(frozen=True)
class Subject:
    """A log to damage: a copy whose files may be written to, and who knows what it should say."""

    log: Path
    """Its folder; whoever damages it puts it in order again."""
    judge: Judge
    title: str
    """What it is, for messages."""
    places: tuple[tuple[int, int], ...]
    """Where each commit of the last segment lies: first byte, and first byte behind it."""

    @classmethod
    def of(
        cls, log: Path, folder: Path, title: str, *, last_commits: int = 1, told: bool = True
    ) -> Subject:
        """Copy a log into a folder.

        Args:
            log: One that is not damaged.
            folder: Where the copy is made.
            title: What it is.
            last_commits: How many commits at its end may be taken for a torn tail.
            told: Whether the copy keeps what tells where a closed log ended.
        """
        copy = folder / title / log.name
        shutil.copytree(log, copy, ignore=shutil.ignore_patterns(".lock"))
        if not told:
            remove_all(copy, TELL_THE_END)
        places = commit_places(max(copy.glob("*.mcap")))
        return cls(copy, Judge(log, last_commits=last_commits), title, places)

    @property
    def files(self) -> list[Path]:
        """Its segments, in order."""
        return sorted(self.log.glob("*.mcap"))

    @property
    def is_end_known(self) -> bool:
        """Whether its last segment is closed, and a mark tells so: it can lose nothing unseen.

        To be asked while nothing is damaged.
        """
        is_closed = self.files[-1].read_bytes().endswith(MAGIC)
        return is_closed and bool(marks_of(self.log))

    def outcome(
        self, plan: Plan, fault: str, judged: Callable[[], Verdict], log: Path | None = None
    ) -> Outcome:
        """Return what came of one damage; the log is kept if that was wrong.

        Args:
            plan: Says where such logs are kept.
            fault: What was done.
            judged: Judges the log.
            log: The damaged folder; default: its own.
        """
        checked = len(self.judge.truth[0]["commits"])
        what = f"{self.title} log, {fault}"
        try:
            judged()
        except WrongAnswerError as error:
            kept = keep(log or self.log, plan.keep, what)
            return Outcome(what, checked, error.lost, error.invented, str(error), kept)
        return Outcome(what, checked)


def keep(log: Path, where: Path, fault: str) -> Path | None:
    """Copy a damaged log to a folder that tells the fault; None if many are kept already."""
    kept = where / re.sub(r"[^\w.]+", "-", fault)
    if where.is_dir() and len(list(where.iterdir())) >= MOST_KEPT:
        return None
    with suppress(shutil.Error):  # a pipe, which is left out
        shutil.copytree(log, kept / log.name, dirs_exist_ok=True, symlinks=True, ignore=_huge_files)
    return kept


def _huge_files(folder: str, names: list[str]) -> list[str]:
    """Return the files that are not kept: who repeats the fault has them again."""
    paths = [Path(folder) / name for name in names]
    return [p.name for p in paths if p.is_file() and p.lstat().st_size > MOST_KEPT_BYTES]


def commit_places(path: Path) -> tuple[tuple[int, int], ...]:
    """Return where each commit's chunks lie in a segment, from the first to the last of them."""
    segment = open_segment(path)
    places, start = [], None
    for chunk in segment.chunks:
        heads = Page(read_chunk(segment, chunk), 0, segment.path).heads
        last = int(heads["channel_id"][-1])
        if last == KEYFRAME_CHANNEL:
            continue
        start = chunk.offset if start is None else start
        if last == COMMIT_CHANNEL:
            places.append((start, chunk.offset + chunk.length))
            start = None
    return tuple(places)


def marks_of(log: Path) -> list[Path]:
    """Return the files that tell how far a log reached when a segment was closed."""
    return [path for pattern in MARKS for path in log.glob(pattern)]


def remove_all(log: Path, patterns: tuple[str, ...]) -> None:
    """Remove a log's files of some names, or patterns of names."""
    for pattern in patterns:
        for path in log.glob(pattern):
            path.unlink()
