"""A log as one page: everything in it, nothing around it, the same bytes for the same log."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from semmap_log.analysis.beliefs.belief_query import ask
from semmap_log.analysis.beliefs.door_beliefs import LATER, belief, default_estimator
from semmap_log.analysis.beliefs.typical_week import TypicalWeek, typical_week
from semmap_log.core.folds.levels import levels_of
from semmap_log.core.folds.patrol_rounds import ROUND_KINDS, rounds
from semmap_log.core.io.disk import log_name
from semmap_log.core.model.doors import DoorId, DoorMap, DoorState
from semmap_log.core.model.moments import format_local, zone
from semmap_log.log.door_log.robot_names import robots_of
from semmap_log.log.door_log.summary import LogSummary
from semmap_log.log.replay.replay import Scope
from semmap_log.views.belief_words import why_unknown
from semmap_log.views.excerpt.object_shapes import ObjectShape, shapes_of
from semmap_log.views.excerpt.shown_levels import home_of_0
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.how_to_begin import how_to_begin
from semmap_log.views.label_places import without_level
from semmap_log.views.palette import DEFAULT, Palette
from semmap_log.views.report.last_changes import changes_of
from semmap_log.views.report.page import filled, hex_of
from semmap_log.views.report.page_doors import (
    PageDoor,
    bring_home,
    brought_by,
    coded_lapses,
    coded_life,
    coded_states,
    page_doors,
    placed_on,
)
from semmap_log.views.report.page_events import PageEvents, gather
from semmap_log.views.report.plans import PageContent, begins_of_plans, shown_levels
from semmap_log.views.report.track import track_of
from semmap_log.views.tables import hold_setting
from semmap_log.views.week_shades import shade
from semmap_log.views.zone_times import DAY_MS, MS_NS, Span, first_ms, zone_offsets

if TYPE_CHECKING:
    from semmap_log.log.door_log.door_log import DoorLog, Time
if TYPE_CHECKING:
    from semmap_log.log.door_log.door_log import DoorLog

BESIDE_MS = 8 * DAY_MS
"""The week of a moment reaches so far beyond the first and the last one."""


@dataclass(frozen=True, slots=True)
class Report:
    """A page, and what is on it."""

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
        progress: Told how far the reading is: (bytes done, bytes in all).

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

    Times are milliseconds after `begin` (which is since the Unix epoch), where nothing else is
    said; lengths metres, frame `map`.
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
        "offsets": zone_offsets(span.widened(BESIDE_MS), tz),
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
        "robots": list(robots_of(log.info)),
        "trackWithin": round(track.within_m, 2),
        "rounds": rounds_of(log, span),
        "changes": changes_of(log, found.told, told, span),
        "health": health_of(log.summary(), tz),
        "shades": [hex_of(shade(percent / 100)) for percent in range(101)],
    }  # fmt: skip


def _span(excerpt: Excerpt, found: PageEvents) -> Span:
    """Return what the slider goes over: never beyond `until`, and never nothing."""
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
    """Return what is said of the doors when the page ends; of removed ones only the name."""
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
    """Return what each object is that is no door when the page ends, and its outline."""
    return shapes_of(excerpt.log.state_in(Scope(at_ns=excerpt.last_ns())))


def rounds_of(log: DoorLog, span: Span) -> list[list[Any]]:
    """Return [from when, till when, what it is called, who drove] for each round of the page.

    Times are None where nobody told them.
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
"""Stands for an hour that nobody has seen."""


def beliefs_of(excerpt: Excerpt, tz: str, doors: Collection[DoorId]) -> dict[DoorId, Any]:
    """Return, for the doors in the map when the page ends, what can be said of them.

    `p` is [P(open), low, high] (90 % interval), or null; then `why` says why. `week` has P(open)
    in percent for 168 hours from Monday's first on, or null where too little is known at all.
    """
    now = ask(excerpt.log, at=excerpt.last_ns(), estimator=default_estimator(), tz=tz, doors=None)
    habits = now.by(LATER)
    said: dict[DoorId, Any] = {}
    for door in now.doors:
        if door.door_id not in doors:
            continue
        known = belief(now, door)
        numbers = [round(value, 4) for value in (known.p_open, known.low, known.high)]
        said[door.door_id] = {
            "p": numbers if known.is_known else None,
            "why": "" if known.is_known else why_unknown(known.evidence),
            "knownAt": first_ms(known.known_ns),
            "week": _percent(typical_week(habits, door)),
        }
    return said


def _percent(week: TypicalWeek) -> list[int] | None:
    if not week.is_known:
        return None
    percent = np.rint(100 * week.hours.p_open).astype(np.int64)
    cells: list[int] = np.where(week.hours.is_known, percent, UNKNOWN).ravel().tolist()
    return cells
