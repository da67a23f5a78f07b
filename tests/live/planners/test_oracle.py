"""The oracle, asked line by line: what each question is answered, and what an action becomes."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorUpdated, LevelAdded
from semmap_log.live.planners.door_view import MOST_REMEMBERED
from semmap_log.live.planners.oracle import Oracle
from semmap_log.live.planners.parsed_questions import BY_NAME, read_words
from semmap_log.live.planners.question_lines import Answer
from tests.live.planners.asker import CLIENT, Asker
from tests.live.ros.running import wait_until

ID = "#" + bytes(range(16)).hex()


def _answers(ask: Asker, *names: str) -> dict[str, str]:
    return {name: "".join(ask(f"{name} DOOR_{i}")[0] for i in range(1, 7)) for name in names}


def test_predicates_of_each_state(ask: Asker) -> None:
    """OPEN, CLOSED, UNKNOWN, MOVING, OFFLINE, and a door that is not there."""
    assert {
        "DOOR_STATE_KNOWN": "TTNTTN",
        "DOOR_OPEN": "TNNNNN",
        "DOOR_CLOSED": "NTNNNN",
    } == _answers(ask, "DOOR_STATE_KNOWN", "DOOR_OPEN", "DOOR_CLOSED")


def test_functions_of_a_door_that_is_not_there(ask: Asker) -> None:
    """NIL, with the reason in JSON; a predicate is false."""
    for name in ("PROBABILITY_DOOR_OPEN", "PROBABILITY_DOOR_CLOSED", "DOOR_STATE", "WHY",
                 "BEST_TIME"):  # fmt: skip
        assert {"answer": None, "reason": "no door DOOR_9 is in the map."} == ask.json(name, 9)
        assert ask(f"{name} DOOR_9") == "NIL"
    assert {"answer": False, "reason": "no door DOOR_9 is in the map."} == ask.json("DOOR_OPEN", 9)
    assert ask("PROBABILITY_DOOR_OPEN DOOR_9 AT now") == "NIL"
    assert ask('BELIEVED DOOR_STATE DOOR_9 AT "now"') == "NIL"


def test_a_probability_that_was_never_set(ask: Asker) -> None:
    """NIL; once it is set, the number to the last digit."""
    assert {"answer": None, "reason": "it has none."} == ask.json("PROBABILITY_DOOR_OPEN", 1)

    assert ask("SET_OPEN_PROBABILITY DOOR_1 0.1000000000000000055") == "T"
    assert ask("SET_CLOSED_PROBABILITY DOOR_1 1e-7") == "T"

    assert ask("PROBABILITY_DOOR_OPEN DOOR_1") == "0.1"
    assert ask("PROBABILITY_DOOR_CLOSED DOOR_1") == "1e-07"


def test_any_door_in_a_state_is_the_one_with_the_lowest_id(ask: Asker) -> None:
    """NIL where there is none."""
    assert ("DOOR_1", "DOOR_2") == (ask("GET_OPEN_DOOR"), ask("GET_CLOSED_DOOR"))

    ask("SET_DOOR_CLOSED DOOR_1")

    assert ("NIL", "DOOR_1") == (ask("GET_OPEN_DOOR"), ask("GET_CLOSED_DOOR"))


def test_doors_in_a_state_or_in_any(ask: Asker) -> None:
    """Ids ascending; each state finds its own."""
    assert ask("DOORS") == "(DOOR_1 DOOR_2 DOOR_3 DOOR_4 DOOR_5)"
    assert ["(DOOR_1)", "(DOOR_2)", "(DOOR_3)", "(DOOR_4)", "(DOOR_5)"] == [
        ask(f"DOORS {state}") for state in ("OPEN", "CLOSED", "UNKNOWN", "MOVING", "OFFLINE")
    ]
    assert {"answer": ["DOOR_1"]} == ask.json("DOORS", "OPEN")
    ask("SET_DOOR_OPEN DOOR_2")
    assert ["(DOOR_1 DOOR_2)", "()"] == [ask("DOORS OPEN"), ask("DOORS CLOSED")]


@pytest.mark.parametrize(
    ("word", "door"),
    [
        ("DOOR_1", 1),
        ("DOOR_main_door", 1),
        ("DOOR_back", None),
        ('"DOOR_back door"', 2),
        ('"back door"', 2),
        ("main_door", 1),
        ("id:3", 3),
        ("DOOR_3", 3),
        ("5", 5),
        ("DOOR_03", None),
        ("DOOR_+3", None),
        ("DOOR_", None),
        ("door_1", None),
        ("DOOR_99999999999999999999", None),
        ("DOOR_4294967296", None),
        ("DOOR_0", None),
        ("DOOR_\u0661", None),
    ],
)
def test_what_a_door_is_called(ask: Asker, word: str, door: int | None) -> None:
    """By its id, by its name, or as on the command line; another spelling of a number is none."""
    expected = {1: "OPEN", 2: "CLOSED", 3: "UNKNOWN", 4: "MOVING", 5: "OFFLINE"}

    assert ("NIL" if door is None else expected[door]) == ask(f"DOOR_STATE {word}")


def test_a_name_that_looks_like_an_id_means_the_id(path: Path, clock: SteadyClock) -> None:
    """Whatever doors are called, DOOR_2 is the door with the id 2."""
    with sl.append(path, clock=clock) as log:
        log.annotate(1, "name", "2")
        log.annotate(4, "name", "DOOR_5")
    ask = Asker(path, clock=clock)

    assert ("CLOSED", "OFFLINE") == (ask("DOOR_STATE DOOR_2"), ask("DOOR_STATE DOOR_5"))
    assert ask("DOOR_STATE DOOR_DOOR_5") == "MOVING"
    assert "can mean 2 doors" in ask.json("DOOR_STATE", "2")["reason"]
    ask.close()


def test_a_name_that_two_doors_share_means_neither(path: Path, clock: SteadyClock) -> None:
    """The reason says by which ids to ask; level/name tells them apart, too."""
    with sl.append(path, clock=clock) as log:
        log.append([LevelAdded(level=0, name="ground"), LevelAdded(level=1, name="first")])
        log.add_door(name="main_door", level=1, state="closed")
    ask = Asker(path, clock=clock)

    said = ask.json("DOOR_OPEN", "DOOR_main_door")

    assert {
        "answer": False,
        "reason": "2 doors are called 'main_door'; say which by DOOR_1 or DOOR_6.",
    } == said
    assert ("OPEN", "CLOSED") == (
        ask("DOOR_STATE DOOR_ground/main_door"), ask("DOOR_STATE first/main_door"),
    )  # fmt: skip
    assert ask("SET_DOOR_OPEN DOOR_main_door") == "NIL"
    ask.close()


@pytest.mark.parametrize(
    "name", ["a\nb", 'q"q', "\u202eright to left", "tab\there", "é", "\x7f", "x\x1b[2J"]
)
def test_names_with_anything_in_them_are_found_and_break_no_line(ask: Asker, name: str) -> None:
    """Quoted as JSON; whoever set the state is told as it was written."""
    ask.doors.log.annotate(2, "name", name)
    ask.doors.log.observe(2, "open", actor=name, reason=name)
    ask.oracle.refresh()

    assert ask(f"DOOR_OPEN {json.dumps(name)}") == "T"
    assert ask(f"DOOR_OPEN {json.dumps('DOOR_' + name)}") == "T"
    assert [name, "", name] == ask.json("WHY", 2)["answer"][-3:]
    assert ask("WHY DOOR_2").isprintable()
    assert "NIL" == ask(f"SET_OPEN_PROBABILITY {json.dumps(name)} 7")


def test_actions_are_commits_that_say_who_wanted_them(ask: Asker) -> None:
    """One each, durable when it is answered; what the door is already needs none."""
    lines = ("SET_DOOR_OPEN DOOR_2", "SET_DOOR_CLOSED DOOR_main_door",
             "SET_OPEN_PROBABILITY DOOR_2 0.75", "SET_DOOR_OPEN DOOR_2",
             "SET_CLOSED_PROBABILITY DOOR_2 0", "REMOVE_DOOR DOOR_5")  # fmt: skip
    done = [ask(line) for line in lines]

    commits = list(ask.doors.log.commits())[5:]
    door = ask.doors.door_map()[DoorId(2)]
    assert ["T"] * 6 == done
    assert [
        ("planner", f"{line.split()[0]} from {CLIENT}", "") for line in (*lines[:3], *lines[4:])
    ] == [(each.note.actor, each.note.source, each.note.correlation) for each in commits]
    assert (DoorState.OPEN, 0.75, 0.0) == (door.state, door.prob_open, door.prob_closed)
    assert [1, 2, 3, 4] == list(ask.doors.door_map().doors)
    assert ask.doors.log.durable_before == commits[-1].last_event + 1
    assert [] == ask.said


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("SET_DOOR_OPEN DOOR_9", "no door DOOR_9 is in the map."),
        ("REMOVE_DOOR nobody", "no door is called 'nobody'."),
        ("SET_OPEN_PROBABILITY DOOR_1 1.5", "expected a probability from 0 to 1, got 1.5."),
        ("SET_OPEN_PROBABILITY DOOR_1 nan", "expected a probability from 0 to 1, got nan."),
        ("SET_CLOSED_PROBABILITY DOOR_1 -0.1", "expected a probability from 0 to 1, got -0.1."),
        ("SET_CLOSED_PROBABILITY DOOR_1 inf", "expected a probability from 0 to 1, got inf."),
    ],
)
def test_an_action_that_is_refused_is_nil_and_its_reason_is_told(
    ask: Asker, line: str, reason: str
) -> None:
    """In the server's log, and in JSON to who asked; nothing is stored."""
    name, *words = line.split()

    assert ask(line) == "NIL"
    assert {"answer": False, "reason": reason} == ask.json(name, *words)
    assert [f"{name} {words[0]} from {CLIENT}: refused: {reason}"] * 2 == ask.said
    assert 5 == len(list(ask.doors.log.commits()))


