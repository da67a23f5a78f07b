"""`tail`: the last events, and those to come."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from shutil import get_terminal_size
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import LogPath, print_empty_log_hint, say
from semmap_log.cli.sanitized_streams import is_nobody_reading, json_text, write_line

if TYPE_CHECKING:
    from semmap_log.core.batches.event_batch import RecordedEvent
    from semmap_log.core.model.commits import Note
    from semmap_log.core.model.doors import DoorId
    from semmap_log.log import DoorLog, FollowedCommit

    Told = tuple[RecordedEvent, Note]
    """An event, and what its commit says."""

LAST = 10
BACK_FACTOR = 8
"""Where the last events are not enough (of one door, say), so many times more are looked at."""


def run(
    log: LogPath,
    *,
    last: Annotated[
        int | None,
        typer.Option("-n", "--last", min=0, metavar="N", help=f"The last N; default: {LAST}."),
    ] = None,
    follow: Annotated[
        bool, typer.Option("-f", "--follow", help="Go on with what comes, until Ctrl-C.")
    ] = False,
    after: Annotated[
        int | None,
        typer.Option("--after", min=-1, metavar="EVENT", help="All behind this event number."),
    ] = None,
    door: Annotated[
        str | None, typer.Option("--door", metavar="DOOR", help="Only events about this door.")
    ] = None,
    poses: Annotated[bool, typer.Option("--poses", help="Show the robot's poses, too.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object a line, as `record` takes them.")
    ] = False,
) -> None:
    """Show the last events, a line each; with -f, also those that come, as they come.

    A line has the event's number, when it happened (in the log's zone), the door, what, and in
    brackets who and why; what the terminal has no room for goes on below. In a pipe, cells with a
    tab between, as those of `history`. Robot poses are left out by default; JSON has all
    events.

    With --after, the reader's own position decides: nothing is missed, and nothing comes twice.

    \b
    Examples:
      semmap-log tail office
      semmap-log tail office -f --door front
      semmap-log tail office -f --json --after 1234 | my_program
    """
    from semmap_log.cli.sanitized_streams import is_for_people
    from semmap_log.log import read
    from semmap_log.views.column_table import line_of
    from semmap_log.views.tail_lines import ROW

    opened = read(log)
    wanted = _filter(opened, door, poses=poses or as_json)
    show = _json_line if as_json else _words(opened, for_people=is_for_people())
    if not (as_json or is_for_people()):
        write_line(line_of(ROW))
    known = -1 if after is None else after
    try:
        if last is None and after is not None:
            events: Iterable[Told] = _events(opened.commits_after(known, with_newer=True), wanted)
        else:
            events = _last(opened, LAST if last is None else last, known, wanted)
        shown = _print(events, show)
        if not (shown or follow or last == 0):
            _say_why_nothing(opened, door, after)
        if follow:
            last_known = max(known, opened.last_event())
            for commit in opened.follow(last_known, stop=is_nobody_reading, with_newer=True):
                _print(_events([commit], wanted), show)
            if is_nobody_reading():
                raise BrokenPipeError
    except KeyboardInterrupt:
        return  # the way to end it


def _filter(opened: DoorLog, door: str | None, *, poses: bool) -> Callable[[RecordedEvent], bool]:
    """Return the filter of the events to show."""
    from semmap_log.core.model.events import DoorEvent, RobotPose, UnknownEvent

    if door is not None:
        door_id = opened.resolve_any_door(door)
        return lambda one: (
            isinstance(one.event, UnknownEvent)  # it may be about any door
            or (isinstance(one.event, DoorEvent) and one.event.door_id == door_id)
        )
    return lambda one: poses or not isinstance(one.event, RobotPose)


def _last(
    opened: DoorLog, count: int, after: int, wanted: Callable[[RecordedEvent], bool]
) -> Iterable[Told]:
    """Return the last of the wanted events after a number."""
    end, back = opened.last_event(), count
    while count:
        start = max(after, end - back)
        commits = opened.commits_after(start, with_newer=True)
        numbers = deque((one.number for one, _ in _events(commits, wanted)), maxlen=count)
        if numbers and (len(numbers) == count or start == after):  # read again, one at a time
            return _events(opened.commits_after(numbers[0] - 1, with_newer=True), wanted)
        if start == after:
            return ()
        back *= BACK_FACTOR
    return ()


def _events(
    commits: Iterable[FollowedCommit], wanted: Callable[[RecordedEvent], bool]
) -> Iterator[Told]:
    for followed in commits:
        for recorded in followed:
            if wanted(recorded):
                yield recorded, followed.commit.note


def _print(events: Iterable[Told], show: Callable[[RecordedEvent, Note], str]) -> bool:
    """Print events, and let go of them at once: who reads them may wait for each.

    Returns:
        Whether there were any.
    """
    is_any = False
    for recorded, note in events:
        write_line(show(recorded, note))
        is_any = True
    sys.stdout.flush()
    return is_any


def _say_why_nothing(opened: DoorLog, door: str | None, after: int | None) -> None:
    """Explain an empty output: there are no events, or none of the wanted ones."""
    if (end := opened.last_event()) < 0:
        print_empty_log_hint(opened)
        return
    asked = "" if door is None else f" about door {door}"
    behind = "" if after is None else f" behind {after}"
    poses = "; the robot's poses are not shown without --poses" * (not (asked or behind))
    say(f"no events{asked}{behind}; the last of the log is {end}{poses}.")


def _json_line(recorded: RecordedEvent, note: Note) -> str:
    from semmap_log.interop.formats.json.door_json import NOTE_KEYS, event_to_json

    said = {key: getattr(note, key) for key in NOTE_KEYS}
    return json_text(event_to_json(recorded, note=said))


def _words(opened: DoorLog, *, for_people: bool) -> Callable[[RecordedEvent, Note], str]:
    """Return what makes a line of an event; doors that are named meanwhile get their names."""
    from semmap_log.core.model.doors import CLASS
    from semmap_log.core.model.events import ClassDefined, DoorAnnotated
    from semmap_log.views.column_table import line_of
    from semmap_log.views.tail_lines import event_line, event_row

    names: dict[DoorId, str] = opened.door_names()
    known: dict[str, Any] = {"tz": opened.info.timezone, "names": names}
    known["objects"] = opened.objects()

    def line(recorded: RecordedEvent, note: Note) -> str:
        event = recorded.event
        if isinstance(event, DoorAnnotated) and event.key == "name":
            names[event.door_id] = event.value
        if isinstance(event, ClassDefined) or getattr(event, "key", "") == CLASS:
            known["objects"] = opened.reopened_log().objects()
        if not for_people:
            return line_of(event_row(recorded, **known, note=note))
        columns = get_terminal_size().columns  # each time: who follows may widen the window
        return event_line(recorded, **known, note=note, width=columns)

    return line
