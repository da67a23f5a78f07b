"""Write a log as one self-contained page: the same bytes for the same log.

HTML, CSS and JavaScript are files next to this one; the data is JSON, and includes the last changes
in words: when, which door, what, who and why. Nothing in the data can become part of the page: it
is a block that no browser runs, in which `<`, `>` and `&` are escaped, and the scripts show text as
text. The page's own policy forbids it to load anything, and any script but its own.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from semmap_log.analysis.beliefs import door_beliefs
from semmap_log.core.folds.history import ROUND_KINDS, HistoryEntry, history, rounds
from semmap_log.core.folds.levels import levels_of
from semmap_log.core.folds.renumbering import robots_of
from semmap_log.core.io.disk import log_name
from semmap_log.core.model.doors import DoorId, DoorMap, DoorState, ObjectClass
from semmap_log.core.model.moments import format_local, zone
from semmap_log.log import DoorLog, LogSummary, Scope, Window
from semmap_log.views.belief_words import why_unknown
from semmap_log.views.costmap_picture import without_level
from semmap_log.views.event_words import reported_state, words_of
from semmap_log.views.excerpt.door_rows import ObjectShape, shapes_of, sorted_by_stamp
from semmap_log.views.excerpt.shown_levels import home_of_0
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import DEFAULT, Palette, Rgb, shade
from semmap_log.views.report.page_events import (
    MOST_CHANGES,
    PageDoor,
    PageEvents,
    Rows,
    bring_home,
    brought_by,
    coded_lapses,
    coded_life,
    coded_states,
    gather,
    page_doors,
    placed_on,
    track_of,
)
from semmap_log.views.report.plans import PageContent, begins_of_plans, shown_levels
from semmap_log.views.tables import class_in, hold_setting
from semmap_log.views.tail_lines import LATE_NS
from semmap_log.views.zone_times import DAY_MS, MS_NS, Span, first_ms, how_to_begin, zone_offsets

if TYPE_CHECKING:
    from semmap_log.core.model.moments import Time


MARGIN_MS = 8 * DAY_MS
"""The time zone's offsets reach so far beyond the page's span: to the week around a moment."""


@dataclass(frozen=True, slots=True)
class Report:
    """A page, and the size of its content."""

    html: str
    doors: int
    events: int


def report(
    log: DoorLog,
    *,
    since: Time = None,
    until: Time = None,
    doors: Collection[DoorId] | None = None,
    tz: str | None = None,
    palette: Palette = DEFAULT,
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Return a self-contained page of a log: floor plan over time, lanes, weeks, tables, health.

    At each whole millisecond T that its slider can show, the doors are those of `log.replay(at=T)`.

    Args:
        log: The log.
        since: From then on (happened time); the state before it opens the page.
        until: Before then.
        doors: Only these doors; the robot and its rounds stay.
        tz: IANA zone of all times; None: the log's.
        palette: Colours of the states.
        progress: Called with the progress of reading: (bytes done, bytes in all).

    Raises:
        MomentError: A time or the zone cannot be read, or `since` comes after `until`.
    """
    place = log.info.timezone if tz is None else tz
    zone(place)
    excerpt = Excerpt.of(log, since, until, doors)
    data = report_data(excerpt, place, progress)
    said = [data["log"]["name"], data["log"]["building"]]
    title = " · ".join(part for part in said if part)
    html = filled(data, title=f"{title}: door report", palette=palette)
    return Report(html, len(data["doors"]), data["events"])