def test_a_removed_door_is_gone_for_good(ask: Asker) -> None:
    """Removing it twice is NIL; with the command's id it is what it was the first time."""
    assert ask("REMOVE_DOOR DOOR_1") == "T"
    assert ask("REMOVE_DOOR DOOR_1") == "NIL"
    assert ask("DOOR_STATE_KNOWN DOOR_1") == "NIL"
    assert ask(f"{ID} REMOVE_DOOR DOOR_2") == "T"
    assert ask(f"{ID} REMOVE_DOOR DOOR_2") == "T"
    assert 7 == len(list(ask.doors.log.commits()))


def test_a_command_sent_again_is_answered_as_the_first_time_and_done_once(
    ask: Asker, path: Path, clock: SteadyClock
) -> None:
    """After others have changed the door, under another name, after a restart."""
    line = f"{ID} SET_DOOR_OPEN DOOR_main_door"
    first = ask(line)
    ask("SET_DOOR_CLOSED DOOR_1")
    ask.doors.log.annotate(1, "name", "renamed")
    again = ask(line)
    ask.close()
    restarted = Asker(path, clock=clock)

    assert ["T"] * 3 == [first, again, restarted(line)]
    assert restarted("DOOR_STATE DOOR_1") == "CLOSED"
    stored = [each for each in restarted.doors.log.commits() if each.command_id == bytes(range(16))]
    assert [bytes(range(16)).hex()] == [each.note.correlation for each in stored]
    restarted.close()


