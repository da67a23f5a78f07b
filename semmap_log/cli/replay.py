"""`replay`: the door map at a moment."""

from __future__ import annotations

from semmap_log.cli import common


def run(
    log: common.LogPath,
    *,
    at: common.At = None,
    known_at: common.KnownAt = None,
    event: common.UpToEvent = None,
    object_class: common.OfClass = None,
    as_json: common.AsJson = False,
) -> None:
    """Show the doors as they were at a moment; without one, as they are now.

    --at is what was true then, with all that is known today; --known-at is what the robot
    believed then; both together are bitemporal.

    \b
    Times: 2026-03-01T14:02 (the log's zone), …Z, @1772373720, 2h ago,
    yesterday 14:00, now (counted from the log's end), 14:00, Tue 10:00 (the last
    ones), event:1234.

    \b
    Examples:
      semmap-log replay office
      semmap-log replay office --at "yesterday 14:00"
      semmap-log replay office --known-at 2026-03-01T14:02 --json
      semmap-log replay office --class dock
    """
    from semmap_log.core.model.doors import DoorState
    from semmap_log.interop.formats.json.door_json import door_map_to_json
    from semmap_log.log import read

    opened = read(log)
    common.print_empty_log_hint(opened)
    with common.progress("Reading") as told:
        door_map = opened.replay(at, known_at, event, progress=told)
    if not door_map.doors and event is None:
        common.check_recorded(opened, at, known_at)
    if object_class is not None:
        from semmap_log.core.folds.levels import of_class

        door_map = of_class(door_map, object_class)
    if as_json:
        common.print_json(door_map_to_json(door_map))
        return
    from semmap_log.views.tables import door_table

    common.console().print(door_table(door_map, tz=opened.info.timezone))
    doors = door_map.doors.values()
    if event is None and all(door.state is DoorState.UNKNOWN for door in doors):
        common.note_later_events(opened, at, known_at)
