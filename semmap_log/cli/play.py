"""`play`: a log's history, live in ROS."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import (
    AsJson,
    LogPath,
    PaletteName,
    check_not_nan,
    on_stop,
    print_json,
    range_of,
    say,
)
from semmap_log.cli.ros import Ros1, Ros2, chosen_ros, open_node
from semmap_log.cli.sanitized_streams import plain, steering
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.interop.exporting.stream import LogStream
    from semmap_log.live.ros.player import Told

NODE = "semmap_log_player"

SLOWEST, FASTEST = 1e-3, 1e9
"""Rates: at the first a second takes a quarter of an hour, at the second it passes in 1 ns."""


def run(
    context: typer.Context,
    log: LogPath,
    *,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    rate: Annotated[
        float, typer.Option("--rate", "-r", metavar="R", help="So many times as fast.")
    ] = 1.0,
    immediate: Annotated[
        bool, typer.Option("--immediate", help="As fast as it goes, without waiting.")
    ] = False,
    since: Annotated[
        str | None,
        typer.Option("--since", metavar="TIME", help="Begin with the state of then; or T1..T2."),
    ] = None,
    until: Annotated[
        str | None, typer.Option("--until", metavar="TIME", help="The last moment.")
    ] = None,
    loop: Annotated[
        bool, typer.Option("--loop", "-l", help="At the end begin again, until Ctrl-C.")
    ] = False,
    clock: Annotated[
        bool, typer.Option("--clock", help="Publish the log's time on /clock.")
    ] = False,
    clock_hz: Annotated[
        float, typer.Option("--clock-hz", min=0.1, max=1000, help="So often a second.")
    ] = 40.0,
    skip_empty: Annotated[
        float | None,
        typer.Option(
            "--skip-empty", metavar="S", min=0, max=1e9, help="Leave out longer empty stretches."
        ),
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait", help="Begin when somebody subscribes to a topic.")
    ] = False,
    keep_alive: Annotated[
        bool, typer.Option("--keep-alive", help="Stay behind the end, until Ctrl-C.")
    ] = False,
    markers: Annotated[
        bool, typer.Option("--markers", help="Doors and events as RViz shows them, too.")
    ] = False,
    palette: Annotated[
        PaletteName | None, typer.Option("--palette", help="Markers: their colours.")
    ] = None,
    default_prob: Annotated[
        float | None,
        typer.Option(
            "--default-prob",
            metavar="P",
            min=0,
            max=1,
            help="DoorMap: the probability of doors that have none.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Publish what was true, over time, as the robot's own server would have: live, in ROS.

    The topics and messages are those that `export` writes into a bag. Door map and floor plan are
    latched (ROS 2: transient_local): who subscribes late has the last one.

    Stamps are those of the log. Subscribers that compare them with their own clock want
    `use_sim_time` and --clock, which publishes the log's time: 40 times a second, and with each
    message. Topics have other names as those of any node have: /map:=/floor, --ros-args -r
    /map:=/floor, or all in a namespace.

    \b
    Examples:
      semmap-log play office --ros2
      semmap-log play office --ros1 --rate 60 --since 06:00 --until 12:00 --clock
      semmap-log play office --ros2 --markers --loop --skip-empty 10
      semmap-log play office --ros2 --since 14:00 --ros-args -r __ns:=/replayed
    """
    from semmap_log.core.io.url_path import place_of
    from semmap_log.errors import CommandError
    from semmap_log.interop.exporting.stream import StreamOptions, log_stream
    from semmap_log.live.ros.player import PlayOptions, play
    from semmap_log.log import read

    version = chosen_ros(ros1=ros1, ros2=ros2)
    check_not_nan(rate=rate, default_prob=default_prob, skip_empty=skip_empty, clock_hz=clock_hz)
    if not SLOWEST <= rate <= FASTEST:
        raise typer.BadParameter(
            f"expected a number from {SLOWEST:g} to {FASTEST:g}, got {rate:g}; --immediate does "
            "not wait at all", param_hint="--rate"
        )  # fmt: skip
    if palette is not None and not markers:
        raise typer.BadParameter("only with --markers", param_hint="--palette")
    opened = read(log)
    shown = StreamOptions(
        markers, (palette or PaletteName.default).colours, default_prob, every_s=0
    )
    begin, end = range_of(opened, since, until)
    stream = log_stream(opened, shown, ros_version=version, since=begin, until=end)
    if stream.span_ns is None:
        raise CommandError(f"{place_of(log)}: nothing to play: no event in that range.")
    options = PlayOptions(
        rate=math.inf if immediate else rate,
        loop=loop,
        clock_hz=clock_hz if clock else None,
        longest_gap_s=skip_empty,
        wait=wait,
        keep_alive=keep_alive,
    )
    stopping = threading.Event()
    on_stop(stopping.set)
    node = open_node(context, version, NODE)
    try:
        say(f"{node.name} plays {', '.join(topic.name for topic in stream.topics)}.")
        told = _status_line(stream, options.rate) if sys.stderr.isatty() else None
        count = play(node, stream, options, stop=stopping.is_set, told=told)
    finally:
        node.close()
    if as_json:
        print_json({
            "topics": [topic.name for topic in stream.topics],
            "messages": count,
            "stopped": stopping.is_set(),
        })  # fmt: skip
        return
    say(f"{counted(count, 'message')}{' until it was stopped' if stopping.is_set() else ''}.")


def _status_line(stream: LogStream, rate: float) -> Told:
    """Return what draws where in the log it is, and how long nothing will come."""
    from semmap_log.core.model.moments import duration, format_short

    begin_ns, end_ns = stream.span_ns or (0, 0)
    tz = stream.log.info.timezone
    show = _line_writer()

    def told(at_ns: int, next_ns: int) -> None:
        share = (at_ns - begin_ns) / max(1, end_ns - begin_ns)
        left_s = math.ceil((next_ns - at_ns) / rate / 1e9)
        coming = f"  next in {duration(left_s * 10**9)}" if left_s > 1 else ""
        show(f"{format_short(at_ns, tz)}  {share:4.0%}{coming}")

    return told


def _line_writer() -> Callable[[str], None]:
    """Return what shows a line in place of the one before, if it is another."""
    last = ""

    def show(text: str) -> None:
        nonlocal last
        if text != last:
            terminal = steering(sys.stderr)
            terminal.write(f"\r\x1b[2K{plain(text)}\r")
            terminal.flush()
            last = text

    return show