def test_an_id_that_was_another_command_is_refused(ask: Asker) -> None:
    """Nothing is done in its name."""
    ask(f"{ID} SET_OPEN_PROBABILITY DOOR_1 0.5")

    for other in ("SET_OPEN_PROBABILITY DOOR_1 0.6", "SET_OPEN_PROBABILITY DOOR_2 0.5",
                  "SET_CLOSED_PROBABILITY DOOR_1 0.5", "REMOVE_DOOR DOOR_1"):  # fmt: skip
        assert ask(f"{ID} {other}") == "NIL"
        assert "is already stored" in ask.said[-1]
    assert ask(f"{ID} SET_OPEN_PROBABILITY DOOR_1 0.50") == "T"


def test_an_action_counts_though_the_clock_went_back(ask: Asker, clock: SteadyClock) -> None:
    """What is answered with T is what is true then."""
    ask.doors.log.observe(1, "open", at=ask.doors.log.now_ns() - 1)
    clock.now_ns -= 3600 * 10**9

    assert ask("SET_DOOR_CLOSED DOOR_1") == "T"
    assert ask("DOOR_CLOSED DOOR_1") == "T"


def test_what_was_true_and_what_was_believed(ask: Asker) -> None:
    """A door was seen closed at noon, and that was told an hour later."""
    log = ask.doors.log
    noon_ns = log.now_ns()
    ask.doors.log._writer.clock.now_ns += 3600 * 10**9
    log.observe(1, "closed", at=noon_ns)
    ask.oracle.refresh()
    half_past = noon_ns + 1800 * 10**9

    assert ask.json("DOOR_STATE", 1, half_past) == {"answer": "CLOSED"}
    assert ask.json("DOOR_STATE", 1, known_at=half_past) == {"answer": "OPEN"}
    assert ask.json("DOOR_STATE", 1, at=half_past, known_at=half_past) == {"answer": "OPEN"}
    assert ask(f"BELIEVED DOOR_OPEN DOOR_1 AT @{half_past}") == "T"
    assert ask(f"DOOR_OPEN DOOR_1 @{half_past}") == "NIL"
    assert ask('DOORS CLOSED "30 min ago"') == "(DOOR_1 DOOR_2)"
    assert ask("GET_OPEN_DOOR event:0") == "DOOR_1"
    assert ask("BELIEVED GET_CLOSED_DOOR AT event:1") == "NIL"


