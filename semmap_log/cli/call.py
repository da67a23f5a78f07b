"""`call`: the thesis's actions, of a running server."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, check_not_nan, print_json, say
from semmap_log.cli.door_options import End, GivenLine, Start, Theta, Width, X, Y, line_of
from semmap_log.cli.ros import Ros1, Ros2, chosen_ros, open_node

if TYPE_CHECKING:
    from semmap_log.core.model.doors import DoorState
    from semmap_log.live.ros.client import DoorClient, DoorFields
    from semmap_log.live.ros.ros_node import GoalAnswer

DoorNumber = Annotated[
    int, typer.Argument(metavar="ID", min=0, max=2**64 - 1, help="The door's id.")
]
Timeout = Annotated[
    float,
    typer.Option(
        "--timeout",
        metavar="S",
        min=0.1,
        max=86_400,
        help="How long to wait for the server, and again for its answer.",
    ),
]
Server = Annotated[
    str | None,
    typer.Option("--server", metavar="NAME", help="The action server's name; default: as `serve`."),
]
State = Annotated[str | None, typer.Option(help="OPEN, CLOSED or UNKNOWN.")]
ProbOpen = Annotated[float | None, typer.Option(min=0, max=1, help="P(open), 0..1.")]
ProbClosed = Annotated[float | None, typer.Option(min=0, max=1, help="P(closed), 0..1.")]

TIMEOUT_S = 10.0

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def call() -> None:
    """Call an action of a running server of the thesis's types: ours, or any other.

    Exit code 0: done; 1: it was refused, or nobody answered in time. What the server makes of it
    is logged there under the client's name; another one: __name:=porter, --ros-args -r
    __node:=porter.

    \b
    Examples:
      semmap-log call add --ros2 --from 2,1.5 --to 2.9,1.5 --state closed
      semmap-log call update 3 --ros1 --state open
      semmap-log call remove 3 --ros1
      semmap-log call save doors.yaml --ros2
    """


@app.command("add", short_help="Add a door; prints its id.")
def add(
    context: typer.Context,
    *,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    x: X = None,
    y: Y = None,
    theta: Theta = None,
    width: Width = None,
    start: Start = None,
    end: End = None,
    state: State = None,
    prob_open: ProbOpen = None,
    prob_closed: ProbClosed = None,
    server: Server = None,
    timeout: Timeout = TIMEOUT_S,
    as_json: AsJson = False,
) -> None:
    """Add a door; prints the id that the server gave it.

    A probability that is not given is none at our server. The goals of the thesis cannot say that:
    for a server of others, give both.

    \b
    Examples:
      semmap-log call add --ros2 --x 2 --y 1.5 --theta 0 --width 0.9
      semmap-log call add --ros1 --from 2,1 --to 3,1 --prob-open .2
    """
    line = line_of(GivenLine(x, y, theta, width), start, end)
    door = _fields(line, state, prob_open, prob_closed)
    if None in (door.x, door.y, door.theta, door.width):
        raise typer.BadParameter("give --x --y --theta --width, or --from and --to")
    asked = _Request(context, ros1=ros1, ros2=ros2, server=server, timeout=timeout, as_json=as_json)
    asked.ask("add", lambda client: client.add(door), lambda result: str(result["door_id"]))


@app.command("update", short_help="Set fields of a door.")
def update(
    context: typer.Context,
    door_id: DoorNumber,
    *,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    x: X = None,
    y: Y = None,
    theta: Theta = None,
    width: Width = None,
    start: Start = None,
    end: End = None,
    state: State = None,
    prob_open: ProbOpen = None,
    prob_closed: ProbClosed = None,
    server: Server = None,
    timeout: Timeout = TIMEOUT_S,
    as_json: AsJson = False,
) -> None:
    """Set fields of a door; what is not given stays as it is.

    The action sets x, y and theta together: the ones that are not given are taken from the door
    map that the server publishes.

    \b
    Examples:
      semmap-log call update 3 --ros1 --state open
      semmap-log call update 3 --ros2 --x 2.1
      semmap-log call update 3 --ros2 --prob-open 0.3 --prob-closed 0.7
    """
    from semmap_log.live.ros.client import DoorFields

    line = line_of(GivenLine(x, y, theta, width), start, end)
    door = _fields(line, state, prob_open, prob_closed)
    if door == DoorFields():
        raise typer.BadParameter("nothing to set: give at least one of the fields (--help)")
    asked = _Request(context, ros1=ros1, ros2=ros2, server=server, timeout=timeout, as_json=as_json)
    asked.ask(
        f"update of door {door_id}",
        lambda client: client.update(door_id, door),
        lambda _: f"door {door_id} updated",
    )


@app.command("remove", short_help="Remove a door.")
def remove(
    context: typer.Context,
    door_id: DoorNumber,
    *,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    server: Server = None,
    timeout: Timeout = TIMEOUT_S,
    as_json: AsJson = False,
) -> None:
    """Remove a door from the server's map.

    \b
    Example:
      semmap-log call remove 3 --ros1
    """
    asked = _Request(context, ros1=ros1, ros2=ros2, server=server, timeout=timeout, as_json=as_json)
    asked.ask(
        f"removal of door {door_id}",
        lambda client: client.remove(door_id),
        lambda _: f"door {door_id} removed",
    )


@app.command("save", short_help="Have the server write its database.")
def save(
    context: typer.Context,
    file: Annotated[str, typer.Argument(metavar="FILE", help="Its name, on the server's side.")],
    *,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    server: Server = None,
    timeout: Timeout = TIMEOUT_S,
    as_json: AsJson = False,
) -> None:
    """Have the server write its door database, as YAML, where it may.

    \b
    Example:
      semmap-log call save doors.yaml --ros2
    """
    asked = _Request(context, ros1=ros1, ros2=ros2, server=server, timeout=timeout, as_json=as_json)
    asked.ask(f"saving {file}", lambda client: client.save(file), lambda _: f"saved as {file}")


class _Request:
    """Whom to ask, for how long, and how to print what comes."""

    def __init__(
        self,
        context: typer.Context,
        *,
        ros1: bool,
        ros2: bool,
        server: str | None,
        timeout: float,
        as_json: bool,
    ) -> None:
        check_not_nan(timeout=timeout)
        self._context = context
        self._version = chosen_ros(ros1=ros1, ros2=ros2)
        self._server, self._timeout, self._as_json = server, timeout, as_json

    def ask(
        self,
        what: str,
        call: Callable[[DoorClient], GoalAnswer],
        told: Callable[[Mapping[str, Any]], str],
    ) -> None:
        """Call, and print what came of it.

        Args:
            what: The request, for the message when it is refused.
            call: Sends the goal.
            told: Returns the result in words.
        """
        from semmap_log.live.ros.client import DoorClient

        # Two nodes of one name: the second would end the first.
        node = open_node(self._context, self._version, f"semmap_log_client_{os.getpid()}")
        try:
            answer = call(DoorClient(node, self._timeout, self._server))
        finally:
            node.close()
        refused = any(value is False for value in answer.result.values())  # a door's id may be 0
        done = answer.status == "SUCCEEDED" and not refused
        if self._as_json:
            print_json({"status": answer.status, "result": dict(answer.result),
                        "text": answer.text})  # fmt: skip
        elif done:
            typer.echo(told(answer.result))
        if not done:
            why = answer.text or "the server did not say why"
            say(f"semmap-log: {what}: {answer.status}: {why}")
        elif answer.text:
            say(f"semmap-log: warning: {answer.text}")
        if not done:
            raise typer.Exit(1)


def _fields(
    line: GivenLine, state: str | None, prob_open: float | None, prob_closed: float | None
) -> DoorFields:
    from semmap_log.live.ros.client import DoorFields

    check_not_nan(x=line.x, y=line.y, theta=line.theta, width=line.width, prob_open=prob_open,
               prob_closed=prob_closed)  # fmt: skip
    given = None if state is None else _state(state)
    return DoorFields(line.x, line.y, line.theta, line.width, given, prob_open, prob_closed)


def _state(text: str) -> DoorState:
    """Return one of the three states that the thesis's messages know."""
    from semmap_log.core.model.doors import DoorState, reduced

    known = {str(reduced(state).name) for state in DoorState}
    if text.strip().upper() not in known:
        raise typer.BadParameter(
            f"expected OPEN, CLOSED or UNKNOWN, got {text!r}: the thesis's messages know no others",
            param_hint="--state",
        )
    return DoorState.parse(text)
