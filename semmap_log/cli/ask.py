"""`ask`: a planner's questions, to a running server; and the options of `serve` for planners.

`serve --ask` runs a server of questions, next to ROS or alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import sanitized_streams
from semmap_log.cli.common import say
from semmap_log.cli.sanitized_streams import write_line
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.live.planners.addresses import Address
    from semmap_log.live.planners.line_protocol.ask_server import AskServer
    from semmap_log.live.planners.line_protocol.tokens import AskClient
    from semmap_log.live.planners.oracle import Oracle, QueriedDoors


ASK_POLL_S = 0.01
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

    if questions == ["HELP"] and sanitized_streams.is_for_people() and answer.startswith("("):
        for line in split_words(answer[1:-1]):
            write_line(line)
    else:
        write_line(answer)
    sys.stdout.flush()


TICK_S = 0.1
"""How often a server without ROS looks whether it is to end."""


@dataclass(frozen=True, slots=True)
class Planners:
    """Who asks, and how."""

    asking: Asking
    """Over a socket."""
    now: Now
    """What relative times count from."""

    @classmethod
    def of(cls, asking: Asking | None, now: Now) -> Planners | None:
        """Return who asks; None: nobody.

        Raises:
            typer.BadParameter: A choice is about them, and there are none.
        """
        if asking is not None:
            return cls(asking, now)
        if now != Now.clock:
            raise typer.BadParameter("only with --ask", param_hint="--ask-now")
        return None

    @contextmanager
    def served(
        self, log: Path, doors: QueriedDoors, changes: list[Callable[[], object]]
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
        with self.asking.served(oracle) as server:
            say(f"{log}: questions are taken at {server.address}: {many}.")
            yield lambda: oracle.failure or server.failure


def _no_clock() -> int:
    """Return a time before any log's: then the log's end is what counts."""
    return 0