@pytest.mark.parametrize("line", ["DOOR_OPEN DOOR_1 yesteryear", "DOORS event:99",
                                  "BELIEVED DOORS AT 25:00", "PROBABILITY_DOOR_OPEN DOOR_1 AT x",
                                  "NEXT_DOOR DOOR_1 AT x", "HELP DOOR_AJAR"])  # fmt: skip
def test_a_moment_or_a_name_that_is_none_is_an_error(ask: Asker, line: str) -> None:
    """It is not NIL: the question was wrong."""
    assert ask(line).startswith('ERROR "')


def test_a_time_that_is_none(ask: Asker) -> None:
    """The error tells the question's form."""
    for question in ("DOORS OPN", "DOOR_CLOSED DOOR_main door", "PROBABILITY_DOOR_OPEN 1 AT noon"):
        said = ask(question)

        assert said.startswith(f'ERROR "{BY_NAME[question.split()[0]].form}: Expected a moment')
        assert said.endswith('What has blanks in it stands in quotes."')


def test_why_names_what_set_the_state(ask: Asker, clock: SteadyClock) -> None:
    """Not what came later and set something else; of the past, what set it then."""
    log = ask.doors.log
    log.observe(2, "open", actor="tinyRobot1", source="door_camera", reason="round 3")
    log.annotate(2, "kind", "hinged")
    log.request(2, "closed")
    log.passed(2, passed=False)
    log.update_door(2, prob_open=0.5)
    ask.oracle.refresh()

    number, kind, state, time, *who = ask.json("WHY", 2)["answer"]

    assert (9, "DoorObserved", "OPEN") == (number, kind, state)
    assert ["tinyRobot1", "door_camera", "round 3"] == who
    assert log.event(9).happened_ns == log.moment(time).ns
    assert [2, "DoorAdded", "CLOSED"] == ask.json("WHY", 2, "event:8")["answer"][:3]


def test_why_knows_what_was_taken_back_and_since_when(ask: Asker) -> None:
    """A wrong sighting that was retracted is the reason only for who asks what was believed."""
    log = ask.doors.log
    log.observe(2, "open")
    log.retract(9)
    ask.oracle.refresh()

    assert [2, "DoorAdded", "CLOSED"] == ask.json("WHY", 2)["answer"][:3]
    assert [9, "DoorObserved", "OPEN"] == ask.json("WHY", 2, known_at="event:9")["answer"][:3]
    assert [2, "DoorAdded", "CLOSED"] == ask.json("WHY", 2, known_at="event:10")["answer"][:3]
    assert [9, "DoorObserved", "OPEN"] == ask.json("WHY", 2, "event:9")["answer"][:3]


