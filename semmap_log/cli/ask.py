"""`ask`: a planner's questions, to a server that runs."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import plain_streams
from semmap_log.cli.asking import chosen_address, chosen_token
from semmap_log.cli.common import say
from semmap_log.cli.plain_streams import write_line
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.live.planners.line_protocol.ask_client import AskClient


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
    from semmap_log.live.planners.line_protocol.ask_client import AskClient

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