def report_data(
    excerpt: Excerpt,
    tz: str,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Return all that the page shows, as JSON holds it.

    Unless noted, times are milliseconds after `begin` (which is since the Unix epoch); lengths are
    in metres, in frame `map`.
    """
    log = excerpt.log
    now = log.replay(at=excerpt.last_ns())
    found = gather(excerpt, progress)
    span = _span(excerpt, found)
    rest = brought_by(found, excerpt.before().doors, excerpt.since_ns or 0)
    home = home_of_0(levels_of(now).keys() | placed_on(rest))
    bring_home(rest, found.poses, home)
    told = page_doors(found, rest, excerpt.before().doors, _shapes(excerpt))
    states, lag_ms = coded_states(told, span)
    beliefs = beliefs_of(excerpt, tz, {page_door.door_id for page_door in told})
    levels = shown_levels(excerpt, now, PageContent(told, found.poses, span), home)
    said = _annotations(excerpt, now)
    lapses = _lapses(excerpt, span)
    track = track_of(found.poses, span, begins_of_plans(levels, span))
    return {
        "log": _log(log, tz),
        "begin": span.begin_ms,
        "end": span.end_ms - span.begin_ms,
        "offsets": zone_offsets(span.widened(MARGIN_MS), tz),
        "events": found.events,
        "isWhole": excerpt.until_ns is None,
        "isEmpty": found.events == 0 and not told,
        "howToBegin": how_to_begin(log),
        "states": [state.name for state in DoorState],
        "seenWithin": lag_ms,
        "levels": levels,
        "doors": [
            _door(page_door, said.get(page_door.door_id, {}), levels)
            | coded_life(page_door, span) | coded | beliefs.get(page_door.door_id, {})
            | lapses.get(page_door.door_id, {"lapses": []})
            for page_door, coded in zip(told, states, strict=True)
        ],
        "track": track.runs,
        "trackRobots": track.robots,
        "robots": list(robots_of(log.info.robot)),
        "trackWithin": round(track.within_m, 2),
        "rounds": rounds_of(log, span),
        "changes": changes_of(log, found.told, told, span),
        "health": health_of(log.summary(), tz),
        "shades": [hex_of(shade(percent / 100)) for percent in range(101)],
    }  # fmt: skip


def _span(excerpt: Excerpt, found: PageEvents) -> Span:
    """Return the slider's span: never beyond `until`, and never empty."""
    begin_ns = excerpt.since_ns if excerpt.since_ns is not None else found.first_ns or 0
    end_ms = first_ms(found.last_ns if found.last_ns is not None else begin_ns)
    if (last_ns := excerpt.last_ns()) is not None:
        end_ms = min(end_ms, last_ns // MS_NS)
    begin_ms = first_ms(begin_ns)
    return Span(begin_ms, max(begin_ms, end_ms))


def _log(log: DoorLog, tz: str) -> dict[str, Any]:
    info = log.info
    return {
        "name": log_name(log.path),
        "building": info.building,
        "robot": info.robot,
        "holds": hold_setting(info.holds),
        "tz": tz,
        "id": info.log_id,
    }


def _lapses(excerpt: Excerpt, span: Span) -> dict[DoorId, dict[str, Any]]:
    """Return when each door was not seen since, and how long a sighting of it holds."""
    found = excerpt.log.timelines(excerpt.doors, at=excerpt.last_ns())
    return {
        door_id: {
            "lapses": coded_lapses(timeline.between(excerpt.since_ns), span),
            "holds": timeline.hold.ns // MS_NS,
        }
        for door_id, timeline in found.items()
        if timeline.hold is not None
    }


def _annotations(excerpt: Excerpt, now: DoorMap) -> dict[DoorId, dict[str, str]]:
    """Return the doors' annotations at the page's end; of removed doors only the name."""
    names = excerpt.log.state_in(Scope(at_ns=excerpt.last_ns())).names()
    said = {door_id: {"name": name} for door_id, name in names.items()}
    return said | {door_id: dict(door.annotations) for door_id, door in now.doors.items()}


def _door(
    page_door: PageDoor, said: dict[str, str], levels: list[dict[str, Any]]
) -> dict[str, Any]:
    name = said.get("name") or f"{page_door.shape.object_class.name} {page_door.door_id}"
    level = next((lv["name"] for lv in levels if lv["level"] == page_door.last_level), "")
    return {
        "id": int(page_door.door_id),
        "name": name,
        "short": without_level(name, level),
        "said": [[key, value] for key, value in sorted(said.items()) if key != "name"],
    }


def _shapes(excerpt: Excerpt) -> Mapping[DoorId, ObjectShape]:
    """Return the class and outline at the page's end of each object that is not a door."""
    return shapes_of(excerpt.log.state_in(Scope(at_ns=excerpt.last_ns())))


def rounds_of(log: DoorLog, span: Span) -> list[list[Any]]:
    """Return [start, end, name, robot] for each round of the page.

    Unknown times are None.
    """

    def when(ns: int | None) -> int | None:
        return None if ns is None else span.since_begin(ns)

    since_ns, until_ns = span.begin_ms * MS_NS, span.end_ms * MS_NS + 1
    return [
        [when(each.start_ns), when(each.end_ns), each.label, each.actor]
        for each in rounds(log.history(kinds=ROUND_KINDS))
        if each.overlaps(since_ns, until_ns)
    ]


MOST_FILES = 50
MOST_SUSPECTS = 50


def health_of(summary: LogSummary, tz: str) -> dict[str, Any]:
    """Return a log's health; of many files and suspect clocks, the last ones and their number."""

    def span(times: tuple[int, int] | None) -> list[str] | None:
        return None if times is None else [format_local(time, tz) for time in times]

    return {
        "logId": summary.info.log_id,
        "events": summary.events,
        "commits": summary.commits,
        "kinds": summary.counts,
        "happened": span(summary.happened_ns),
        "recorded": span(summary.recorded_ns),
        "durability": summary.durability,
        "head": summary.head.hex(),
        "bytes": summary.bytes,
        "segments": len(summary.segments),
        "files": [
            [segment.path.name, segment.size, segment.closed, segment.header.first_event]
            for segment in summary.segments[-MOST_FILES:]
        ],
        "suspects": len(summary.suspects),
        "lastSuspects": [suspect.text for suspect in summary.suspects[-MOST_SUSPECTS:]],
        "warnings": summary.warnings,
    }


UNKNOWN = -1
"""Marks an hour that nobody has seen."""


def beliefs_of(excerpt: Excerpt, tz: str, doors: Collection[DoorId]) -> dict[DoorId, Any]:
    """Return the beliefs about the doors that are in the map at the page's end.

    `p` is [P(open), low, high] (90 % interval), or null; then `why` says why. `week` has P(open)
    in percent for 168 hours from Monday's first on, or null where too little is known at all.
    """
    now = door_beliefs.ask(
        excerpt.log,
        at=excerpt.last_ns(),
        estimator=door_beliefs.default_estimator(),
        tz=tz,
        doors=None,
    )
    habits = now.by(door_beliefs.LATER)
    said: dict[DoorId, Any] = {}
    for door in now.doors:
        if door.door_id not in doors:
            continue
        known = door_beliefs.belief(now, door)
        numbers = [round(value, 4) for value in (known.p_open, known.low, known.high)]
        said[door.door_id] = {
            "p": numbers if known.is_known else None,
            "why": "" if known.is_known else why_unknown(known.evidence),
            "knownAt": first_ms(known.known_ns),
            "week": _percent(door_beliefs.typical_week(habits, door)),
        }
    return said


def _percent(week: door_beliefs.TypicalWeek) -> list[int] | None:
    if not week.is_known:
        return None
    percent = np.rint(100 * week.hours.p_open).astype(np.int64)
    cells: list[int] = np.where(week.hours.is_known, percent, UNKNOWN).ravel().tolist()
    return cells


def changes_of(
    log: DoorLog, told: Rows, page_doors: Sequence[PageDoor], span: Span
) -> list[dict[str, Any]]:
    """Return the last changes, the latest first.

    Args:
        log: The log.
        told: Rows of `STAMP`, of events that are listed whatever they report.
        page_doors: The doors, with their changes of state.
        span: Of the page.
    """
    stamps = np.unique(np.concatenate([told, *(page_door.changes for page_door in page_doors)]))
    latest = sorted_by_stamp(stamps)[-MOST_CHANGES:]["number"]
    objects = log.objects()
    lines = {
        entry.number: _line(entry, class_in(objects, entry.door_id), span)
        for entry in _entries(log, latest[latest >= 0])
    }
    doors = {None, *(page_door.door_id for page_door in page_doors)}
    in_turn = [lines[number] for number in reversed(latest.tolist()) if number in lines]
    return [line for line in in_turn if line["door"] in doors]


def _entries(log: DoorLog, numbers: Rows) -> Iterator[HistoryEntry]:
    """Yield the events of these numbers, ascending, with who and why, in one pass."""
    if not len(numbers):
        return
    finder = log.note_finder()
    window = Window(first_event=int(numbers.min()), before_event=int(numbers.max()) + 1)
    batches = (
        batch.select(np.isin(batch.number, numbers))
        for batch in log.batches_in(window, on_page=finder.look_at)
    )
    found = (batch for batch in batches if len(batch))
    yield from history(found, finder.note_texts_of, log.retractions())


def _line(entry: HistoryEntry, of: ObjectClass, span: Span) -> dict[str, Any]:
    state = reported_state(entry.event)
    late_ns = entry.recorded_ns - entry.folds_ns
    return {
        "event": entry.number,
        "t": span.since_begin(entry.folds_ns),
        "door": entry.door_id,
        "what": words_of(entry.event, of),
        "state": None if state is None else int(state),
        "actor": entry.actor,
        "source": entry.source,
        "reason": entry.reason,
        "recorded": span.since_begin(entry.recorded_ns) if late_ns > LATE_NS else None,
    }


STYLES = ("page.css", "stage.css", "sections.css", "print.css")
SCRIPTS = (
    "basics.js", "calendar.js", "data.js", "clock.js", "plan.js", "labels.js", "beside.js",
    "ticks.js", "lanes.js", "weeks.js", "table.js", "words.js", "main.js",
)  # fmt: skip
"""In the order in which they are joined; the first line of each says what it is for."""


def filled(data: dict[str, Any], *, title: str, palette: Palette) -> str:
    """Return the page.

    Args:
        data: The content, as JSON values.
        title: For the browser's tab.
        palette: Colours of the states and of the robot.
    """
    style = _colours(palette) + "".join(map(_asset, STYLES))
    script = '(() => {\n"use strict";\n' + "\n".join(map(_asset, SCRIPTS)) + "})();\n"
    parts = {
        "POLICY": (
            "default-src 'none'; img-src data:; "
            f"style-src '{_fingerprint(style)}'; script-src '{_fingerprint(script)}'; "
            "base-uri 'none'; form-action 'none'"
        ),
        "TITLE": html.escape(title),
        "STYLE": style,
        "DATA": inert_json(data),
        "SCRIPT": script,
    }
    page = _asset("page.html")
    pieces = page.split("@@")  # text, name of a part, text, name of a part …, text
    return "".join(parts[piece] if i % 2 else piece for i, piece in enumerate(pieces))


def inert_json(value: Any) -> str:
    """Return JSON without a character that could end a script block, or begin a comment in one."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _asset(name: str) -> str:
    return resources.files(__package__).joinpath(f"page/{name}").read_text(encoding="utf-8")


def _fingerprint(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode()}"


def _colours(palette: Palette) -> str:
    """Return the palette as variables; MOVING and OFFLINE are drawn as UNKNOWN."""
    named = {
        "open": palette.open, "closed": palette.closed, "unknown": palette.unknown,
        "open-text": palette.open_text, "closed-text": palette.closed_text,
        "unknown-text": palette.unknown_text, "robot": palette.robot,
    }  # fmt: skip
    lines = "".join(f"  --{name}: {hex_of(colour)};\n" for name, colour in named.items())
    return f":root {{\n{lines}}}\n"


def hex_of(colour: Rgb) -> str:
    """Return the colour as CSS writes it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