def test_why_of_several_words_of_one_moment(ask: Asker) -> None:
    """The last of them counts, of those that stand and were known."""
    log = ask.doors.log
    then_ns = log.now_ns()
    for state in ("open", "closed", "moving"):
        log.observe(2, state, at=then_ns)
    log.retract(11)
    ask.oracle.refresh()

    assert [10, "DoorObserved", "CLOSED"] == ask.json("WHY", 2)["answer"][:3]
    assert [9, "DoorObserved", "OPEN"] == ask.json("WHY", 2, known_at="event:9")["answer"][:3]
    assert [11, "DoorObserved", "MOVING"] == ask.json("WHY", 2, known_at="event:11")["answer"][:3]


def test_why_of_an_event_that_says_it_is_of_the_future(ask: Asker) -> None:
    """It counts from when it was recorded."""
    log = ask.doors.log
    log.observe(2, "open", at=log.now_ns() + 10**15, actor="fast clock")
    ask.oracle.refresh()

    assert "fast clock" in ask("WHY DOOR_2")


def test_a_wait_ends_when_the_door_is_so(ask: Asker) -> None:
    """At once where it is already; not with a change of another door, or to another state."""
    said: list[str] = []
    waiting = threading.Thread(target=lambda: said.append(ask("WAIT_UNTIL DOOR_2 OPEN 100")))

    assert ask("WAIT_UNTIL DOOR_2 CLOSED 0") == "T"
    waiting.start()
    wait_until(lambda: ask.oracle._waits._waiting, "the wait")
    ask("SET_DOOR_CLOSED DOOR_1")
    ask.doors.log.observe(2, "moving")
    ask.oracle.refresh()
    assert [] == said
    ask("SET_DOOR_OPEN DOOR_2")
    waiting.join(10)

    assert ["T"] == said
    assert set() == ask.oracle._waits._waiting


def test_a_wait_in_vain(ask: Asker) -> None:
    """NIL when the time is over; and at once for a door that is not there, or leaves."""
    said = ask.json("WAIT_UNTIL", 2, "OPEN", 0.01)
    unknown = ask.json("WAIT_UNTIL", 9, "OPEN", 100)
    answers: list[Answer] = []
    ask.oracle.wait(read_words(["WAIT_UNTIL", "DOOR_4", "OPEN", 100]), answers.append)
    ask("REMOVE_DOOR DOOR_4")

    assert {"answer": False, "reason": "it was not OPEN within 0.01 s."} == said
    assert {"answer": False, "reason": "no door DOOR_9 is in the map."} == unknown
    assert [Answer(value=False, reason="no door DOOR_4 is in the map.")] == answers
    assert set() == ask.oracle._waits._waiting


def test_what_comes_between_the_look_and_the_wait_is_not_missed(ask: Asker) -> None:
    """The door opens just before the question waits."""
    answers: list[Answer] = []
    add = ask.oracle._waits.add

    def late(wait: object) -> None:
        ask("SET_DOOR_OPEN DOOR_2")
        add(wait)

    ask.oracle._waits.add = late
    ask.oracle.wait(read_words(["WAIT_UNTIL", "DOOR_2", "OPEN", 100]), answers.append)

    assert [Answer(value=True)] == answers


def test_help_names_all_or_tells_of_one(ask: Asker) -> None:
    assert ask.json("HELP", "WAIT_UNTIL")["answer"] == (
        "WAIT_UNTIL DOOR STATE SECONDS - predicate: it is in the state, now or before the "
        "seconds are over"
    )
    assert 20 == len(ask.json("HELP")["answer"])


def test_answers_of_the_past_are_remembered_until_something_changes(ask: Asker) -> None:
    """A late event changes what was true; memory has a bound."""
    log = ask.doors.log
    then_ns = log.now_ns() - 1
    first = ask.json("DOOR_STATE", 1, then_ns)
    log.observe(1, "closed", at=then_ns)
    ask.oracle.refresh()

    assert [{"answer": "OPEN"}, {"answer": "CLOSED"}] == [first, ask.json("DOOR_STATE", 1, then_ns)]
    for i in range(2 * MOST_REMEMBERED):
        ask.json("DOOR_STATE", 1, then_ns - i)
    assert MOST_REMEMBERED == len(ask.oracle._now._remembered)


