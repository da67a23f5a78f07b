"""SWI-Prolog asks a server about doors: truth, refusals, errors, and connections that break."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.errors import OutputError
from semmap_log.live.planners.prolog.prolog_module import write_prolog_module
from tests.live.planners.asker import Asker
from tests.live.planners.line_protocol.running_server import serving, unix_in
from tests.live.planners.prolog.prolog_queries import MODULE, answering, needs_swipl, solutions
from tests.live.ros.running import Running, wait_until

Ask = Callable[..., list[str]]


@pytest.fixture
def prolog(ask: Asker, tmp_path: Path) -> Iterator[Ask]:
    """Run goals beside a server of five doors: see `path`."""
    with serving(ask, unix_in(tmp_path)):
        yield lambda *goals: solutions(tmp_path, "x :- door_server('unix:s')", *goals)[1:]


@needs_swipl
def test_what_is_true_is_found_by_backtracking(prolog: Ask) -> None:
    """Doors by id, as numbers; also by name, and the other way round: which are open."""
    assert [
        "[1-open,2-closed,3-unknown,4-moving,5-offline]",
        "[1]",
        "[1,2,3,4,5]",
        "[closed]",
        "[moving]",
        "[open]",
        "[[1],[2]]",
        "[]",
        "[]",
        "[]",
    ] == prolog(
        "D-S :- door_state(D, S)",
        "D :- door_state(D, open)",
        "D :- door(D)",
        'S :- door_state("back door", S)',
        "S :- door_state(gate, S)",
        "S :- door_state('DOOR_main_door', S)",
        "D :- (open_doors(D) ; closed_doors(D))",
        "x :- door_state(2, open)",
        "x :- door_state(99, _)",
        "x :- door(nowhere)",
    )


@needs_swipl
def test_a_time_asks_what_was_true_or_believed_then(tmp_path: Path) -> None:
    """As a text, an event, or a time stamp of Prolog's own, to the last digit that it has."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(state="open", at="2026-03-01T12:00")  # event 0
        log.add_door(state="open", at="2026-03-01T12:00")
        log.observe(1, "closed", at="2026-03-01T14:00:00.5")
        log.observe(1, "open", at="2026-03-01T16:00")
        log.observe(2, "closed", at="2026-03-01T13:00")  # event 4, told late
    half_s = sl.read(tmp_path / "log").instant("2026-03-01T14:00:00.5") / 10**9
    asker = Asker(tmp_path / "log")
    try:
        with serving(asker, unix_in(tmp_path)):
            found = solutions(
                tmp_path,
                "x :- door_server('unix:s')",
                "S :- door_state(1, S)",
                "S :- door_state(1, S, '2026-03-01T15:00')",
                f"S :- door_state(1, S, {half_s!r})",
                f"S :- door_state(1, S, {half_s - 0.001!r})",
                "S :- door_state(1, S, event(2))",
                "S :- door_state(2, S, event(3))",
                "S :- door_state(2, S, '2026-03-01T15:00')",
                "S :- believed_state(2, S, event(3))",
                "D :- believed_state(D, open, event(3))",
                "D-S :- believed_state(D, S, event(2))",
                'D :- door_state(D, closed, "2026-03-01T15:00")',
                "D :- door_state(D, _, '2026-03-01T11:00')",
            )[1:]
    finally:
        asker.close()

    assert ["[open]", "[closed]", "[closed]", "[open]", "[closed]", "[open]", "[closed]", "[open]",
            "[1,2]", "[1-closed,2-open]", "[1,2]", "[]"] == found  # fmt: skip


@needs_swipl
def test_actions_succeed_when_they_last_and_fail_when_refused(prolog: Ask, path: Path) -> None:
    """With the reason; what is in the log then is what Prolog was told."""
    assert [
        "[x]",
        "[]",
        '["no door DOOR_99 is in the map."]',
        "[open]",
        "[x]",
        "[0.25]",
        "[]",
        '["expected a probability from 0 to 1, got 1.5."]',
        "[x]",
        "[]",
        "[x]",
        "[]",
        "[]",
    ] == prolog(
        "x :- set_open(2)",
        "x :- set_open(99)",
        "R :- refusal(R)",
        "S :- door_state(2, S)",
        "x :- set_p_open(main_door, 0.25)",
        "P :- map_p_open(1, P)",
        "x :- set_p_closed(1, 1.5)",
        "R :- refusal(R)",
        "x :- set_closed(1)",
        "P :- map_p_open(2, P)",
        "x :- remove_door(4)",
        "x :- door(4)",
        "R :- (door(1), refusal(R))",
    )

    doors = sl.read(path).replay().doors
    assert ("CLOSED", "OPEN", 0.25) == (
        doors[1].state.name,
        doors[2].state.name,
        doors[1].prob_open,
    )
    assert 4 not in doors
    assert "planner" == list(sl.read(path).history())[-1].actor


