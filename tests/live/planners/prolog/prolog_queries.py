"""Runs goals in SWI-Prolog, and servers that answer it as no good one does."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from tests.live.ros.running import DEADLINE_S

MODULE = Path(str(files("semmap_log") / "live" / "planners" / "prolog" / "semmap_log.pl"))

needs_swipl = pytest.mark.skipif(
    shutil.which("swipl") is None, reason="SWI-Prolog is not here: apt install swi-prolog-nox"
)

_RUN = r"""
:- use_module(MODULE).
run(end_of_file) :- !.
run((Template :- Goal)) :-
    catch(( findall(Template, Goal, Found), format("~q~n", [Found]) ),
          Error, ( told(Error, Told), format("~q~n", [Told]) )),
    read(Next),
    run(Next).
told(error(Formal, _), error(Copy)) :- !, copy_term(Formal, Copy), numbervars(Copy, 0, _).
told(Error, Error).
:- initialization((read(First), run(First), halt), main).
"""


def solutions(folder: Path, *goals: str) -> list[str]:
    """Return what SWI-Prolog finds: a line each, all templates of `Template :- Goal`, or its error.

    Args:
        folder: Where it runs.
        goals: One process runs them, in order.
    """
    program = folder / "run.pl"
    program.write_text(_RUN.replace("MODULE", f"'{MODULE}'"), encoding="utf-8")
    done = subprocess.run(
        ["swipl", program], input="".join(f"{goal}.\n" for goal in goals), cwd=folder,
        capture_output=True, encoding="utf-8", timeout=DEADLINE_S, check=False,
    )  # fmt: skip
    assert ("", 0) == (done.stderr, done.returncode)
    return done.stdout.splitlines()


@contextmanager
def answering(
    path: Path, answer: Callable[[int, dict[str, Any]], bytes | None]
) -> Iterator[list[dict[str, Any]]]:
    """Run a server that answers line n as it is told, and yield the questions that it got.

    Args:
        path: Of its socket.
        answer: What it sends to a question; None: it closes the connection instead.
    """
    got: list[dict[str, Any]] = []
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(path))
    listener.listen()
    listener.settimeout(0.05)
    ends = threading.Event()

    def serve() -> None:
        while not ends.is_set():
            try:
                client, _ = listener.accept()
            except TimeoutError:
                continue
            client.settimeout(DEADLINE_S)
            with client, client.makefile("rb") as lines:
                for line in lines:
                    got.append(json.loads(line))
                    said = answer(len(got) - 1, got[-1])
                    if said is None:
                        break
                    client.sendall(said)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield got
    finally:
        ends.set()
        thread.join(DEADLINE_S)
        listener.close()
