"""`export`: the state or the events as a file for other programs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import common

if TYPE_CHECKING:
    from semmap_log.core.model.moments import Time
    from semmap_log.interop.exporting.log_files import RecordedBag
    from semmap_log.interop.exporting.stream import StreamOptions
    from semmap_log.log import DoorLog, Scope

MOST_NAMED = 3
"""So many of the doors that are left out are named."""

OF_ONE_CLASS = (".geojson", ".csv")
"""Files that can hold the objects of one class alone."""

MOST_EVERY_S = 1e9
"""More than thirty years: nanoseconds of it are still whole."""


def run(
    log: common.LogPath,
    out: common.OutFile,
    *,
    at: common.At = None,
    known_at: common.KnownAt = None,
    event: common.UpToEvent = None,
    object_class: common.OfClass = None,
    default_prob: Annotated[
        float | None,
        typer.Option(
            "--default-prob",
            metavar="P",
            help="Thesis YAML, DoorMap, PDDL: the probability of doors that have none.",
        ),
    ] = None,
    markers: Annotated[
        bool,
        typer.Option(
            "--markers", help="Bags: doors and events as Foxglove, Lichtblick and RViz show them."
        ),
    ] = False,
    since: Annotated[
        str | None,
        typer.Option("--since", metavar="TIME", help="Bags: the first moment; or T1..T2."),
    ] = None,
    until: Annotated[
        str | None, typer.Option("--until", metavar="TIME", help="Bags: the last moment.")
    ] = None,
    every: Annotated[
        float | None,
        typer.Option(
            "--every",
            metavar="S",
            help="Bags: doors at most so often; default: at each change, markers by size.",
        ),
    ] = None,
    palette: Annotated[
        common.PaletteName | None, typer.Option("--palette", help="Markers: their colours.")
    ] = None,
    domain: Annotated[
        Path | None,
        typer.Option("--domain", metavar="FILE", help="PDDL: write the domain, too."),
    ] = None,
    start: Annotated[
        str | None, typer.Option("--start", metavar="ROOM", help="PDDL: where the robot is.")
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            "--goal",
            metavar="GOAL",
            help="PDDL: a room to reach, a door to check, or a condition, '(and ...)'.",
        ),
    ] = None,
    strips: Annotated[
        bool, typer.Option("--strips", help="PDDL: no costs, for planners that know none.")
    ] = False,
    pseudonymous: Annotated[
        bool,
        typer.Option(
            "--pseudonymous",
            help="Without names, words and the robot's tracks: actor-1, door-3, room-2.",
        ),
    ] = False,
    with_tracks: Annotated[
        bool, typer.Option("--with-tracks", help="With --pseudonymous: the robot's tracks, too.")
    ] = False,
    as_json: common.AsJson = False,
) -> None:
    """Write a file, whole or not at all; an old file of that name is replaced at once.

    \b
    Formats, by the file's name:
      .yaml    the thesis's door database, as its server loads it
      .geojson the doors as lines, for QGIS, GDAL, geopandas; level, state,
               probabilities, annotations as properties. Coordinates are metres of
               the map frame, not longitude and latitude; a door without a place
               has no geometry
      .csv     timestamp,door,state,accuracy: every state that was set or seen.
               A name that begins with = + - @ gets an ' before it, so that no
               spreadsheet takes it for a formula; control characters are written
               as \\u001b. `import` takes both back
      .jsonl   every event with who, why, and its commit, one JSON object a line,
               those that were taken back marked "retracted": true. `import` makes
               the same log of it: a new log has its recorded times, too
      .parquet every event, retracted ones marked, with who and why: for pandas,
               DuckDB, polars (needs semmap-log[arrow])
      .rrd     a recording for the rerun viewer
      .html    a page for any browser; `semmap-log report` has more choices
      .pgm     a costmap with its .yaml; `semmap-log costmap` has levels and more
      .pddl    a planning problem: doors, rooms, what is open, and P(open) as the
               cost to pass; with --domain what a robot can do there. Rooms are
               those that the annotation "rooms" of a door names: two, a comma
               between
      .bag     what was true, over time, for ROS 1's `rosbag play`; .mcap: for
               ROS 2 and Foxglove; without an extension: a folder for `ros2 bag
               play`. Topics:
                 /lta_semantic_map_door_db  the thesis's DoorMap; NaN: not given
                 /map                       OccupancyGrid: the floor plan
                 /semmap/robot_pose         PoseStamped
               and with --markers
                 /semmap/doors              MarkerArray: all doors and their names
                 /semmap/events             Log: who, what and why
               With several levels: /map/level_1, /semmap/doors/level_1; 0: no
               suffix

    \b
    Examples:
      semmap-log export office doors.yaml --default-prob 0.5
      semmap-log export office before.yaml --at "yesterday 14:00"
      semmap-log export office events.jsonl
      semmap-log export office for_others.parquet --pseudonymous
      semmap-log export office doors.geojson --at 2026-03-02T12:00
      semmap-log export office march.parquet --at 2026-04-01
      semmap-log export office p.pddl --domain domain.pddl --start hall --goal lab
      semmap-log export office day.mcap --markers
      semmap-log export office morning.bag --since 06:00 --until 12:00
    """
    from semmap_log.core.io.disk import check_outside_log
    from semmap_log.core.texts import deduplicated
    from semmap_log.interop.exporting.log_files import export
    from semmap_log.interop.formats.bags.bag_reading import is_bag_name
    from semmap_log.interop.formats.files.pddl import Wishes
    from semmap_log.log import read

    is_bag = markers or is_bag_name(out)
    if out.suffix.lower() not in OF_ONE_CLASS:
        _check_not_given({"--class": object_class}, f"only for {', '.join(OF_ONE_CLASS)}")
    if is_bag:
        of_a_moment = {"--at": at, "--known-at": known_at, "--event": event}
        _check_not_given(of_a_moment, "a bag shows a range: --since, --until")
    else:
        _check_not_given({"--since": since, "--until": until, "--every": every}, "only for bags")
    if not markers:
        _check_not_given({"--palette": palette}, "only with --markers")
    if out.suffix.lower() != ".pddl":
        of_pddl = {"--domain": domain, "--start": start, "--goal": goal, "--strips": strips or None}
        _check_not_given(of_pddl, "only for .pddl")
    if not pseudonymous:
        _check_not_given({"--with-tracks": with_tracks or None}, "only with --pseudonymous")
    opened = read(log)
    span, scope = common.range_of(opened, since, until), opened.scope(at, known_at, event)
    if not is_bag:
        common.check_map_recorded(opened, at, known_at, event)
    with ExitStack() as copies:
        if pseudonymous:
            check_outside_log(opened.path, out)
            span = _absolute(opened, span)
            opened = copies.enter_context(_without_names(opened, scope, with_tracks=with_tracks))
            scope = replace(scope, known_at_ns=None, event=None)  # the copy ends there
        if is_bag:
            options = _stream_options(palette, default_prob, every, markers=markers)
            _write_bag(opened, out, options, span, as_json=as_json)
            return
        with common.progress("Exporting") as told:
            done = export(
                opened,
                out,
                scope,
                default_prob=default_prob,
                wishes=Wishes(start, goal, with_costs=not strips),
                domain=domain,
                object_class=object_class,
                progress=told,
            )
    if as_json:
        lists = {"left_out": list(done.left_out), "notes": list(done.notes)}
        common.print_json({"file": str(out), "wrote": done.what, **lists})
        return
    for text in deduplicated(done.left_out):
        common.say(f"left out: {text}")
    for text in done.notes:
        common.say(text)
    common.say(f"{out}: {done.what}.")


@contextmanager
def _without_names(log: DoorLog, scope: Scope, *, with_tracks: bool) -> Iterator[DoorLog]:
    """Hand out a copy of a log without names, and say what is not in it."""
    from semmap_log.interop.pseudonyms.pseudonymous_log import pseudonymous

    with ExitStack() as copies:
        with common.progress("Leaving out names") as told:
            found = pseudonymous(log, scope, with_tracks=with_tracks, progress=told)
            copy, names = copies.enter_context(found)
        if names.left_out:
            kinds = (f"{count:,} {kind}" for kind, count in sorted(names.left_out.items()))
            common.say(f"left out: {', '.join(kinds)}")
        yield copy


def _absolute(log: DoorLog, span: tuple[Time, Time]) -> tuple[Time, Time]:
    """Return the ends of a range as times that mean the same in any log."""
    first, last = (None if ns is None else f"@{ns}" for ns in map(log.instant, span))
    return first, last


def _write_bag(
    log: DoorLog, out: Path, options: StreamOptions, span: tuple[Time, Time], *, as_json: bool
) -> None:
    from semmap_log.interop.exporting.log_files import record_bag

    with common.progress("Exporting", unit="events") as told:
        done = record_bag(log, out, options, since=span[0], until=span[1], progress=told)
    if as_json:
        common.print_json({"file": str(out), **asdict(done)})
        return
    if done.left_out:
        more = ", …" if len(done.left_out) > MOST_NAMED else ""
        named = ", ".join(done.left_out[:MOST_NAMED])
        common.say(f"left out: {len(done.left_out)} without a place: {named}{more}")
    if done.every_s and options.every_s is None:
        common.say(
            f"many changes: all doors come at most every {done.every_s:g} s; --every 0: at each."
        )
    common.say(f"{out}: {_told(done)}, {common.size_of(done.bytes)}.")


def _stream_options(
    palette: common.PaletteName | None,
    default_prob: float | None,
    every: float | None,
    *,
    markers: bool,
) -> StreamOptions:
    from semmap_log.interop.exporting.stream import StreamOptions

    common.check_not_nan(default_prob=default_prob, every=every)
    if default_prob is not None and not 0 <= default_prob <= 1:
        raise typer.BadParameter("expected a number from 0 to 1", param_hint="--default-prob")
    if every is not None and not 0 <= every <= MOST_EVERY_S:
        raise typer.BadParameter(
            f"expected seconds, from 0 to {MOST_EVERY_S:g}, got {every:g}", param_hint="--every"
        )
    return StreamOptions(
        markers, (palette or common.PaletteName.default).colours, default_prob, every
    )


def _told(done: RecordedBag) -> str:
    return ", ".join(f"{count:,} on {topic}" for topic, count in done.messages.items())


def _check_not_given(options: Mapping[str, object], instead: str) -> None:
    """Refuse options that mean nothing for that file."""
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise typer.BadParameter(instead, param_hint=", ".join(given))