def test_a_log_that_another_writes(path: Path, clock: SteadyClock) -> None:
    """Answers follow it, waits end with it, and nothing is set."""
    ask = Asker(path, is_read_only=True)
    answers: list[Answer] = []
    with sl.append(path, clock=clock) as log:
        ask.oracle.wait(read_words(["WAIT_UNTIL", "DOOR_2", "OPEN", 100]), answers.append)
        log.observe(2, "open")
        wait_until(lambda: ask("DOOR_OPEN DOOR_2") == "T", "the sighting")
        wait_until(lambda: answers, "the end of the wait")
        refused = ask.json("SET_DOOR_CLOSED", 2)
        believed = ask("BELIEVED DOOR_OPEN DOOR_2 AT event:8")

    assert [Answer(value=True)] == answers
    assert "NIL" == believed
    assert refused == {
        "answer": False,
        "reason": "this server only shows the log (--read-only). Nothing was done.",
    }
    assert 1 == len(ask.said)
    ask.close()


def test_a_log_that_cannot_be_followed_any_more_gives_no_stale_answers(path: Path) -> None:
    """Damage is an error to every question, and to whoever runs the server."""
    ask = Asker(path, is_read_only=True)
    assert ask("DOOR_OPEN DOOR_1") == "T"

    ask.doors._failure = sl.SemmapError("damaged")
    ask.oracle.refresh()

    assert ['ERROR "damaged"'] * 3 == [
        ask(line) for line in ("DOOR_OPEN DOOR_1", "DOORS now", "WHY DOOR_1")
    ]
    assert "damaged" == str(ask.oracle.failure)
    ask.close()


def test_an_update_says_only_what_it_sets(ask: Asker) -> None:
    """On the door's own level."""
    ask("SET_OPEN_PROBABILITY DOOR_2 0.25")

    event = ask.doors.log.event(9).event

    assert isinstance(event, DoorUpdated)
    assert (8, 0.25) == (event.changed, event.prob_open)


def test_an_oracle_of_a_log_without_events(tmp_path: Path) -> None:
    """Every question has an answer."""
    sl.create(tmp_path / "empty", tz="UTC").close()
    ask = Asker(tmp_path / "empty")

    said = [ask(line) for line in ("DOORS", "GET_OPEN_DOOR", "NEXT_DOOR DOOR_1", "DOORS now",
                                   "DOOR_OPEN DOOR_1 now", "BEST_TIME DOOR_1")]  # fmt: skip

    assert ["()", "NIL", "NIL", "()", "NIL", "NIL"] == said
    assert isinstance(ask.oracle, Oracle)
    ask.close()


def test_a_state_that_passed_between_two_looks(ask: Asker) -> None:
    """Opened and closed by two who came together: it was open."""
    answers: list[Answer] = []
    log = ask.doors.log
    for door, state in (("DOOR_2", "OPEN"), ("DOOR_gate", "CLOSED")):
        ask.oracle.wait(read_words(["WAIT_UNTIL", door, state, 100]), answers.append)

    log.observe(2, "open", at=log.entry(0).happened_ns)
    log.update_door(1, state="closed")
    ask.oracle.refresh()
    assert [] == answers
    log.update_door(1, state="closed")
    log.update_door(2, state="open")
    log.update_door(2, state="closed")
    ask.oracle.refresh()
    assert [Answer(value=True)] == answers
    log.update_door(4, state="closed")
    log.remove_door(4)
    ask.oracle.refresh()
    assert [Answer(value=True)] * 2 == answers


def test_a_log_that_cannot_be_read_between_two_looks(
    ask: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The doors are known all the same; that something may be missed is said."""

    def fail(*_: object, **__: object) -> None:
        raise OSError("of a test")

    answers: list[Answer] = []
    log = ask.doors.log
    ask.oracle.wait(read_words(["WAIT_UNTIL", "DOOR_2", "OPEN", 100]), answers.append)
    monkeypatch.setattr(log, "replay", fail)
    log.update_door(2, state="open")
    log.update_door(2, state="closed")

    ask.oracle.refresh()

    assert [] == answers
    assert ["WAIT_UNTIL: what was so for a moment may be missed: of a test"] == ask.said
    assert ask("DOOR_CLOSED DOOR_2") == "T"
