"""A door map's log, as a program uses it: query any moment, and append one commit at a time.

with sl.create("office", tz="Europe/Vienna") as log:
    door = log.add_door(x=2.0, y=1.5, theta=0.0, width=0.9, state="closed", actor="survey")
    log.observe(door, "open", accuracy=0.9)

sl.read("office").replay(at="2026-03-01T12:00").doors[door].state
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator
from itertools import dropwhile
from pathlib import Path, PurePath
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent, Retractions
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.projection import SAVE_EVERY_S, Projection
from semmap_log.core.io.progress import Progress
from semmap_log.core.io.url_path import place_of
from semmap_log.core.late_answers import answer_of
from semmap_log.core.model import events, moments
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.doors import DOOR, DoorId, DoorMap, ObjectClass, ShownAsTable
from semmap_log.core.model.moments import NEAR_NS, Time, check_time_unit, moment_of
from semmap_log.core.texts import counted
from semmap_log.errors import ClockTimeWarning, LogError, MomentError
from semmap_log.log.door_log.queries import LogQueries, LogTables
from semmap_log.log.replay.replay import Scope, replay, visible_batches
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import LogInfo
from semmap_log.store.pages import EVENT_BITS, kinds_mask
from semmap_log.store.reading.reader import LogReader, OnPage
from semmap_log.store.reading.window import EVERYTHING, Window

if TYPE_CHECKING:
    from typing_extensions import Self

    from semmap_log.core.folds.early_events import EarlyEvents
    from semmap_log.core.folds.explanation import Explanation
    from semmap_log.core.folds.history import Diff, HistoryEntry
    from semmap_log.core.folds.timeline import Timeline
    from semmap_log.log.door_log.summary import LogSummary
    from semmap_log.log.replay.live_fold import LiveState
    from semmap_log.store.reading.commit_finder import CommitFinder
    from semmap_log.store.reading.following import FollowedCommit
    from semmap_log.store.reading.segment_reading import NoteFinder

S = TypeVar("S")
PIN = "pin:"
"""Prefix of the name of a pinned moment, where a time is given."""


class DoorLog(LogTables, LogQueries, ShownAsTable):
    """A log that is read: as it was when it was opened, or last refreshed."""

    has_warned_of_clock = False
    """Whether a warning was given that its clock was not set at some time: see `clock_warnings`."""

    def __init__(self, path: str | PurePath | LogFolder | LogReader) -> None:
        """Open a log for reading; needs no lock, no write access and no free space.

        A relative path is resolved at once: `os.chdir` changes nothing about it.

        Args:
            path: Its folder, or a URL of a store (`s3://…`, `gs://…`,
                `az://…`, `https://…`); or what has read it already.

        Raises:
            NotALogError: There is no log at that path.
            CorruptLogError: It is damaged.
        """
        if not isinstance(path, LogReader):
            path = LogReader(path if isinstance(path, LogFolder) else place_of(path))
        self._opened = path
        self.path = self._opened.given
        self._refreshing = threading.Lock()
        self._end_ns: int | None = None

    def __repr__(self) -> str:
        try:
            said = counted(self._reader.last_event() + 1, "event")
            spans = [one.span for one in self._reader.segments if len(one.chunks)]
            if spans:
                ends = min(first for first, _ in spans), max(last for _, last in spans)
                said += ", {} to {}".format(
                    *(moments.format_short(ns, self.info.timezone) for ns in ends)
                )
        except LogError:
            said = "damaged"
        return f"<{type(self).__name__} {str(self._reader.folder)!r}: {said}>"

    @property
    def info(self) -> LogInfo:
        """Log id, zone, building and robot: fixed, so that asking costs nothing."""
        return self._opened.info

    @property
    def _reader(self) -> LogReader:
        """The bytes underneath: segments, pages, commits."""
        return self._opened

    def refresh(self) -> None:
        """Take in what was written since the log was opened."""
        with self._refreshing:  # or a slow thread would put back what a fast one has seen pass
            self._opened = self._opened.refreshed()
            self._end_ns = None

    def replay(
        self,
        at: Time = None,
        known_at: Time = None,
        event: int | None = None,
        *,
        progress: Progress | None = None,
    ) -> DoorMap:
        """Return the door map at a moment; without arguments: now.

        Args:
            at: What was true then, with all that is known today.
            known_at: Only what had been recorded by then, whole commits.
            event: Only what has a number up to that.
            progress: Called with the progress of the reading.

        Raises:
            MomentError: A time cannot be read.
            LogError: There is no event of that number.
        """
        scope = self.scope(at, known_at, event)
        state = replay(self._reader, scope, progress=progress)
        return state.door_map(at_ns=scope.at_ns, known_at_ns=scope.known_at_ns)

    def fold(
        self,
        projection: Projection[S],
        at: Time = None,
        known_at: Time = None,
        event: int | None = None,
        *,
        checkpoint: str | Path | None = None,
        save_every_s: float = SAVE_EVERY_S,
        progress: Progress | None = None,
    ) -> S:
        """Return the state that a projection of yours makes of the events up to a moment.

        Args:
            projection: A class with `initial()` and `apply(state, batch)`: see `Projection`.
            at: What was true then, with all that is known today.
            known_at: Only what had been recorded by then, whole commits.
            event: Only what has a number up to that.
            checkpoint: A file to resume from, and to save to: see `log.replay.state`.
            save_every_s: How often it is saved at most, before the end.
            progress: Called with the progress of the reading.

        Raises:
            CheckpointError: The file is of something else, or the state cannot be stored in one.
            OutputError: It cannot be written.
        """
        from semmap_log.log.replay.replay import fold

        return fold(
            self._reader,
            projection,
            self.scope(at, known_at, event),
            checkpoint=None if checkpoint is None else Path(checkpoint),
            save_every_s=save_every_s,
            progress=progress,
        )

    def fold_part(
        self, projection: Projection[S], first: int, last: int, *, known_event: int | None = None
    ) -> S:
        """Return the state that a part of the log makes: events `first` to `last`, inclusive.

        Where the projection can `merge`, the states of parts, made by as many processes, make that
        of the whole log.

        Args:
            projection: The fold.
            first: Number of the first event that counts.
            last: Of the last one.
            known_event: Retractions count up to this event, wherever they are; None: as they are
                known now. Processes that open a log one after the other want the same number.
        """
        from semmap_log.log.replay.replay import fold_part

        return fold_part(self._reader, projection, first, last, known_event=known_event)

    def fold_live(
        self,
        projection: Projection[S],
        *,
        checkpoint: str | Path | None = None,
        save_every_s: float = SAVE_EVERY_S,
        poll_s: float = 0.1,
        stop: Callable[[], bool] | None = None,
    ) -> Iterator[LiveState[S]]:
        """Yield a projection's state now, then after each commit, or those that came together.

        It continues as `follow` does; a retraction of folded events folds the log again. What this
        object answers stays as it was opened.

        Args:
            projection: As for `fold`.
            checkpoint: A file to go on from, and to save to.
            save_every_s: How often it is saved at most, before the end.
            poll_s: How long to wait before looking again.
            stop: Called before each look; once it returns True, what is there then is the end.

        Raises:
            CheckpointError: The file is of something else, or the state cannot be stored in one.
            OutputError: It cannot be written.
            CorruptLogError: The log is damaged, or was exchanged for another state of itself.
            LogError: Another log lies there now.
        """
        from semmap_log.log.replay.live_fold import fold_live

        return fold_live(
            self._opened.anew(),
            projection,
            checkpoint=None if checkpoint is None else Path(checkpoint),
            save_every_s=save_every_s,
            poll_s=poll_s,
            stop=stop,
        )

    def batches(
        self,
        since: Time = None,
        until: Time = None,
        *,
        recorded: bool = False,
        doors: Collection[DoorId | str] | None = None,
        kinds: Collection[type[events.Event] | str] | None = None,
        retracted: bool = False,
        progress: Progress | None = None,
    ) -> Iterator[EventBatch]:
        """Yield events as numpy columns, numbers ascending, about a MiB of the log at a time.

        Args:
            since: From then on (happened time).
            until: Before then.
            recorded: The range is of recorded time.
            doors: Only events about these doors: ids, names, or level/names.
            kinds: Only these kinds: classes, or their names.
            retracted: Retracted events, too.
            progress: Called with the progress of the reading.

        Raises:
            UnknownDoorError: No door has such a name, or ever had.
        """
        from semmap_log.log.replay.read_model.events_about import events_about

        reader = self._reader
        ids = None if doors is None else self._ids_or_removed(doors)
        window = self.window(since, until, recorded=recorded, kinds=kinds)
        known = reader.retractions()
        retractions = Retractions() if retracted else known
        for batch in events_about(reader, window, ids, progress=progress):
            visible = retractions.visible(batch)
            if len(visible):
                yield visible

    def window(
        self,
        since: Time = None,
        until: Time = None,
        *,
        recorded: bool = False,
        kinds: Collection[type[events.Event] | str] | None = None,
    ) -> Window:
        """Return the bounds that these moments mean; `event:12` bounds the numbers.

        The number after the log's last event is taken, too: a range can begin or end there.

        Args:
            since: From then on.
            until: Before then.
            recorded: The range is of recorded time.
            kinds: Only these kinds: classes, or their names.

        Raises:
            MomentError: A time cannot be read.
            LogError: There is no event of that number.
        """
        first, last = (
            self.known_moment(time) if recorded else self.moment(time) for time in (since, until)
        )
        for bound in (first, last):
            self._check_is_there(bound.event, after_last=1)
        return Window(
            happened_from_ns=None if recorded else first.ns,
            happened_before_ns=None if recorded else last.ns,
            recorded_from_ns=first.ns if recorded else None,
            recorded_before_ns=last.ns if recorded else None,
            first_event=first.event,
            before_event=last.event,
            kinds=EVENT_BITS if kinds is None else kinds_mask(events.kinds_meant(kinds)),
        )

    def commits(self, first_event: int = 0) -> Iterator[Commit]:
        """Yield the commits that have an event from that number on, in order, with their notes."""
        if not first_event:
            return self._reader.commits()
        found = self._reader.commits(self._reader.segment_of(first_event) or 0)
        return dropwhile(lambda commit: commit.last_event < first_event, found)

    def follow(
        self,
        after: int | None = None,
        *,
        poll_s: float = 0.1,
        stop: Callable[[], bool] | None = None,
        with_newer: bool = False,
    ) -> Iterator[FollowedCommit]:
        """Yield commits as they are written, each with its events: no gap, no repeat.

        It continues over new segments, recoveries, compactions and other writers, and while nothing
        is written; commits come when they are whole. What this object answers stays as it was
        opened.

        Args:
            after: Number of the last event that is known already; -1: from the log's beginning;
                None: from its end, as it was opened.
            poll_s: How long to wait before looking again.
            stop: Called before each look; once it returns True, what is there then is the end.
            with_newer: Yield events of kinds that a later version has added, too.

        Raises:
            NewerLogError: A commit has an event of such a kind that may change others.
            CorruptLogError: The log is damaged, or was exchanged for another state of itself.
            LogError: Another log lies there now.
        """
        from semmap_log.store.reading.following import follow

        if after is None:
            after = self._reader.last_event()
        reader = self._opened.anew()
        return follow(reader, after, poll_s=poll_s, stop=stop, with_newer=with_newer)

    def state_in(self, scope: Scope = Scope(), *, progress: Progress | None = None) -> DoorMapState:
        """Return the fold of a scope, to look at and to fold on; without a bound: of now.

        Args:
            scope: Which events count: see `scope`.
            progress: Called with the progress of the reading.

        Raises:
            NewerLogError: An event of an unknown kind may have changed it.
        """
        return replay(self._reader, scope, progress=progress)

    def visible_batches(
        self,
        scope: Scope = Scope(),
        *,
        doors: Collection[DoorId] | None = None,
        progress: Progress | None = None,
    ) -> Iterator[EventBatch]:
        """Yield the events of a scope, without those retracted by what is known in it.

        Args:
            scope: Which events count: see `scope`.
            doors: Only those about these doors; None: all.
            progress: Called with the progress of the reading.
        """
        return visible_batches(self._reader, scope, progress=progress, doors=doors)

    def batches_in(
        self,
        window: Window = EVERYTHING,
        *,
        progress: Progress | None = None,
        on_page: OnPage | None = None,
    ) -> Iterator[EventBatch]:
        """Yield the events of a window, numbers ascending, retracted ones included.

        Args:
            window: Which events: see `window`; default: all.
            progress: Called with the progress of the reading.
            on_page: Called with the records of each batch that follows: see `note_finder`.
        """
        return self._reader.batches(window, progress=progress, on_page=on_page)

    def note_finder(self) -> NoteFinder:
        """Return what finds who and why of events; quick if its `look_at` is given each page."""
        from semmap_log.store.reading.segment_reading import NoteFinder

        return NoteFinder(self._reader.commit_at)

    def commit_finder(self) -> CommitFinder:
        """Return what finds the commits of events; quick if its `look_at` is given each page."""
        from semmap_log.store.reading.commit_finder import CommitFinder

        return CommitFinder(self._reader)

    def retractions(self, limit: int | None = None) -> Retractions:
        """Return what was taken back, by the events up to the number `limit`; None: by all.

        Raises:
            NewerLogError: An event of an unknown kind may have taken back others, too.
        """
        return self._reader.retractions(limit=limit)

    def limit_of(self, scope: Scope) -> int | None:
        """Return the greatest event number that counts in a scope; None: all count."""
        return scope.limit(self._reader)

    def horizon(self) -> int:
        """Return the number of the first event that is kept; 0: all are, as far as age goes."""
        return self._reader.horizon

    def horizon_ns(self) -> int:
        """Return the earliest moment that can be queried; -1: any."""
        return self._reader.horizon_ns

    def shown_from_ns(self, since_ns: int | None, until_ns: int | None) -> int | None:
        """Return from when on events of a span are shown: by default from the log's horizon on.

        It is None in a log without a horizon if no start is requested: before the first event.

        The state at the horizon opens what is shown. A warning states that earlier events are gone.

        Args:
            since_ns: From then on; None: not requested.
            until_ns: Before then; None: to the log's end.

        Raises:
            HorizonError: The span begins, or ends, before the horizon.
        """
        self._reader.check_horizon(Window(happened_from_ns=since_ns, happened_before_ns=until_ns))
        return self._reader.horizon_ns + 1 if since_ns is None and self.horizon() else since_ns

    def last_event(self) -> int:
        """Return the number of the log's last event; -1: there is none."""
        return self._reader.last_event()

    def find_commit(self, number: int) -> Commit | None:
        """Return the commit that holds an event, with its note; None: there is no such event."""
        return self._reader.find_commit(number)

    def size(self) -> int:
        """Return how many bytes its files have."""
        return sum(segment.size for segment in self._reader.segments)

    def is_live(self) -> bool:
        """Return whether its last file is not closed yet: somebody is writing, or was cut off."""
        return not self._reader.segments[-1].closed

    def happened_span(self) -> tuple[int, int] | None:
        """Return when its events happened, at the earliest and at the latest; None: it has none."""
        spans = [segment.span for segment in self._reader.segments if segment.span[1] >= 0]
        return (min(s[0] for s in spans), max(s[1] for s in spans)) if spans else None

    def commits_after(self, event: int, *, with_newer: bool = False) -> Iterator[FollowedCommit]:
        """Yield the commits that the log has after an event, each with its events.

        Args:
            event: Its number; -1: from the log's beginning.
            with_newer: Yield events of kinds that a later version has added, too.

        Raises:
            NewerLogError: A commit has an event of such a kind that may change others.
        """
        from semmap_log.store.reading.following import commits_after

        return commits_after(self._reader, event, with_newer=with_newer)

    def kept_commits(self, scope: Scope = Scope()) -> Iterator[FollowedCommit]:
        """Yield the commits of a scope, and what stands for those that the log no longer keeps.

        Raises:
            NewerLogError: A commit has an event of an unknown kind that may change others.
            HorizonError: The scope ends before the horizon.
        """
        from semmap_log.log.replay.replay import kept_commits

        limit = self.limit_of(scope)
        self._reader.check_known(limit)
        return kept_commits(self._reader, at_ns=scope.at_ns, limit=limit)

    def last_patrol(self, kind: type[events.PatrolStarted | events.PatrolFinished]) -> int:
        """Return the greatest number of a round that began, or ended; 0: none did."""
        from semmap_log.log.door_log.last_patrol import last_patrol

        return last_patrol(self._reader, kind)

    def early_events(self) -> EarlyEvents:
        """Return the events from before their door was added, which no answer counts."""
        from semmap_log.log.door_log.summary import early_events

        return early_events(self._reader)

    def before_first_ns(self) -> int | None:
        """Return a whole second before the earliest event; None: the log has none."""
        from semmap_log.log.door_log.summary import before_first_ns

        return before_first_ns(self._reader)

    def backdated(self, doors: Collection[DoorId], since_ns: int) -> list[events.Event]:
        """Return the events of one commit by which doors are in the map from an earlier time on."""
        from semmap_log.log.door_log.summary import backdated

        return backdated(self._reader, doors, since_ns)

    def summary(self, *, progress: Progress | None = None) -> LogSummary:
        """Return what the log holds, in a page; reads all of it."""
        from semmap_log.log.door_log.summary import summarize

        return summarize(self._reader, progress=progress)

    def reopened_log(self) -> DoorLog:
        """Return the log as it is on the disk now; this object stays as it was opened."""
        return DoorLog(self._opened.anew())

    def event(self, number: int) -> RecordedEvent:
        """Return the event of that number.

        Raises:
            LogError: There is no such event.
        """
        return self._reader.event(number)

    def history(
        self,
        door: DoorId | str | None = None,
        since: Time = None,
        until: Time = None,
        *,
        recorded: bool = False,
        kinds: Collection[type[events.Event] | str] | None = None,
        object_class: str | None = None,
    ) -> Iterator[HistoryEntry]:
        """Yield events with who did it and why, retracted ones marked; since <= happened < until.

        Those of kinds that a later version has added are of the class `UnknownEvent`. What they
        may have changed of others (a door's state, or that an event counts) is not shown.

        Args:
            door: Only events about it (its id, name, or level/name), and those unknown here;
                default: all events.
            since: From then on.
            until: Before then.
            recorded: The range is of recorded time.
            kinds: Only these kinds: classes, or their names.
            object_class: Only events about objects of that class, where no door is named.
        """
        from semmap_log.log.door_log.last_patrol import entries

        window = self.window(since, until, recorded=recorded, kinds=kinds)
        doors = None if object_class is None else self.ids_of_class(object_class)
        return entries(
            self._reader, window, doors if door is None else self._ids_or_removed([door])
        )

    def entry(self, number: int) -> HistoryEntry:
        """Return one event with who did it and why.

        Raises:
            LogError: There is no such event.
        """
        from semmap_log.log.door_log.last_patrol import entries

        for entry in entries(self._reader, self._reader.window_of(number)):
            return entry
        raise self._reader.no_event(number)

    def entry_or_state(self, number: int) -> HistoryEntry:
        """Return the same; of an event that is no longer kept, what is left of it at the horizon.

        That is an update with what it wrote of its door and no other event wrote since. When it was
        recorded is not known: as if it had been when it happened.

        Raises:
            LogError: There is no such event, or nothing is left of it.
        """
        if number >= self._reader.horizon:
            return self.entry(number)
        from semmap_log.core.folds.history import HistoryEntry
        from semmap_log.log.replay.state import last_writes

        left = [one for one in last_writes(self._reader) if one.number == number]
        if not left:
            return self.entry(number)
        event, happened_ns = left[0].event, left[0].happened_ns
        return HistoryEntry(number, event, happened_ns, happened_ns, reason="no longer kept")

    def diff(self, first: Time, second: Time) -> Diff:
        """Return what is different at the second moment, and the events that did it.

        The events are those with first < happened <= second, retracted ones left out.

        Raises:
            MomentError: The first comes after the second.
        """
        from semmap_log.core.folds.history import diff
        from semmap_log.log.door_log.last_patrol import between, comes_after, entries

        start, end = self.moment(first), self.moment(second)
        if comes_after(start, end):
            raise MomentError("the first moment lies after the second; swap them.")
        before, after = self.replay(at=start), self.replay(at=end)
        told = entries(self._reader, between(start, end), with_newer=False)
        return diff(before, after, [entry for entry in told if not entry.retracted])

    def why(
        self,
        door: DoorId | str,
        at: Time = None,
        known_at: Time = None,
        *,
        near_ns: int = NEAR_NS,
        progress: Progress | None = None,
    ) -> Explanation:
        """Return why a door was in a state: what was true, what was believed, since when, by whom.

        Also the event that made the difference, the events that report another state, P(open) as
        far as it could be known then, and what came next.

        Args:
            door: Its id, name, or level/name; a removed one, too.
            at: The moment; of an event, when it counts; default: the log's end.
            known_at: What had been recorded by then was known; default: by the moment itself.
                Without `at` it is the moment, too.
            near_ns: Events that report another state count from so long before the moment to so
                long after it; before it, at the least since the state began.
            progress: Called with the progress of the reading.

        Raises:
            UnknownDoorError: There is no such door, and never was.
            MomentError: A time cannot be read.
            LogError: There is no event of that number.
        """
        answer = answer_of("why")
        found: Explanation = answer(self, door, at, known_at, near_ns=near_ns, progress=progress)
        return found

    def timeline(
        self,
        door: DoorId | str,
        at: Time = None,
        known_at: Time = None,
        *,
        since: Time = None,
        until: Time = None,
        progress: Progress | None = None,
    ) -> Timeline:
        """Return when a door was in which state, as numpy columns; empty while it was not there.

        At each time t of an interval, `replay(at=t, known_at=known_at)` shows its state. The last
        interval ends at the requested moment, else at the log's end. A sighting holds for
        `info.holds` median gaps between looks at the door: what comes after, up to the next
        report, is a lapse, and counts in no total.

        Args:
            door: Its id, name, or level/name; a removed one, too.
            at: What was true up to then, with all that is known today.
            known_at: Only what had been recorded by then, whole commits.
            since: Only from then on: an interval is cut there.
            until: Only before then.
            progress: Called with the progress of the reading.

        Raises:
            UnknownDoorError: There is no such door, and never was.
            MomentError: `since` comes after `until`.
        """
        from semmap_log.core.folds.timeline import Timeline

        (door_id,) = self._ids_or_removed([door])
        found = self.timelines([door_id], at, known_at, since=since, until=until, progress=progress)
        if door_id not in found:
            self.resolve_any_door(door_id)
            return Timeline.empty(door_id)
        return found[door_id]

    def timelines(
        self,
        doors: Collection[DoorId | str] | None = None,
        at: Time = None,
        known_at: Time = None,
        *,
        since: Time = None,
        until: Time = None,
        progress: Progress | None = None,
    ) -> dict[DoorId, Timeline]:
        """Return when doors were in which state, ids ascending; `timeline` of many in one reading.

        Args:
            doors: Only these: ids, names, or level/names; None: all that were ever added.
            at: As for `timeline`, like the rest.
            known_at: Only what had been recorded by then, whole commits.
            since: Only from then on: an interval is cut there.
            until: Only before then.
            progress: Called with the progress of the reading.

        Raises:
            MomentError: `since` comes after `until`.
            HorizonError: The requested span begins, or ends, before the log's horizon.
        """
        from semmap_log.core.folds.timeline import timelines
        from semmap_log.log.door_log.clock_warnings import warn_of_clock

        scope = self.scope(at, known_at)
        since_ns, until_ns = self.instant(since), self.instant(until)
        moments.check_ordered(since_ns, until_ns)
        warn_of_clock(self, since_ns)
        self._reader.check_horizon(Window(happened_from_ns=since_ns, happened_before_ns=until_ns))
        requested_ns = scope.known_at_ns if scope.at_ns is None else scope.at_ns
        ids = None if doors is None else self._ids_or_removed(doors)
        if requested_ns is None and scope.event is None:
            requested_ns = self.end_ns()  # which the events of some doors alone do not show
        alone = None if requested_ns is None else ids
        batches = visible_batches(self._reader, scope, progress=progress, doors=alone)
        found = timelines(batches, ids, end_ns=requested_ns, holds=self.info.holds)
        return {i: each.between(since_ns, until_ns) for i, each in found.items()}

    def plot(
        self,
        since: Time = None,
        until: Time = None,
        *,
        doors: Collection[DoorId | str] | None = None,
        progress: Progress | None = None,
    ) -> Any:
        """Return when doors were open and closed, a lane each, and the rounds above them.

        It is a matplotlib.figure.Figure, which a notebook shows; `savefig` writes it.

        Args:
            since: From then on; default: the first event.
            until: Before then; default: the last.
            doors: Only these: ids, names, or level/names; None: all that were ever added.
            progress: Called with the progress of the reading.

        Raises:
            MissingExtraError: matplotlib is not installed.
            MomentError: `since` comes after `until`.
        """
        return answer_of("plot of a log")(
            self, since=since, until=until, doors=doors, progress=progress
        )

    def instant(self, time: Time) -> int | None:
        """Return a time in nanoseconds; of an event, the time from which it counts."""
        moment = self.moment(time)
        if moment.event is None:
            return moment.ns
        event = self.event(moment.event)
        return min(event.happened_ns, event.recorded_ns)

    def floor_map(self, level: int | str | None = None, at: Time = None) -> events.FloorMap | None:
        """Return a level's floor plan; None if it has none.

        Args:
            level: Its number or name; None: the only one.
            at: What was true then.

        Raises:
            UnknownLevelError: There is no such level, or there are several and none is given.
        """
        from semmap_log.core.folds.levels import resolve_level

        doors = self.replay(at=at)
        return self.floor_of(doors, resolve_level(level, doors))

    def floor_of(self, doors: DoorMap, level: int) -> events.FloorMap | None:
        """Return the floor plan that a level has in a door map of this log; None: it has none."""
        known = doors.levels.get(level)
        if known is None or known.floor_map_event is None:
            return None
        event = self.event(known.floor_map_event).event
        assert isinstance(event, events.FloorMap)
        return event

    def end_ns(self) -> int:
        """Return the log's end: the latest happened time in it; 0 for a log without events."""
        from semmap_log.log.door_log.last_patrol import latest_happened_ns

        if self._end_ns is None:
            self._end_ns = latest_happened_ns(self._reader)
        return self._end_ns

    def states_end_ns(self) -> int:
        """Return when a door's state was last reported; the log's end if none was."""
        from semmap_log.log.door_log.last_patrol import latest_happened_ns

        return latest_happened_ns(self._reader, of_states=True) or self.end_ns()

    def resolve(self, door: str | int) -> DoorId:
        """Return the door of that id, name, or level/name, as of now.

        Raises:
            UnknownDoorError: None, or more than one.
        """
        return self.resolve_in(door, self.scope())

    def resolve_in(self, door: str | int, scope: Scope, door_map: DoorMap | None = None) -> DoorId:
        """Return the same, as of a moment.

        Args:
            door: Id, name, or level/name.
            scope: The moment.
            door_map: The doors then, where they are known already.

        Raises:
            UnknownDoorError: None, more than one, or one that was removed by then.
        """
        from semmap_log.log.door_log.queries import door_in

        return door_in(door, self._reader, scope, door_map)

    def door_names(self) -> dict[DoorId, str]:
        """Return the latest name of every door that has one, removed doors too.

        As far as this program knows, where a later one has written to the log.
        """
        return replay(self._reader, with_newer=True).names()

    def objects(self) -> dict[DoorId, ObjectClass]:
        """Return what all objects are that are no doors, removed ones too; ids ascending."""
        return replay(self._reader, with_newer=True).objects()

    def ids_of_class(self, name: str) -> list[DoorId]:
        """Return all objects of a class, removed ones too; `door` is that of all doors.

        Raises:
            CommandError: No class is called so.
        """
        from semmap_log.core.folds.levels import check_class

        state = replay(self._reader, with_newer=True)
        check_class(state.door_map(), name)
        objects = state.objects()
        ids = map(DoorId, sorted(state.used_door_ids))
        return [i for i in ids if objects.get(i, DOOR).name == name]

    def door_labels(self) -> dict[DoorId, str]:
        """Return the same for messages: level/name where several doors bear the name."""
        from semmap_log.core.folds.door_index import all_door_labels

        return all_door_labels(replay(self._reader, with_newer=True))

    def resolve_any_door(self, door: str | int) -> DoorId:
        """Return the door of that id, name, or level/name; one that was removed, or retracted, too.

        Raises:
            UnknownDoorError: There is none, and never was.
        """
        from semmap_log.log.door_log.queries import door_or_removed

        return door_or_removed(door, self._reader)

    def _ids_or_removed(self, doors: Iterable[DoorId | str]) -> list[DoorId]:
        from semmap_log.log.door_log.queries import ids_or_removed

        return ids_or_removed(doors, self._reader)

    def moment(self, time: Time, *, now_ns: int | None = None) -> moments.Moment:
        """Return what a time means in this log.

        Args:
            time: A moment in any of its forms.
            now_ns: What `now` is, and `2h ago` counts from; default: the log's end. `14:02` and
                `Tue 10:00` are the last ones before it; by default, the last ones before the latest
                report of a door's state, whatever was noted since.

        Raises:
            MomentError: It cannot be read.
        """
        if now_ns is not None:
            return self._moment(time, lambda: now_ns)
        return self._moment(time, self.end_ns, lambda: self._last_before(str(time)))

    def known_moment(self, time: Time) -> moments.Moment:
        """Return what a recorded time means: `now` is the last commit, and `2h ago` before that.

        Raises:
            MomentError: It cannot be read.
        """
        return self._moment(time, self._reader.last_log_time_ns)

    def _moment(
        self, time: Time, end_ns: Callable[[], int], last_ns: Callable[[], int] | None = None
    ) -> moments.Moment:
        if isinstance(time, str) and time.startswith(PIN):
            return self._pinned(time.removeprefix(PIN))
        if isinstance(time, int):
            check_time_unit(time, self.before_first_ns)
        return moment_of(time, tz=self.info.timezone, end_ns=end_ns, last_ns=last_ns)

    def _last_before(self, time: str) -> int:
        """Return up to when a clock time or a weekday is the last one; warn where it matters."""
        end_ns, last_ns = self.end_ns(), self.states_end_ns()
        tz = self.info.timezone
        taken = moments.parse_moment(time, tz=tz, end_ns=lambda: last_ns)
        if taken.ns is not None and taken != moments.parse_moment(
            time, tz=tz, end_ns=lambda: end_ns
        ):
            shown = moments.format_local(taken.ns, tz)
            warnings.warn(
                ClockTimeWarning(
                    f"{time} is taken as {shown}: the last one before anything was last said of a "
                    "door's state"
                ),
                stacklevel=4,
            )
        return last_ns

    def _pinned(self, name: str) -> moments.Moment:
        known = self.pins()
        if name not in known:
            there = f"the log has {', '.join(known)}" if known else "the log has none"
            raise MomentError(f"pin:{name}: expected the name of a pin; {there}.")
        return moments.Moment(ns=known[name].at_ns)

    def pins(self) -> dict[str, events.MomentPinned]:
        """Return the pinned moments by their names: `pin:NAME` is one, as a time."""
        from semmap_log.log.replay.state import pins

        return pins(self._reader)

    def span(self, text: str) -> tuple[moments.Moment, moments.Moment]:
        """Return the two moments of `T1..T2`.

        Raises:
            MomentError: It is not two moments, the earlier first.
        """
        return moments.parse_range(text, self.moment)

    def scope(self, at: Time = None, known_at: Time = None, event: int | None = None) -> Scope:
        """Return the bounds that these moments mean; `event:12` bounds the numbers.

        Raises:
            MomentError: A time cannot be read, or is not one.
            LogError: There is no event of that number.
        """
        happened, known = self.moment(at), self.known_moment(known_at)
        if event is not None and (not events.is_whole_number(event) or event < 0):
            raise MomentError(f"event {event!r}: expected a whole number, from 0 on.")
        numbers = [n for n in (event, happened.event, known.event) if n is not None]
        for number in numbers:
            self._check_is_there(number)
        return Scope(happened.ns, known.ns, min(numbers, default=None))

    def _check_is_there(self, event: int | None, *, after_last: int = 0) -> None:
        """Check that the log has the event of that number: after the end nothing is known.

        Args:
            event: Its number; None: not given, nothing is checked.
            after_last: So many numbers after the last event's are accepted, too.

        Raises:
            LogError: It has none; the message names the last.
        """
        if event is not None and event > self._reader.last_event() + after_last:
            raise self._reader.no_event(event)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Do nothing: the files are mapped, and unmapped with the object."""
