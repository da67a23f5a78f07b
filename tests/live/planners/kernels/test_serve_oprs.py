"""`serve --oprs`, as a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import semmap_log as sl
from tests.live.planners.kernels.kernel_world import make_log
from tests.live.planners.kernels.stub_passer import StubPasser
from tests.live.ros.running import Running, wait_until
from tests.verbs import Refuses


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return make_log(tmp_path / "log")


@contextmanager
def _serve(path: Path, *options: str) -> Iterator[Running]:
    folder = path.parent / "serve"
    folder.mkdir(exist_ok=True)
    with (folder / "stdout").open("wb") as stdout, (folder / "stderr").open("wb") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "semmap_log", "serve", str(path), *options],
            stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr,
        )  # fmt: skip
    with Running(process, "serve", folder) as running:
        yield running


@pytest.mark.slow
@pytest.mark.parametrize("is_beside_ask", [False, True])
def test_tells_and_answers_until_it_is_interrupted(path: Path, is_beside_ask: bool) -> None:
    """Alone, or beside `--ask`."""
    more = ("--ask", f"unix:{path.parent / 's'}") if is_beside_ask else ()
    to = ("--oprs-to", "K1", "--oprs-to", "K2")
    with (
        StubPasser() as passer,
        passer.kernel("K1") as kernel,
        passer.kernel("K2"),
        _serve(path, "--oprs", f"127.0.0.1:{passer.port}", *to, *more) as server,
    ):
        for name in ("K1", "K2"):
            passer.wait_for(name, "(DOOR_FACTS SEMMAP 3)")
        assert kernel.answer("(ASK 1 (SET_DOOR_CLOSED DOOR_1))", "1") == "T"
        passer.wait_for("K2", "(DOOR_STATE DOOR_1 CLOSED)")
        if is_beside_ask:
            _ask(more[1], "SET_DOOR_OPEN DOOR_1")
            passer.wait_for("K2", "(DOOR_STATE DOOR_1 OPEN)")
        assert server.stop() == 0, str(server)

    said = f"kernels of OPRS are served by way of 127.0.0.1:{passer.port}: 3 doors."
    assert said in server.errors


def _ask(address: str, question: str) -> None:
    command = [sys.executable, "-m", "semmap_log", "ask", address, question]
    subprocess.run(command, check=True, capture_output=True)


def test_now_is_the_same_for_all_who_ask(tmp_path: Path) -> None:
    """Kernels as well: `--ask-now end` counts from the log's end."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(state="closed", at="2026-01-01T00:00")
        log.observe(door, "open", at="2026-01-01T10:00")
    options = ("--ask", f"unix:{tmp_path / 's'}", "--ask-now", "end", "--oprs-to", "K1")
    with (
        StubPasser() as passer,
        passer.kernel("K1") as kernel,
        _serve(tmp_path / "log", "--oprs", f"127.0.0.1:{passer.port}", *options) as server,
    ):
        passer.wait_for("K1", "(DOOR_FACTS SEMMAP 1)")
        assert kernel.answer('(ASK 1 (DOOR_CLOSED DOOR_1 "2h ago"))', "1") == "T"
        assert server.stop() == 0, str(server)


@pytest.mark.slow
def test_tells_of_a_log_that_another_process_writes(path: Path) -> None:
    """With --read-only; an action is refused, and why stands in the output."""
    names = ("--oprs-name", "MAP_2", "--oprs-to", "K1")
    with (
        StubPasser() as passer,
        passer.kernel("K1") as kernel,
        _serve(path, "--read-only", "--oprs", f"127.0.0.1:{passer.port}", *names) as server,
    ):
        passer.wait_for("K1", "(DOOR_FACTS MAP_2 3)", "MAP_2")
        with sl.append(path) as log:
            log.observe(1, "closed")
        passer.wait_for("K1", "(DOOR_STATE DOOR_1 CLOSED)", "MAP_2")
        kernel.send("(ASK 1 (SET_DOOR_OPEN DOOR_1))", "MAP_2")
        passer.wait_for("K1", "(ANSWER 1 NIL)", "MAP_2")
        assert server.stop() == 0, str(server)

    assert "SET_DOOR_OPEN DOOR_1 from kernel K1: refused: this server only shows" in server.errors


@pytest.mark.slow
def test_serves_on_while_there_is_no_passer(path: Path) -> None:
    """What is written meanwhile is told when there is one."""
    with StubPasser() as passer:
        port = passer.port
    address = f"unix:{path.parent / 's'}"
    with _serve(path, "--oprs", f"127.0.0.1:{port}", "--oprs-to", "K1", "--ask", address) as server:
        server.wait_for("no message passer at")
        _ask(address, "SET_DOOR_CLOSED DOOR_1")
        with StubPasser(port) as passer, passer.kernel("K1"):
            passer.wait_for("K1", "(DOOR_FACTS SEMMAP 3)")
            assert "(DOOR_STATE DOOR_1 CLOSED)" in passer.texts("K1")
            assert server.stop() == 0, str(server)


def test_wrong_options_are_refused(path: Path, refuses: Refuses) -> None:
    """Before anything is opened."""
    refuses(f"""
        serve {path} --oprs-to K1 --ask unix:s
        serve {path} --oprs-name A --ask unix:s
        serve {path} --oprs 127.0.0.1:99999
        serve {path} --oprs :3300
        serve {path} --oprs h --oprs-name kill-mp
        serve {path} --oprs h --oprs-to 'K 1'
        serve {path} --oprs h --costmap
    """)


@pytest.mark.parametrize(
    ("given", "where"),
    [("robot1", "robot1:3300"), ("robot1:3400", "robot1:3400"), ("[::1]", "[::1]:3300")],
)
def test_the_port_may_be_left_out(given: str, where: str) -> None:
    """A message passer has one of its own."""
    from semmap_log.cli.ask import chosen_kernels

    kernels = chosen_kernels(given, None, None)

    assert kernels is not None
    assert (where, "SEMMAP") == (kernels.where, kernels.name)


@pytest.mark.slow
def test_what_a_killed_server_has_done_is_not_done_again(path: Path) -> None:
    """
    The kernel, which may not have got its answer, asks again and is answered as the first time.
    """
    text = "(ASK 1 (SET_DOOR_CLOSED DOOR_1))"
    with StubPasser() as passer, passer.kernel("K1") as kernel:
        for _ in range(2):
            with _serve(path, "--oprs", f"127.0.0.1:{passer.port}") as server:
                passer.wait_until_there("SEMMAP")
                assert kernel.answer(text, "1") == "T"
                server.kill()
            wait_until(lambda: "SEMMAP" not in passer.clients, "the passer to see it")

    assert len([entry for entry in sl.read(path).history(1) if entry.actor == "planner"]) == 1
