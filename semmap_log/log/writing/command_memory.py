"""Which commands are stored already, so that one that is sent again is stored once."""

from __future__ import annotations

from collections.abc import Callable

from semmap_log.commits import Commit
from semmap_log.log.folder import LogFolder
from semmap_log.log.reading.reader import LogReader

REMEMBERED_COMMANDS = 10_000


class CommandMemory:
    """The commits of at least the last 10,000 commands; read when first asked."""

    def __init__(self, folder: LogFolder, flush: Callable[[], None]) -> None:
        self._folder = folder
        self._flush = flush
        """Hands the kernel what the writer holds back, before the log is read."""
        self._commits: dict[bytes, Commit] | None = None

    def add(self, commit: Commit) -> None:
        """Remember a commit that was written."""
        if self._commits is not None:
            self._commits[commit.command_id] = commit

    def find(self, command_id: bytes, *, everywhere: bool = False) -> Commit | None:
        """Return the commit of a command, if it is stored.

        Args:
            command_id: 16 bytes.
            everywhere: Search the whole log, not only the last 10,000 commits or so.
        """
        if self._commits is None:
            self._commits = _recent(self._reader())
        known = self._commits.get(command_id)
        if known or not everywhere:
            return known
        return next((c for c in self._reader().commits() if c.command_id == command_id), None)

    def _reader(self) -> LogReader:
        self._flush()
        return LogReader(self._folder)


def _recent(reader: LogReader) -> dict[bytes, Commit]:
    """Return the commits of the last segments, at least `REMEMBERED_COMMANDS` if there are."""
    first, step = len(reader.segments), 1
    found: dict[bytes, Commit] = {}
    while first > 0 and len(found) < REMEMBERED_COMMANDS:
        first, step = max(0, first - step), 2 * step
        found = {commit.command_id: commit for commit in reader.commits(first)}
    return found
