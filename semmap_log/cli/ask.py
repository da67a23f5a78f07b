"""`ask`: a planner's questions, to a running server; and the options of `serve` for planners.

`serve --ask` runs a server of questions, next to ROS or alone; `serve --oprs` serves OPRS kernels
through a message passer. One oracle answers both.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import plain_streams
from semmap_log.cli.common import say
from semmap_log.cli.plain_streams import write_line
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.live.planners.addresses import Address
    from semmap_log.live.planners.kernels.kernel_service import Kernels, KernelService
    from semmap_log.live.planners.line_protocol.ask_server import AskServer
    from semmap_log.live.planners.line_protocol.tokens import AskClient
    from semmap_log.live.planners.oracle import AskedDoors, Oracle


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
        """Return the parsed options; None: none was given.

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


def run(
    address: Annotated[
        str, typer.Argument(metavar="ADDRESS", help="unix:PATH or tcp:HOST:PORT, as of the server.")
    ],
    questions: Annotated[
        list[str] | None,
        typer.Argument(metavar="QUESTION...", help="Each in quotes; none: lines of stdin."),
    ] = None,
    *,
    as_json: Annotated[
        bool, typer.Option("--json", help="Ask, and print answers, as JSON: with reasons for NIL.")
    ] = False,
    token_file: Annotated[
        Path | None,
        typer.Option("--token-file", metavar="FILE", help="The server's token, if it wants one."),
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout", metavar="S", min=0.001, help="Longest wait for an answer; else for ever."
        ),
    ] = None,
) -> None:
    """Ask a server what planners ask: `serve LOG --ask ADDRESS` runs one.

    An answer is a line: T, NIL (no, or none), a number, a door such as DOOR_3, a text in quotes,
    or a list in parentheses. HELP names all questions. A time with blanks stands in quotes of its
    own. From stdin each line is a question, and each answer is printed as it comes; lines that
    begin with { are JSON.

    Exit code 0: all were answered, be it by NIL; 1: one could not be understood or answered, or
    the server is not there; 2: a wrong address or option.

    \b
    Examples:
      semmap-log ask unix:/run/doors.sock "DOOR_OPEN DOOR_3"
      semmap-log ask unix:doors.sock 'DOOR_OPEN DOOR_3 "2h ago"' GET_OPEN_DOOR
      semmap-log ask unix:/run/doors.sock "SET_DOOR_CLOSED DOOR_main_door" --json
      semmap-log ask tcp:robot1:5300 HELP --token-file ~/doors.token
    """
    from semmap_log.errors import QuestionError
    from semmap_log.live.planners.line_protocol.tokens import AskClient

    where, token = chosen_address(address, "ADDRESS"), chosen_token(token_file)
    if not questions and sys.stdin.isatty():
        say("Reading questions, one a line; HELP names them. Ctrl-D ends.")
    lines = questions or _lines_of_stdin()
    failed = 0
    with AskClient(where, token=token, timeout_s=timeout) as client:
        for answer, problem in _answers(client, lines, as_json=as_json):
            if problem is not None and questions and len(questions) == 1:
                raise QuestionError(problem)
            failed += problem is not None
            _print(answer, questions)
    if failed and questions:
        said = f"{failed} of {counted(len(questions), 'question')} failed"
        say(f"{said}. On a command line each question stands in quotes.")
    if failed:
        raise typer.Exit(1)


def _lines_of_stdin() -> Iterator[str]:
    """Yield its lines; of one that is too long only the beginning, which the server refuses."""
    from semmap_log.live.planners.question_lines import MOST_LINE_BYTES

    while line := sys.stdin.readline(MOST_LINE_BYTES):
        yield line.rstrip("\r\n")
        while line and not line.endswith("\n"):
            line = sys.stdin.readline(MOST_LINE_BYTES)


def _answers(
    client: AskClient, lines: Iterable[str], *, as_json: bool
) -> Iterable[tuple[str, str | None]]:
    """Yield the line that answers each question, and what is wrong with it; None: nothing."""
    from semmap_log.errors import QuestionError
    from semmap_log.live.planners.question_lines import as_json_line, problem_of, write_error

    for line in lines:
        try:
            question = as_json_line(line) if as_json and not line.startswith("{") else line
        except QuestionError as error:
            yield write_error(str(error), is_json=True).decode()[:-1], str(error)
            continue
        answer = client.ask(question)
        yield answer, problem_of(answer)


def _print(answer: str, questions: list[str] | None) -> None:
    """Print an answer; a person gets all that HELP lists on lines of their own."""
    from semmap_log.live.planners.question_lines import split_words

    if questions == ["HELP"] and plain_streams.is_for_people() and answer.startswith("("):
        for line in split_words(answer[1:-1]):
            write_line(line)
    else:
        write_line(answer)
    sys.stdout.flush()


