"""Which commands are stored already, so that one that is sent again is stored once.

However long ago it was stored, in whichever segment. As long as nobody asks, nothing is read and
nothing remembered; a command without an id costs nothing more.

Who asks first has the index of every closed segment read: 8 bytes a commit stay in memory, 8 MB a
million. That takes about as long as opening the log: 0.3 to 0.6 s for 1,825 segments of 1,000
commits; 4 s where these were closed before there was an index, so that their commits are read, once
for each opening. From then on an unknown command takes 10 us, however long the log is: beside a
million commits one in 4,000 has a fingerprint that is known, and a chunk is read to tell that it is
another. A command that is stored takes one chunk of its segment: a millisecond, some more where it
is compacted.
"""

from __future__ import annotations

from collections.abc import Callable

from semmap_log.core.model.commits import Commit
from semmap_log.errors import CorruptLogError
from semmap_log.store.folder import LogFolder
from semmap_log.store.gone_commands import StoredCommand
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import commit_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing.stored_commands import StoredCommands


class CommandMemory:
    """The commands of a log that is being written: by id those of the live segment, else by index.

    Used by one thread at a time.
    """

    def __init__(
        self,
        folder: LogFolder,
        live: Callable[[], SegmentWriter | None],
        flush: Callable[[], None],
    ) -> None:
        """Prepare; nothing is read.

        Args:
            folder: The log's.
            live: Gives the live segment.
            flush: Hands the kernel what the writer holds back, before the live segment is read.
        """
        self._folder = folder
        self._live = live
        self._flush = flush
        self._stored: StoredCommands | None = None
        self._known: dict[bytes, int] = {}
        """Of the live segment: command id -> first event."""
        self._known_of: SegmentWriter | None = None
        self._taken_in = 0
        """How many of its commits were looked at."""
        self._seen: Segment | None = None
        """The live segment as it was read last."""

    def add(self, commit: Commit) -> None:
        """Remember a commit that was written, if somebody has asked about its segment."""
        if self._known_of is not None:
            self._known[commit.command_id] = commit.first_event
            self._taken_in += 1

    def closed(self, segment: SegmentWriter) -> None:
        """Take in that the live segment was closed, with all of its commits."""
        if self._known_of is segment:
            self._forget_live(None)
        if self._stored is not None:
            self._stored.add(segment.name, segment.header.first_event, segment.command_rows)

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return a command, if it is stored.

        Args:
            command_id: 16 bytes.

        Raises:
            CorruptLogError: A segment in which it may be is damaged.
            LogAccessError: One cannot be read.
        """
        live = self._live()
        if live is not None:
            if live is not self._known_of:
                self._forget_live(live)
            if self._taken_in < len(live.written):
                self._look_at(live)
            event = self._known.get(command_id)
            if event is not None:
                return StoredCommand(self._read_live(live, command_id, event))
        if self._stored is None:
            self._stored = StoredCommands(self._folder, LogReader(self._folder).segments)
        return self._stored.find(command_id)

    def _look_at(self, live: SegmentWriter) -> None:
        """Take in the commits that were written before somebody asked."""
        for command_id in live.written.command_ids(self._taken_in):
            self._known[command_id] = live.written.first_event(self._taken_in)
            self._taken_in += 1

    def _read_live(self, live: SegmentWriter, command_id: bytes, event: int) -> Commit:
        self._flush()
        self._seen = open_segment(live.path, earlier=self._seen, folder=self._folder)
        commit = commit_of(self._seen, event)
        if commit is None or commit.command_id != command_id:
            problem = f"the commit of event {event}, which was written, is not there any more"
            raise CorruptLogError(live.path, self._seen.whole_end, problem)
        return commit

    def _forget_live(self, live: SegmentWriter | None) -> None:
        self._known, self._known_of, self._taken_in, self._seen = {}, live, 0, None
