"""`timeline`: when a door was in which state."""

from __future__ import annotations

from semmap_log.cli import common


def run(
    log: common.LogPath,
    door: common.DoorName,
    *,
    since: common.Since = None,
    until: common.Until = None,
    at: common.At = None,
    known_at: common.KnownAt = None,
    as_json: common.AsJson = False,
) -> None:
    """Show when a door was in which state: since, until, how long, and how often it was seen so.

    A row begins with the event that changed the state (`semmap-log show LOG N` shows who and
    why) and counts all events that reported the same, the first one included. --since and --until
    cut the rows; --at and --known-at choose what counts, and the last row ends there.

    \b
    Examples:
      semmap-log timeline office front
      semmap-log timeline office front --since yesterday --until now
      semmap-log timeline office 17 --known-at 2026-03-01T14:02 --json
    """
    from semmap_log.core.model.doors import DoorState
    from semmap_log.interop.formats.json.door_json import timeline_to_json
    from semmap_log.log import read

    opened = read(log)
    start, end = common.range_of(opened, since, until)
    door_id = opened.resolve_any_door(door)
    with common.progress("Reading") as told:
        found = opened.timeline(door_id, at, known_at, since=start, until=end, progress=told)
    if not len(found):
        common.check_recorded(opened, at, known_at, door=door_id)
    if as_json:
        common.print_json(timeline_to_json(found, name=opened.door_names().get(door_id)))
        return
    from semmap_log.core.model.doors import DOOR
    from semmap_log.views.timeline_table import timeline_pages, timeline_totals

    out, of = common.console(), opened.objects().get(door_id, DOOR)
    for page in timeline_pages(found, tz=opened.info.timezone, of=of):
        out.print(page)
    if not len(found):
        common.say(
            f"door {door} was not in the map then; without times, all its intervals are shown."
        )
    else:
        out.print(timeline_totals(found, tz=opened.info.timezone, of=of))
    if (found.state == DoorState.UNKNOWN).all():
        common.note_later_events(opened, at, known_at, door=door_id)