@needs_swipl
def test_what_is_likely_is_learnt_or_fails(prolog: Ask, path: Path) -> None:
    """Of a door of which nothing was seen there is no number, and refusal/1 says so."""
    none, why, likely, following, two = prolog(
        "P :- p_open(3, P)",
        'R :- (\\+ p_open(3, "now", _), refusal(R))',
        "true :- forall(p_open(1, P), (number(P), P >= 0, P =< 1))",
        "D :- next_door([2, 1, 'no such door'], D)",
        "x :- (wait_until(1, open, 1), \\+ wait_until(1, closed, 0.01))",
    )

    assert "[]" == none
    assert why.startswith('["too little was seen of it')
    assert "[true]" == likely
    assert following in {"[1]", "[2]"}
    assert "[x]" == two


@needs_swipl
def test_what_cannot_be_asked_is_an_error(prolog: Ask) -> None:
    """
    Of Prolog's own kinds where it is about an argument, with the server's words where it says no.
    """
    found = prolog(
        "x :- ask_doors('NO_SUCH', [], _)",
        'x :- door_state(1, _, "no time")',
        "x :- set_open(_)",
        "x :- set_open(f(1))",
        "x :- set_open(-1)",
        "x :- set_p_open(1, a)",
        "x :- door_state(1, ajar)",
        "x :- next_door(a, _)",
        "x :- door_server('tcp:nowhere')",
        "x :- door_server('unix:')",
        "x :- door_server('unix:s', [timeout(0)])",
        'A :- ask_doors("DOORS", ["OPEN"], A)',
    )

    assert found[0].startswith("error(door_server_error(\"'NO_SUCH' is no question.")
    assert found[1].startswith('error(door_server_error("DOOR_STATE DOOR [TIME]: Expected a moment')
    assert "error(instantiation_error)" == found[2]
    assert "error(type_error(door,f(1)))" == found[3]
    kinds = [line.split("(")[1] for line in found[4:11]]
    assert {"type_error", "domain_error"} == set(kinds), found
    assert '[["DOOR_1"]]' == found[-1]


@needs_swipl
@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=30),
                min_size=5, max_size=20))  # fmt: skip
def test_no_name_asks_or_does_anything_else(ask: Asker, tmp_path: Path, names: list[str]) -> None:
    """
    Line ends, quotes and braces in a name stay in the name, on the way there and on the way back.
    """
    names = [
        *names,
        "\nREMOVE_DOOR DOOR_1",
        '"]}\n{"ask":"REMOVE_DOOR","args":["DOOR_1"]}',
        "halt.",
    ]
    codes = [f"[{','.join(str(ord(letter)) for letter in name)}]" for name in names]
    (tmp_path / "s").unlink(missing_ok=True)
    before = ask.doors.log.replay()

    with serving(ask, unix_in(tmp_path)):
        found = solutions(
            tmp_path,
            "x :- door_server('unix:s')",
            *(f"C :- (string_codes(N, {each}), \\+ set_p_open(N, 7), refusal(R), "
              f'ask_doors("HELP", [], _), string_codes(R, C))' for each in codes),
        )[1:]  # fmt: skip

    assert len(names) == len(found)
    for line in found:  # none of them is a door: what is wrong with it is said, as a list of codes
        assert line.startswith("error(door_server_error(") or json.loads(line), line
    assert before.event == ask.doors.log.replay().event


ANSWER = '{{"answer": true, "id": {id}}}\n'


def say(text: str, question: dict[str, Any]) -> bytes:
    return text.format(id=question["id"]).encode()


@needs_swipl
def test_a_lost_answer_is_asked_for_again_with_the_same_id(tmp_path: Path) -> None:
    """So that an action is done once. A question, too: nobody is told of the broken connection."""

    def answer(count: int, question: dict[str, Any]) -> bytes | None:
        return None if count == 1 else say(ANSWER, question)

    with answering(tmp_path / "s", answer) as got:
        found = solutions(tmp_path, "x :- door_server('unix:s')", "x :- set_open(1)",
                          "x :- set_open(2)", "x :- set_open(2)")  # fmt: skip

    assert ["[x]"] * 4 == found
    first, lost, again, new = got
    assert lost == again
    ids = [each["command_id"] for each in (first, lost, new)]
    assert 3 == len(set(ids))
    assert all(32 == len(each) and int(each, 16) >= 0 for each in ids)


@needs_swipl
@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (b"", 'error(timeout_error(answer,"unix:s"))'),
        (b'{"answer": true, "id"', 'error(timeout_error(answer,"unix:s"))'),
        (b'{"answer": true, "id": 77}\n', 'error(existence_error(door_server,"unix:s"))'),
        (b'{"answer": tr\n', 'error(existence_error(door_server,"unix:s"))'),
        (b"{}\n", 'error(existence_error(door_server,"unix:s"))'),
        (b'ERROR "come later"\n', 'error(door_server_error("come later"))'),
        (b'{"error": "no \\"such\\" thing"}\n', 'error(door_server_error("no \\"such\\" thing"))'),
        (b"HTTP/1.1 400\n", 'error(door_server_error("HTTP/1.1 400"))'),
    ],
)
def test_an_answer_that_is_none_is_an_error_and_not_the_next_ones(
    answer: bytes, error: str, tmp_path: Path
) -> None:
    """The connection is left where a late answer could be taken for that of another question."""

    def reply(count: int, question: dict[str, Any]) -> bytes:
        return answer if count == 0 else say(ANSWER, question)

    with answering(tmp_path / "s", reply):
        found = solutions(tmp_path, "x :- door_server('unix:s', [timeout(0.4)])",
                          "x :- set_open(1)", "x :- set_open(1)")  # fmt: skip

    assert ["[x]", error, "[x]"] == found


