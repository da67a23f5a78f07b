"""What planners of imports query of a log, whether it is open for writing or only for reading.

JSON lines are appended commit by commit, as they were in the log that exported them. Doors that
were there before the log says so are added again with an earlier time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import replace
from itertools import chain, islice

from semmap_log.core.io.clock import SystemClock, believable_ns
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazily import computed_once
from semmap_log.core.model.commits import Commit, Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorRemoved, Event, FloorMap
from semmap_log.core.model.moments import format_local
from semmap_log.errors import FormatError
from semmap_log.interop.importing.import_plan import Imported, ImportPlan, Present
from semmap_log.interop.importing.importing_lines import LinesPlan
from semmap_log.interop.importing.line_commits import NumberMap, PlannedCommit, PlannedEvent
from semmap_log.log import DoorLog, DoorLogWriter, StoredCommand, Window, kinds_mask

TOLD_EVERY = 1000
"""Events between two words of progress."""
FEW = 100
"""A commit of fewer events is appended as a list, which is quicker."""


class StoredCommits:
    """The commits of a log; fast if they are looked up in order."""

    def __init__(self, log: DoorLog) -> None:
        self._log = log
        self._commits = log.commits()
        self._upcoming: Commit | None = next(self._commits, None)
        self._events: Iterator[tuple[int, Event]] = iter(())
        self._next_event = -1
        """Number of the event that `_events` gives next."""

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return that command, if it is stored.

        Raises:
            CorruptLogError: The log is damaged.
        """
        assert isinstance(self._log, DoorLogWriter)
        upcoming = self._upcoming
        is_it = upcoming is not None and upcoming.command_id == command_id
        if is_it and upcoming is not None and upcoming.first_event >= self.whole_from:
            found: StoredCommand | None = StoredCommand(upcoming)
        else:
            found = self._log.find_stored(command_id)
        if found is not None:
            self._pass(found.commit)
        return found

    @computed_once
    def whole_from(self) -> int:
        """Number of the first event from which nothing was taken out."""
        assert isinstance(self._log, DoorLogWriter)
        return self._log.known_past.whole_from

    def _pass(self, found: Commit) -> None:
        """Advance past a commit: most often the next lookup is the next commit."""
        while self._upcoming is not None and self._upcoming.first_event <= found.first_event:
            self._upcoming = next(self._commits, None)

    def events_of(self, commit: Commit) -> Iterator[Event]:
        """Yield the events of a commit."""
        if self._next_event != commit.first_event:
            self._events = self._from(commit.first_event)
        for number, event in islice(self._events, commit.count):
            self._next_event = number + 1
            yield event

    def _from(self, first: int) -> Iterator[tuple[int, Event]]:
        for batch in self._log.batches_in(Window(first_event=first)):
            for recorded in batch:
                yield recorded.number, recorded.event

    def comings(self, first: int, last: int) -> Iterator[Event]:
        """Yield the DoorAdded and DoorRemoved among the events of these numbers."""
        kinds = kinds_mask([DoorAdded, DoorRemoved])
        for batch in self._log.batches_in(Window(first_event=first, before_event=last + 1,
                                                 kinds=kinds)):  # fmt: skip
            yield from batch.to_events()


def append_lines(log: DoorLogWriter, plan: LinesPlan, progress: Progress | None) -> int | None:
    """Append what the log does not hold yet of a file; return its first event's number.

    The commits follow each other. Who is interrupted between two imports the file again: it goes
    on where it stopped.

    Raises:
        FormatError: The file changed since it was planned.
        CommandError: The map forbids an event, since the log went on meanwhile.
        LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
    """
    if not plan.count:
        return None
    writing, stored = _Writing(log, plan, progress), StoredCommits(log)
    for commit in plan.commits():
        found = stored.find(commit.command_id)
        if found is None:
            writing.append(commit)
        else:
            writing.pass_over(commit, found.commit)
    if writing.done != plan.count:
        raise FormatError(plan.path, "the file changed while it was imported; import it again")
    log.sync()
    return writing.first_event


