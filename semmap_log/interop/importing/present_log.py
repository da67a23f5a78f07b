"""What planners of imports ask of a log: of one that is written, or of one that is only read."""

from __future__ import annotations

from semmap_log.core.io.clock import SystemClock, believable_ns
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import FloorMap
from semmap_log.interop.importing.import_plan import Present
from semmap_log.interop.importing.line_importing import StoredCommits
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.door_log_writer import DoorLogWriter
from semmap_log.store.gone_commands import StoredCommand


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
