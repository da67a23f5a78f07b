"""What `serve --ask` takes, and the server of questions that it runs beside ROS, or alone."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import say

if TYPE_CHECKING:
    from semmap_log.live.planners.addresses import Address
    from semmap_log.live.planners.line_protocol.ask_server import AskServer
    from semmap_log.live.planners.oracle import Oracle

ASKED_S = 0.01
"""How often a log that another process writes is looked at: somebody may wait for a door."""

SWITCH_S = 0.0005
"""So long a thread that works waits for another to let it: a short answer takes several such waits
while others are looked up, and Python's own 5 ms would add up."""


class Now(str, Enum):
    """What relative times of questions count from, as typer wants its choices."""

    clock = "clock"
    end = "end"


AskAt = Annotated[
    str | None,
    typer.Option(
        "--ask",
        metavar="ADDRESS",
        help="Take planners' questions at unix:PATH or tcp:HOST:PORT; needs no ROS.",
    ),
]
AnyHost = Annotated[
    bool,
    typer.Option("--ask-any-host", help="tcp: other machines may ask, too; with --token-file."),
]
TokenFile = Annotated[
    Path | None,
    typer.Option("--token-file", metavar="FILE", help="tcp: who asks has to give its one line."),
]
AskNow = Annotated[
    Now,
    typer.Option(
        "--ask-now", help="What `2h ago` and forecasts count from: the clock, or the log's end."
    ),
]


def chosen_address(text: str, option: str) -> Address:
    """Return the address that a person gave.

    Raises:
        typer.BadParameter: It is none.
    """
    from semmap_log.errors import AddressError
    from semmap_log.live.planners.addresses import read_address

    try:
        return read_address(text)
    except AddressError as error:
        raise typer.BadParameter(str(error), param_hint=option) from error


def chosen_token(token_file: Path | None) -> str | None:
    """Return the token in the file that a person named; None: no file.

    Raises:
        typer.BadParameter: There is none in it.
    """
    from semmap_log.errors import AddressError
    from semmap_log.live.planners.line_protocol.tokens import read_token

    try:
        return None if token_file is None else read_token(token_file)
    except AddressError as error:
        raise typer.BadParameter(str(error), param_hint="--token-file") from error


@dataclass(frozen=True, slots=True)
class Asking:
    """Where questions are taken, and from whom."""

    address: Address
    token: str | None
    any_host: bool

    @classmethod
    def of(cls, address: str | None, token_file: Path | None, *, any_host: bool) -> Asking | None:
        """Return what was asked for; None: nothing.

        Raises:
            typer.BadParameter: It cannot be.
        """
        from semmap_log.live.planners.addresses import TcpAddress

        given = {"--ask-any-host": any_host, "--token-file": token_file is not None}
        if address is None:
            for name, is_given in given.items():
                if is_given:
                    raise typer.BadParameter("only with --ask", param_hint=name)
            return None
        where = chosen_address(address, "--ask")
        for name, is_given in given.items():
            if is_given and not isinstance(where, TcpAddress):
                raise typer.BadParameter("only with --ask tcp:HOST:PORT", param_hint=name)
        if any_host and token_file is None:
            raise typer.BadParameter(
                "only with --token-file: who reaches the port sets doors",
                param_hint="--ask-any-host",
            )
        return cls(where, chosen_token(token_file), any_host)

    @contextmanager
    def served(self, oracle: Oracle) -> Iterator[AskServer]:
        """Answer questions within.

        Args:
            oracle: Knows the answers.

        Raises:
            AddressError: Questions cannot be taken there.
        """
        from semmap_log.live.planners.addresses import listen
        from semmap_log.live.planners.line_protocol.ask_server import AskServer

        listener = listen(self.address, any_host=self.any_host)
        before_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_S)
        server = AskServer(oracle, listener, token=self.token, say=say)
        try:
            yield server
        finally:
            server.close()
            sys.setswitchinterval(before_s)
