"""Opens a log after a fault: is all there that was promised, and nothing that nobody asked for?"""

from __future__ import annotations

import hashlib
import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

from steady_clock import SteadyClock

import semmap_log as sl
from fault_injection.fault import Outcome
from fault_injection.player import Tell, Told
from fault_injection.story import START_NS, Story, digest_of
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.commits import Commit
from semmap_log.errors import NotALogError, SemmapError
from semmap_log.interop.formats.files.thesis_yaml import read_thesis_yaml
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.door_log_writer import DoorLogWriter

HOUR_NS = 3600 * 10**9


def _silent(line: str) -> None:
    pass


class FoundError(Exception):
    """Something is wrong with a log; how many commits were lost or invented."""

    def __init__(self, problem: str, *, lost: int = 0, invented: int = 0) -> None:
        super().__init__(problem)
        self.lost = lost
        self.invented = invented


class Examiner:
    """Knows a story's wishes, and what each looks like in a log."""

    def __init__(self, story: Story) -> None:
        self._wishes = story.wishes
        self._digests = [wish.digest() for wish in story.wishes]
        self._known: dict[bytes, list[bytes]] = {}
        """Bytes of a log's events -> digest of each commit, so that the same is decoded once."""

    def examine(
        self, fault: str, folder: Path, told: Told, *, must: int, tell: Tell = _silent
    ) -> Outcome:
        """Return whether a log holds the first `must` wishes, and none beyond those asked.

        It is read, opened for writing (which recovers it), given the last wish that it holds once
        more and the next one, closed, and read again; `tell` hears what is promised meanwhile.
        """
        outcome = Outcome(fault, checked=must)
        try:
            stored = self.stored(folder, told, must=must)
            self._check_export(folder.parent / "out" / "doors.yaml", told)
            self.proceed(folder, stored, tell)
            after = self.stored(folder, replace(told, asked=stored + 1), must=stored + 1)
        except FoundError as error:
            return replace(outcome, lost=error.lost, invented=error.invented, problem=str(error))
        except Exception:  # noqa: BLE001 - whatever it is, the log did not survive
            return replace(outcome, problem=traceback.format_exc())
        assert after == stored + 1
        return outcome

    def stored(self, folder: Path, told: Told, *, must: int) -> int:
        """Return how many wishes a log holds.

        Raises:
            FoundError: Too few, too many, or other ones.
        """
        try:
            log = sl.read(folder)
            commits = list(log.commits())
            digests = self._event_digests(log, commits)
        except NotALogError as error:
            if must:
                raise FoundError(str(error), lost=must) from None
            return 0
        except SemmapError as error:
            raise FoundError(f"it does not open: {error}", lost=must) from error
        wrong = [
            number
            for number, (commit, digest) in enumerate(zip(commits, digests, strict=True))
            if not self._is_wish(number, commit, digest, told.asked)
        ]
        if wrong:
            problem = f"commits {wrong} of {len(commits)} are not those of the script"
            raise FoundError(problem, invented=len(wrong), lost=sum(n < must for n in wrong))
        if len(commits) < must:
            problem = f"expected the first {must} commits, got {len(commits)}"
            raise FoundError(problem, lost=must - len(commits))
        return len(commits)

    def _is_wish(self, number: int, commit: Commit, digest: bytes, asked: int) -> bool:
        if number >= min(asked, len(self._wishes)):
            return False
        wish = self._wishes[number]
        same = (commit.command_id, commit.count, commit.note) == (
            wish.command_id,
            len(wish.events),
            wish.note,
        )
        return same and digest == self._digests[number]

    def _event_digests(self, log: DoorLog, commits: Sequence[Commit]) -> list[bytes]:
        """Return what the events of each commit say."""
        batches = list(log.batches(retracted=True))
        key = _bytes_of(commits, batches)
        if key not in self._known:
            events = [recorded.event for batch in batches for recorded in batch]
            if len(events) != sum(commit.count for commit in commits):
                raise FoundError(f"{len(events)} events, but not so many in commits", invented=1)
            self._known[key] = [
                digest_of(tuple(events[commit.first_event : commit.last_event + 1]))
                for commit in commits
            ]
        return self._known[key]

    def proceed(self, folder: Path, stored: int, tell: Tell) -> None:
        """Append as one does after a crash: what may be stored already, and the next.

        Args:
            folder: The log's.
            stored: How many wishes it holds.
            tell: Hears what is promised.

        Raises:
            FoundError: The log cannot be continued, or a command is stored twice.
        """
        clock, entropy = SteadyClock(START_NS + HOUR_NS), Random(stored).randbytes
        try:
            if stored:
                log = sl.append(folder, clock=clock, entropy=entropy)
            else:
                log = _opened_or_made(folder, clock, entropy)
            with log:
                if stored:
                    last = self._wishes[stored - 1]
                    again = log.append(last.events, note=last.note, command_id=last.command_id)
                    if not again.repeated:
                        raise FoundError("a stored command is stored once more", invented=1)
                wish = self._wishes[stored]
                tell(f"asked {stored + 1}")
                log.append(wish.events, note=wish.note, command_id=wish.command_id)
                tell(f"durable {stored + 1}")
                state = repr(log.state.door_map())
            replayed = repr(sl.read(folder).replay())
        except SemmapError as error:
            raise FoundError(f"it cannot be continued: {error}") from error
        if state != replayed:
            raise FoundError("the writer's map is not the one that a replay gives")

    @staticmethod
    def _check_export(out: Path, told: Told) -> None:
        """Check that an exported file is whole: the last one, or the one that was being made."""
        if not out.exists():
            if told.exported:
                raise FoundError("an exported file is gone")
            return
        data = out.read_bytes()
        if told.exported and hashlib.sha256(data).hexdigest() == told.exported[-1]:
            return
        if told.exporting == len(told.exported):
            raise FoundError("an exported file is not what was exported")
        read_thesis_yaml(out)


def _opened_or_made(
    folder: Path, clock: SteadyClock, entropy: Callable[[int], bytes]
) -> DoorLogWriter:
    try:
        return sl.append(folder, clock=clock, entropy=entropy)
    except NotALogError:
        return sl.create(folder, tz="UTC", clock=clock, entropy=entropy)


def _bytes_of(commits: Sequence[Commit], batches: Sequence[EventBatch]) -> bytes:
    whole = hashlib.sha256()
    for commit in commits:
        whole.update(b"%d %d," % (commit.first_event, commit.count))
    for batch in batches:
        for column in (batch.number, batch.kind, batch.happened_ns):
            whole.update(column.tobytes())
        for _, rows in sorted(batch.columns.items()):
            whole.update(rows.tobytes())
        for _, events in sorted(batch.objects.items()):
            whole.update(digest_of(tuple(events)))
    return whole.digest()