class _Writing:
    """Appends one commit after another, and knows which numbers the file's events got."""

    def __init__(self, log: DoorLogWriter, plan: LinesPlan, progress: Progress | None) -> None:
        self.log, self.plan, self.progress = log, plan, progress
        self.numbers = NumberMap()
        self.first_event: int | None = None
        self.done = self.told = 0

    def append(self, commit: PlannedCommit) -> None:
        events = commit.events(self.numbers, self.plan.options.at_ns)
        first = next(events, None)
        if first is None:
            return  # only retractions of what is not there
        recorded_ns = commit.recorded_ns if self.plan.keeps_recorded else None
        if recorded_ns is not None and self.first_event is None:
            self.log.begin_at(recorded_ns - 1)
        appended = self.log.take_over(
            self.numbered(chain([first], events)),
            note=commit.note,
            command_id=commit.command_id,
            content=commit.content,
            are_facts=commit.is_exported,
            recorded_ns=recorded_ns,
        )
        if self.first_event is None:
            self.first_event = appended.first_event

    def numbered(self, events: Iterator[PlannedEvent]) -> Callable[[int], Iterable[Event]]:
        def give(first: int) -> Iterator[Event]:
            for number, (event, source) in enumerate(events, start=first):
                if source is not None:
                    self.numbers.add(source, number)
                self.tell()
                yield event

        def make(first: int) -> Iterable[Event]:
            given = give(first)
            few = list(islice(given, FEW))
            return chain(few, given) if len(few) == FEW else few

        return make

    def tell(self) -> None:
        self.done += 1
        if self.progress is not None and self.done - self.told >= TOLD_EVERY:
            self.told = self.done
            self.progress(self.done, self.plan.count)

    def pass_over(self, commit: PlannedCommit, found: Commit) -> None:
        """Take note of the numbers of events that the log holds."""
        events = list(commit.events(self.numbers, None))
        first = found.last_event + 1 - len(events)
        for number, (_, source) in enumerate(events, start=first):
            if source is not None:
                self.numbers.add(source, number)


def present(log: DoorLog) -> Present:
    """Return what the log holds, as the planners need it."""
    state = log.state_in()
    door_map = state.door_map()
    maps = {}
    for number, level in door_map.levels.items():
        if level.floor_map_event is not None:
            event = log.event(level.floor_map_event).event
            assert isinstance(event, FloorMap)
            maps[number] = event
    used = frozenset(DoorId(door_id) for door_id in state.used_door_ids)
    removed = {i: found for i in used if (found := state.removed_door(i))}
    index = past = None
    if isinstance(log, DoorLogWriter):
        index, past = log.door_index, log.known_past
    return Present(door_map, used, maps, removed, state.event + 1, index, log.path, past)


def stored_commits(log: DoorLog) -> StoredCommits:
    """Return what finds commits by their commands."""
    return StoredCommits(log) if isinstance(log, DoorLogWriter) else _ReadCommits(log)


def now_ns(log: DoorLog) -> int:
    """Return what the log's clock says; of one that is read, the machine's."""
    return log.now_ns() if isinstance(log, DoorLogWriter) else believable_ns(SystemClock())


class _ReadCommits(StoredCommits):
    """The commits of a log that is only read; their ids are in memory."""

    def __init__(self, log: DoorLog) -> None:
        super().__init__(log)
        self._by_id = {commit.command_id: commit for commit in log.commits()}

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return that command, if it is stored."""
        found = self._by_id.get(command_id)
        return None if found is None else StoredCommand(found)


def backdate(
    log: DoorLogWriter, since_ns: int, *, note: Note = Note(), command_id: bytes | None = None
) -> Imported:
    """Record that doors with events before their adding were there by then.

    Args:
        log: The log.
        since_ns: From when on they are there.
        note: Who and why.
        command_id: 16 bytes: the same command, sent again, is stored once.
    """
    plan = backdating(log, log.early_events().counts, since_ns)
    if plan.count == 0:
        return Imported(plan, None)
    appended = log.append(plan.events, note=note, command_id=command_id)
    return Imported(plan, appended.commit.last_event - plan.count + 1)


def with_backdated(log: DoorLog, plan: ImportPlan, since_ns: int) -> ImportPlan:
    """Return a plan, and before it that the doors which are there were there by an earlier time."""
    earlier = backdating(log, plan.there, since_ns)
    return replace(
        plan,
        events=[*earlier.events, *plan.events],
        count=earlier.count + plan.count,
        summary=(*plan.summary, *earlier.summary) if earlier.count else plan.summary,
    )


def backdating(log: DoorLog, doors: Collection[DoorId], since_ns: int) -> ImportPlan:
    """Return what says that doors of the log were there by an earlier time."""
    events = log.backdated(doors, since_ns)
    moved = sum(isinstance(event, DoorAdded) for event in events)
    since = format_local(since_ns, log.info.timezone)
    said = (f"doors: {moved} that the log has, there since {since}",) if moved else ()
    return ImportPlan(events, len(events), summary=said)