@needs_swipl
def test_who_is_interrupted_gets_no_answer_of_before(prolog: Ask) -> None:
    """A time limit of the program's own ends a question; the next one has its own answer."""
    assert ["[]", "[time_limit_exceeded]", "[open]", "[[2]]"] == prolog(
        "x :- wait_until(1, closed, 0.01)",
        "E :- catch(call_with_time_limit(0.2, wait_until(1, closed, 50)), E, true)",
        "S :- door_state(1, S)",
        "D :- closed_doors(D)",
    )


@needs_swipl
def test_where_nobody_answers_is_an_error_at_once(tmp_path: Path) -> None:
    """And so is having named nobody."""
    assert [
        "error(existence_error(door_server,none))",
        "[x]",
        'error(existence_error(door_server,"unix:s"))',
    ] == solutions(tmp_path, "x :- door(1)", "x :- door_server('unix:s')", "x :- door(1)")


@needs_swipl
def test_each_thread_has_a_connection_of_its_own(ask: Asker, tmp_path: Path) -> None:
    """Four at once get each its own answers, and their connections end with them."""
    with serving(ask, unix_in(tmp_path)) as server:
        found = solutions(
            tmp_path,
            "x :- door_server('unix:s')",
            "D :- (numlist(1, 4, Ds), concurrent_maplist([D, S]>>(between(1, 50, _), "
            "door_state(D, S), fail ; door_state(D, S)), Ds, Ss), D = Ss)",
            "x :- door_disconnect",
        )
        wait_until(lambda: not server._connections, "connections of threads that ended")

    assert ["[x]", "[[open,closed,unknown,moving]]", "[x]"] == found


@needs_swipl
def test_a_token_is_given_first(ask: Asker, tmp_path: Path) -> None:
    """The right one opens; with a wrong one, or none, the server's words are the error."""
    token = "correct-horse-battery"
    with serving(ask, "tcp:127.0.0.1:0", token=token) as server:
        address = server.address
        found = solutions(
            tmp_path,
            f"x :- door_server('{address}', [token('{token}')])",
            "S :- door_state(1, S)",
            f"x :- door_server('{address}', [token(\"wrong\")])",
            "S :- door_state(1, S)",
            f"x :- door_server('{address}')",
            "S :- door_state(1, S)",
        )

    assert "[open]" == found[1]
    for wrong in (found[3], found[5]):
        assert wrong.startswith('error(door_server_error("expected TOKEN')


@needs_swipl
def test_a_server_that_is_killed_and_started_again_is_found_again(
    path: Path, tmp_path: Path
) -> None:
    """The program in Prolog sees nothing of it."""
    command = [sys.executable, "-m", "semmap_log", "serve", str(path), "--ask", "unix:s"]

    def start() -> Running:
        with (tmp_path / "stdout").open("wb") as out, (tmp_path / "stderr").open("wb") as err:
            process = subprocess.Popen(command, cwd=tmp_path, stdout=out, stderr=err)
        return Running(process, "serve", tmp_path)

    with start() as server:
        server.wait_for("questions are taken")
        said: list[str] = []

        def ask() -> None:
            said.extend(solutions(
                tmp_path,
                "x :- door_server('unix:s', [timeout(60)])",
                "x :- set_open(2)",
                "x :- (open('asked', write, F), close(F), repeat, exists_file('killed'), !)",
                "x :- set_closed(2)",
                "S :- door_state(2, S)",
            ))  # fmt: skip

        asking = threading.Thread(target=ask)
        asking.start()
        wait_until((tmp_path / "asked").exists, "the first action")
        server.process.send_signal(signal.SIGKILL)
        server.process.wait()
        (tmp_path / "killed").touch()
    with start() as server:
        server.wait_for("questions are taken")
        asking.join()

    assert ["[x]"] * 4 + ["[closed]"] == said
    changes = [entry.kind for entry in sl.read(path).history(2) if entry.kind == "DoorUpdated"]
    assert ["DoorUpdated"] * 2 == changes


def test_the_module_is_laid_out_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same again is left; another file of that name is nobody's to replace."""
    with pytest.raises(SystemExit):
        main(["prolog-module", str(tmp_path / "planner")])
    module = tmp_path / "planner" / "semmap_log.pl"

    assert f"{module}: written" in capsys.readouterr().err
    assert MODULE.read_bytes() == module.read_bytes()
    assert (module, False) == write_prolog_module(tmp_path / "planner")
    module.write_text("mine")
    with pytest.raises(OutputError, match="exists already, and differs from this module"):
        write_prolog_module(tmp_path / "planner")
    assert "mine" == module.read_text()
    with pytest.raises(OutputError, match="could not be written"):
        write_prolog_module(module)
