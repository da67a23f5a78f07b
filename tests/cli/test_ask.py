"""`serve --ask` and `ask`: two processes, as planners and people use them."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.errors import AddressError
from semmap_log.live.planners.addresses import UnixAddress
from semmap_log.live.planners.line_protocol.tokens import AskClient
from semmap_log.live.ros import joining
from semmap_log.live.ros.ros_node import DEFAULTS
from tests.live.ros.collecting_node import CollectingNode
from tests.live.ros.running import DEADLINE_S, Running, wait_until
from tests.live.ros.serving.goals import goal_of
from tests.verbs import Refuses

ID = "#" + "5c" * 16


@pytest.fixture
def office(tmp_path: Path) -> Path:
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, state="open", name="front")
        log.add_door(x=3.0, y=2.0, theta=0.0, width=0.9, state="closed", name="back door")
    return tmp_path / "office"


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Running]]:
    """Start a server, and stop it at the end; `code` is run by its Python first."""
    started: list[Running] = []

    def start(*options: object, code: str = "") -> Running:
        program = f"{code}\nfrom semmap_log.cli import main\nmain()"
        command = [sys.executable, "-c", program, "serve", *map(str, options)]
        folder = tmp_path / f"server{len(started)}"
        folder.mkdir()
        with (folder / "stdout").open("wb") as out, (folder / "stderr").open("wb") as err:
            process = subprocess.Popen(command, stdout=out, stderr=err)
        running = Running(process, " ".join(command), folder)
        started.append(running)
        running.wait_for("questions are taken at")
        return running

    yield start
    for each in started:
        with each:
            pass


@pytest.fixture
def ask(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run `ask` in this process; return exit code, stdout, stderr."""

    def ask(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as left:
            main(["ask", *map(str, arguments)])
        said = capsys.readouterr()
        return int(left.value.code or 0), said.out, said.err

    return ask


@pytest.mark.slow
def test_a_server_and_its_client(
    office: Path, tmp_path: Path, start: Callable[..., Running],
    ask: Callable[..., tuple[int, str, str]],
) -> None:  # fmt: skip
    """Answers on stdout, a line each; 0 for NIL, too; 1 where a question is none."""
    address = f"unix:{tmp_path / 'doors'}"
    server = start(office, "--ask", address)

    assert ask(address, "DOOR_OPEN DOOR_1") == (0, "T\n", "")
    assert ask(address, "DOOR_OPEN DOOR_2") == (0, "NIL\n", "")
    assert ask(address, 'DOOR_STATE "back door"', "DOORS")[:2] == (
        0, "CLOSED\n(DOOR_1 DOOR_2)\n",
    )  # fmt: skip
    assert ask(address, "SET_DOOR_OPEN DOOR_2") == (0, "T\n", "")
    code, out, err = ask(address, "DOOR_AJAR DOOR_2")
    assert (1, "") == (code, out)
    assert err.startswith("semmap-log: 'DOOR_AJAR' is no question. Did you mean DOOR_")
    code, out, err = ask(address, "DOOR_AJAR DOOR_2", "DOOR_OPEN DOOR_2")
    assert "1 of 2 questions failed. On a command line each question stands in quotes." in err
    assert (1, 'ERROR "', "\nT\n") == (code, out[:7], out[-3:])
    assert ask(address, "DOOR_OPEN DOOR_9", "--json")[1] == (
        '{"answer": false, "reason": "no door DOOR_9 is in the map."}\n'
    )
    code, out, _ = ask(address, "DOOR_AJAR", "--json")
    assert (1, "QuestionError") == (code, json.loads(out)["error"]["kind"])
    assert ask(address, "SET_DOOR_OPEN DOOR_9")[:2] == (0, "NIL\n")
    assert "SET_DOOR_OPEN DOOR_9 from pid" in server.errors

    assert server.stop(signal.SIGINT) == 0
    assert not (tmp_path / "doors").exists()
    assert "office: closed." in server.errors
    assert sl.read(office).replay()[2].state is sl.DoorState.OPEN
    code, _, err = ask(address, "DOORS")
    assert (1, "no server answers there" in err) == (code, True)


@pytest.mark.slow
def test_questions_from_stdin_are_answered_as_they_come(
    office: Path, tmp_path: Path, start: Callable[..., Running]
) -> None:
    """A program can hold a conversation; JSON and words in turn; 1 if one was none."""
    address = f"unix:{tmp_path / 'doors'}"
    start(office, "--ask", address)
    client = subprocess.Popen(
        [sys.executable, "-m", "semmap_log", "ask", address],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1,
    )  # fmt: skip
    assert client.stdin is not None
    assert client.stdout is not None
    said = []
    for line in ("DOOR_OPEN DOOR_front", '{"ask": "DOORS", "id": 1}', "FOO", "DOOR_OPEN DOOR_2"):
        client.stdin.write(f"{line}\n")
        said.append(client.stdout.readline())
    client.stdin.close()

    assert ["T\n", '{"answer": ["DOOR_1", "DOOR_2"], "id": 1}\n', "NIL\n"] == said[:2] + said[3:]
    assert 'ERROR "' in said[2]
    assert 1 == client.wait(DEADLINE_S)
    client.stdout.close()


@pytest.mark.slow
def test_a_log_that_another_process_writes(
    office: Path, tmp_path: Path, start: Callable[..., Running],
    ask: Callable[..., tuple[int, str, str]],
) -> None:  # fmt: skip
    """--read-only follows it: a wait ends with what is written there, and nothing is set."""
    address = f"unix:{tmp_path / 'doors'}"
    with sl.append(office) as log:
        start(office, "--read-only", "--ask", address)
        assert ask(address, "DOOR_OPEN DOOR_2")[1] == "NIL\n"
        log.observe(2, "open")
        assert ask(address, "WAIT_UNTIL DOOR_2 OPEN 60", "DOOR_OPEN DOOR_2")[1] == "T\nT\n"
        refused = json.loads(ask(address, "SET_DOOR_CLOSED DOOR_2", "--json")[1])

    assert refused["answer"] is False
    assert "--read-only" in refused["reason"]


def test_beside_ros(office: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One log: planners see what goals did when these are answered."""
    node, stops = CollectingNode(), list[Callable[[], object]]()
    path, found = tmp_path / "doors", list[object]()
    monkeypatch.setattr(joining, "open_node", lambda *_: node)
    monkeypatch.setattr("semmap_log.cli.serve.on_stop", stops.append)

    def plan() -> None:
        try:
            wait_until(lambda: DEFAULTS["UpdateDoor"] in node.actions, "the actions")
            with AskClient(UnixAddress(path)) as client:
                goal = goal_of("UpdateDoor", "u", door_id=2, change_open=True, door_state="OPEN")
                node.actions[DEFAULTS["UpdateDoor"]](goal)
                found.append(client.ask("DOOR_OPEN DOOR_2"))
                found.append(client.ask("SET_DOOR_CLOSED DOOR_2"))
                shown = node.messages["lta_semantic_map_door_db"]
                wait_until(lambda: shown[-1].door_db[1].door_state == "CLOSED", "the map")
        finally:
            stops[0]()

    planning = threading.Thread(target=plan)
    planning.start()
    with pytest.raises(SystemExit) as left:
        main(["serve", str(office), "--ros1", "--ask", f"unix:{path}"])
    planning.join()

    assert (0, ["T", "T"]) == (left.value.code or 0, found)
    assert not path.exists()


KILLED_BEFORE_ITS_ANSWER = """
import os, signal
from semmap_log.live.planners import oracle

act = oracle.act

def act_and_die(doors, asked, client):
    act(doors, asked, client)
    if asked.command_id is not None:
        os.kill(os.getpid(), signal.SIGKILL)

oracle.act = act_and_die
"""


@pytest.mark.slow
def test_an_action_whose_answer_was_lost_is_stored_once(
    office: Path, tmp_path: Path, start: Callable[..., Running],
    ask: Callable[..., tuple[int, str, str]],
) -> None:  # fmt: skip
    """SIGKILL between its commit and its answer."""
    address = f"unix:{tmp_path / 'doors'}"
    line = f"{ID} SET_DOOR_OPEN DOOR_2"
    killed = start(office, "--ask", address, code=KILLED_BEFORE_ITS_ANSWER)

    code, out, err = ask(address, line)
    assert (1, "") == (code, out)
    assert "the server has gone" in err
    assert killed.wait() == -signal.SIGKILL
    assert (tmp_path / "doors").exists()
    start(office, "--ask", address)
    assert ask(address, "SET_DOOR_CLOSED DOOR_2")[1] == "T\n"
    assert ask(address, line)[1] == "T\n"
    assert ask(address, "DOOR_OPEN DOOR_2")[1] == "NIL\n"

    commits = [each for each in sl.read(office).commits() if each.command_id == b"\x5c" * 16]
    assert 1 == len(commits)


class Asking(threading.Thread):
    """Sends one action after the other until the server has gone; each has an id of its own."""

    def __init__(self, path: Path, number: int) -> None:
        super().__init__()
        self._path, self._number = path, number
        self.answered: list[str] = []
        self.open = ""
        """The action that nobody answered."""

    def run(self) -> None:
        with AskClient(UnixAddress(self._path)) as client, suppress(AddressError):
            for i in count():
                self.open = f"{self._number:016x}{i:016x}"
                line = f"#{self.open} SET_OPEN_PROBABILITY DOOR_{self._number} 0.{i}"
                if client.ask(line) == "T":
                    self.answered.append(self.open)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_what_was_answered_is_stored_however_the_server_ends(
    office: Path, tmp_path: Path, start: Callable[..., Running],
    ask: Callable[..., tuple[int, str, str]], number: int,
) -> None:  # fmt: skip
    """Among the actions of two clients; what nobody answered is sent again, and stored once."""
    path = tmp_path / "doors"
    server = start(office, "--ask", f"unix:{path}")
    clients = [Asking(path, door) for door in (1, 2)]
    for each in clients:
        each.start()
    wait_until(lambda: all(len(each.answered) > 50 for each in clients), "some answers")
    server.stop(number)
    for each in clients:
        each.join()
    start(office, "--ask", f"unix:{path}")
    again = [f"#{each.open} SET_OPEN_PROBABILITY DOOR_{i} 0.{int(each.open[16:], 16)}"
             for i, each in enumerate(clients, 1)]  # fmt: skip

    assert (0, "T\nT\n") == ask(f"unix:{path}", *again)[:2]
    stored = Counter(each.note.correlation for each in sl.read(office).commits())
    assert {said: 1 for each in clients for said in (*each.answered, each.open)} == {
        said: times for said, times in stored.items() if said
    }


@pytest.mark.slow
def test_a_port_with_a_token(
    office: Path, tmp_path: Path, start: Callable[..., Running],
    ask: Callable[..., tuple[int, str, str]],
) -> None:  # fmt: skip
    """On any host, and then only for who has it; the port is told where any was asked for."""
    token = tmp_path / "token"
    token.write_text("0123456789abcdef0123\n")
    token.chmod(0o600)
    server = start(office, "--ask", "tcp:0.0.0.0:0", "--ask-any-host", "--token-file", token)
    port = server.wait_for(r"taken at tcp:0\.0\.0\.0:(\d+)")[1]

    assert ask(f"tcp:localhost:{port}", "DOORS", "--token-file", token)[1] == "(DOOR_1 DOOR_2)\n"
    code, _, err = ask(f"tcp:localhost:{port}", "DOORS")
    assert 1 == code
    assert "the server's token first" in err
    token.write_text("another-token-than-that\n")
    code, _, err = ask(f"tcp:localhost:{port}", "DOORS", "--token-file", token)
    assert 1 == code
    assert "the server refused this token: it expects another one, or none." in err
    assert 'ERROR "' not in err


def test_a_wrong_address(refuses: Refuses) -> None:
    """What is no address is wrong usage; where nobody answers, it is told how somebody would."""
    refuses("""
        ask doors.sock DOORS
        ask unix:doors.sock DOORS --token-file nowhere
        ask unix:no.sock DOORS
    """)


@pytest.mark.slow
def test_a_log_that_vanishes_ends_its_read_only_server(
    office: Path, tmp_path: Path, start: Callable[..., Running]
) -> None:
    """With the error, and exit code 1: no planner is told what was true long ago."""
    server = start(office, "--read-only", "--ask", f"unix:{tmp_path / 'doors'}")
    for each in office.glob("*.mcap"):
        each.unlink()

    assert 1 == server.wait()
    assert "semmap-log: " in server.errors
    assert "Traceback" not in server.errors


def test_options_that_make_no_sense(office: Path, refuses: Refuses) -> None:
    """Exit code 2, before anything is opened."""
    refuses(f"""
        serve {office} --ask here
        serve {office} --ros1 --ask-any-host
        serve {office} --ros1 --token-file t
        serve {office} --ros1 --ask-now end
        serve {office} --ask unix:s --token-file t
        serve {office} --ask unix:s --ask-any-host
        serve {office} --ask tcp:192.0.2.1:1 --ask-any-host
        serve {office} --ask tcp:127.0.0.1:1 --token-file nowhere
        serve {office} --ask unix:s --costmap
        serve {office} --ask unix:s --save-root .
        serve {office} --ask unix:s --ros1 --ros2
    """)


@pytest.mark.parametrize("address", ["tcp:0.0.0.0:0", "unix:/nowhere/s"])
def test_an_address_that_cannot_be_taken(
    office: Path, capsys: pytest.CaptureFixture[str], address: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Exit code 1, one line, and the log is closed."""
    monkeypatch.setattr("semmap_log.cli.serve.on_stop", lambda _: None)
    with pytest.raises(SystemExit) as left:
        main(["serve", str(office), "--ask", address])

    assert 1 == left.value.code
    assert capsys.readouterr().err.startswith(f"semmap-log: {address}: ")
    sl.append(office).close()


@pytest.mark.slow
def test_now_is_the_clock_or_the_logs_end(
    tmp_path: Path, start: Callable[..., Running], ask: Callable[..., tuple[int, str, str]]
) -> None:
    """
    Of a log that ended years ago, an hour ago is after its end, unless it is counted from there.
    """
    with sl.create(tmp_path / "old", tz="UTC") as log:
        door = log.add_door(state="closed", at="2020-01-01T08:00")
        log.observe(door, "open", at="2020-01-01T10:00")
    for now, state in (("clock", "OPEN"), ("end", "CLOSED")):
        address = f"unix:{tmp_path / now}"
        server = start(tmp_path / "old", "--read-only", "--ask", address, "--ask-now", now)
        assert ask(address, 'DOOR_STATE DOOR_1 "1h ago"')[1] == f"{state}\n"
        server.stop()


@pytest.mark.slow
def test_help_is_a_list_for_a_person(
    office: Path, tmp_path: Path, start: Callable[..., Running],
    ask: Callable[..., tuple[int, str, str]], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A question a line in a terminal; one line, as any answer, for a program."""
    address = f"unix:{tmp_path / 'doors'}"
    start(office, "--ask", address)
    monkeypatch.setattr("semmap_log.cli.sanitized_streams.is_for_people", lambda: True)
    lines = ask(address, "HELP")[1].splitlines()
    monkeypatch.setattr("semmap_log.cli.sanitized_streams.is_for_people", lambda: False)

    assert 20 == len(lines)
    assert lines[1] == "DOOR_OPEN DOOR [TIME] - predicate: it is OPEN"
    assert 1 == ask(address, "HELP")[1].count("\n")