PORT = 3300
"""Default port of a message passer."""
NAME = "SEMMAP"

OprsAt = Annotated[
    str | None,
    typer.Option(
        "--oprs",
        metavar="HOST[:PORT]",
        help="Serve OPRS kernels by their message passer (mp-oprs); needs no ROS.",
    ),
]
OprsName = Annotated[
    str | None,
    typer.Option("--oprs-name", metavar="NAME", help=f"Ours, to which kernels send; {NAME}."),
]
OprsTo = Annotated[
    list[str] | None,
    typer.Option(
        "--oprs-to", metavar="KERNEL", help="Post it a fact at each change; give it once for each."
    ),
]


def chosen_kernels(
    address: str | None, name: str | None, told: Sequence[str] | None
) -> Kernels | None:
    """Return which kernels are to be served; None: none.

    Raises:
        typer.BadParameter: They cannot be.
    """
    from semmap_log.errors import AddressError, PasserError
    from semmap_log.live.planners.addresses import TcpAddress, read_address
    from semmap_log.live.planners.kernels.kernel_service import Kernels

    if address is None:
        for option, given in {"--oprs-name": name, "--oprs-to": told}.items():
            if given:
                raise typer.BadParameter("only with --oprs", param_hint=option)
        return None
    try:
        where = read_address(f"tcp:{address if _has_port(address) else f'{address}:{PORT}'}")
        assert isinstance(where, TcpAddress)
    except AddressError:
        raise typer.BadParameter(
            f"expected a host and a port such as 127.0.0.1:{PORT}, got {address!r}",
            param_hint="--oprs",
        ) from None
    try:
        return Kernels(where, name or NAME, tuple(dict.fromkeys(told or ())))
    except PasserError as error:
        raise typer.BadParameter(str(error), param_hint="--oprs-name, --oprs-to") from error


def _has_port(address: str) -> bool:
    return ":" in address.rpartition("]")[2]


@contextmanager
def kernels_served(
    kernels: Kernels, oracle: Oracle, doors: AskedDoors, changes: list[Callable[[], object]]
) -> Iterator[KernelService]:
    """Report the doors to kernels, and answer them, while the block runs.

    Args:
        kernels: Who, and where.
        oracle: Knows the answers.
        doors: What is reported to them.
        changes: Called after each change of the doors.
    """
    from semmap_log.live.planners.kernels.kernel_service import KernelService

    service = KernelService(oracle, doors, kernels, say=say)
    changes.append(service.wake)
    try:
        yield service
    finally:
        service.close()


TICK_S = 0.1
"""How often a server without ROS looks whether it is to end."""


@dataclass(frozen=True, slots=True)
class Planners:
    """Who asks, and how."""

    asking: Asking | None
    """Over a socket."""
    kernels: Kernels | None
    """Over a message passer."""
    now: Now
    """What relative times count from."""

    @classmethod
    def of(cls, asking: Asking | None, kernels: Kernels | None, now: Now) -> Planners | None:
        """Return who asks; None: nobody.

        Raises:
            typer.BadParameter: A choice is about them, and there are none.
        """
        if asking is not None or kernels is not None:
            return cls(asking, kernels, now)
        if now != Now.clock:
            raise typer.BadParameter("only with --ask or --oprs", param_hint="--ask-now")
        return None

    @contextmanager
    def served(
        self, log: Path, doors: AskedDoors, changes: list[Callable[[], object]]
    ) -> Iterator[Callable[[], Exception | None]]:
        """Answer them while the block runs; yields a function that returns why that ended, or None.

        Args:
            log: Named in messages.
            doors: What the questions are about.
            changes: Called after each change of the doors.

        Raises:
            AddressError: Questions cannot be taken there.
        """
        from semmap_log.live.planners.oracle import Oracle

        clock_ns = time.time_ns if self.now == Now.clock else _no_clock
        oracle = Oracle(doors, say=say, clock_ns=clock_ns)
        changes.append(oracle.refresh)
        oracle.refresh()  # what has changed in between
        many = counted(len(doors.door_map()), "door")
        with ExitStack() as running:
            failures: list[Callable[[], Exception | None]] = [lambda: oracle.failure]
            if self.asking is not None:
                server = running.enter_context(self.asking.served(oracle))
                say(f"{log}: questions are taken at {server.address}: {many}.")
                failures.append(lambda: server.failure)
            if self.kernels is not None:
                say(f"{log}: kernels of OPRS are served by way of {self.kernels.where}: {many}.")
                service = running.enter_context(
                    kernels_served(self.kernels, oracle, doors, changes)
                )
                failures.append(lambda: service.failure)
            yield lambda: next((why for tell in failures if (why := tell()) is not None), None)


def _no_clock() -> int:
    """Return a time before any log's: then the log's end is what counts."""
    return 0
