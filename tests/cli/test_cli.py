"""The commands as a user types them: real processes for what crosses one, else in this one."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from subprocess import PIPE
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli.verb_table import FIRST_WEEK, SHOWN
from tests.golden_text import GoldenText
from tests.live.ros.running import DEADLINE_S
from tests.verbs import Refuses, Verb, run
from tests.views.rerun.some_logs import small_log


@pytest.fixture(scope="session")
def office(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of one door `front`; nobody writes to it."""
    path = tmp_path_factory.mktemp("cli") / "office"
    place = ("--from", "2,1.5", "--to", "2.9,1.5")
    run("init", path, "--tz", "Europe/Vienna")
    run("add", path, *place, "--name", "front", "--actor", "survey")
    return path


@pytest.fixture
def run_here(run_verb: Verb, office: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Verb:
    """Run a command line in a folder of its own, with a copy of that log in it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TZ", "UTC")
    shutil.copytree(office, "office")
    return run_verb


def test_help_begins_with_the_verbs_of_the_first_week(run_here) -> None:
    """And says how to see the others."""
    first, every = run_here("-h").out, run_here("help", "--all").out

    assert first == run_here("help").out
    shown = {line.split()[0] for line in first.partition("first week:")[2].splitlines() if line}
    assert {*FIRST_WEEK, "More:", "semmap-log"} == shown
    assert {*SHOWN} <= {line.split()[0] for line in every.splitlines() if line.strip()}


@pytest.mark.parametrize("verb", [["replay"], ["call", "add"]])
def test_help_of_a_verb_is_what_the_verb_shows(run_here, verb: list[str]) -> None:
    assert run_here("help", *verb).out == run_here(*verb, "--help").out


def test_help_of_no_verb_says_which_was_meant(run_here) -> None:
    helped = run_here("help", "reply")

    assert 2 == helped.code
    assert "Did you mean replay" in helped.err


@pytest.mark.parametrize("verb", [verb for verb in SHOWN if verb != "help"])
def test_every_verb_has_help_with_an_example(
    verb: str, run_here, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 0, a summary, and a line that can be typed; in a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")

    helped = run_here(verb, "--help")

    assert 0 == helped.code
    assert max(map(len, helped.out.splitlines())) <= 80
    assert f"semmap-log {verb}" in helped.out.partition("Example")[2]


@pytest.mark.parametrize(("rules", "cell"), [("nav2", 100), ("nav2_humble", -1), ("noetic", -1)])
def test_a_map_is_read_by_the_server_that_is_named(run_here, rules: str, cell: int) -> None:
    """A pixel on a threshold: only today's Nav2, the default, takes it for a wall."""
    Path("m.pgm").write_bytes(b"P5 1 1 255\n\x33")
    Path("m.yaml").write_text(
        "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.8\nfree_thresh: 0.2\n"
    )

    named = run_here("init", "named", "--map", "m.yaml", "--map-rules", rules)

    assert 0 == named.code
    floor = sl.read("named").floor_map()
    assert floor is not None
    assert [[cell]] == floor.cells.tolist()


def test_a_door_through_its_life(run_here) -> None:
    """Added, seen, updated, annotated, removed; each answer names its event."""
    assert "2\n" == run_here("add", "office").out
    assert "event 3\n" == run_here("observe", "office", "front", "open", "--accuracy", "0.9").out
    assert (
        "event 4\n"
        == run_here("update", "office", "front", "--state", "closed", "--prob-open", 0.25).out
    )
    assert "event 5\n" == run_here("annotate", "office", "front", "rooms", "lobby,corridor").out
    assert "event 6\n" == run_here("remove", "office", 2, "--reason", "was a mistake").out

    replayed = run_here("replay", "office", "--json").json
    (door,) = replayed["doors"]
    assert (1, "front", "CLOSED", 0.25, None) == (
        door["door_id"],
        door["name"],
        door["state"],
        door["prob_open"],
        door["prob_closed"],
    )
    assert (2.0, 1.5, 0.0, 0.9) == (door["x"], door["y"], door["theta"], round(door["width"], 12))
    assert {"name": "front", "rooms": "lobby,corridor"} == door["annotations"]
    assert 6 == replayed["event"]


@pytest.mark.usefixtures("terminal")
def test_history_says_who_and_why(run_here) -> None:
    """As JSON with the names of the design, and as a table of at most 80 columns."""
    run_here(
        "update", "office", "front", "--state", "open", "--actor", "porter", "--reason", "delivery"
    )

    entries = run_here("history", "office", "front", "--json").json
    table = run_here("history", "office", "front").out

    assert ["DoorAdded", "DoorAnnotated", "DoorUpdated"] == [e["kind"] for e in entries]
    assert ("porter", "delivery", "OPEN") == tuple(
        entries[2][k] for k in ("actor", "reason", "state")
    )
    assert "porter" in table
    assert all(len(line) <= 80 for line in table.splitlines())
    assert "\x1b" not in table


def test_replay_at_and_known_at(run_here) -> None:
    """What was true at noon is learnt in the evening: `--at` knows it, `--known-at` did not."""
    run_here("observe", "office", "front", "open", "--at", "2026-03-01T12:00")
    added = run_here("history", "office", "front", "--json").json[0]["recorded"]

    now = run_here("replay", "office", "--json").json
    known = run_here("replay", "office", "--known-at", added, "--json").json

    assert "UNKNOWN" == now["doors"][0]["state"], (
        "it was seen before the door was added: history only"
    )
    assert added == known["known_at"]
    assert 1 == known["event"]


@pytest.mark.slow
@pytest.mark.usefixtures("terminal")
def test_diff_and_show(run_here) -> None:
    """Between two events: what changed, and what did it."""
    run_here("observe", "office", "front", "open")

    found = run_here("diff", "office", "event:1", "now", "--json").json
    shown = run_here("show", "office", 2, "--json").json

    assert [("front", "state", "UNKNOWN", "OPEN")] == [
        (c["name"], c["field"], c["before"], c["after"]) for c in found["changed"]
    ]
    assert ("DoorObserved", "OPEN", 1.0) == (shown["kind"], shown["state"], shown["accuracy"])
    for verb in (
        ["diff", "office", "event:1", "now"],
        ["show", "office", 2],
        ["info", "office"],
        ["replay", "office"],
    ):
        printed = run_here(*verb)
        assert 0 == printed.code
        assert all(len(line) <= 80 for line in printed.out.splitlines()), printed.out


def test_info_counts(run_here) -> None:
    """Of the log, and of one of its files."""
    whole = run_here("info", "office", "--json").json
    file = run_here("info", "office/office_000000.mcap", "--json").json

    assert {"DoorAdded": 1, "DoorAnnotated": 1} == whole["kinds"] == file["kinds"]
    assert ("Europe/Vienna", 2, 1, []) == tuple(
        whole[key] for key in ("timezone", "events", "commits", "warnings")
    )


@pytest.mark.slow
def test_history_as_a_picture(run_here, tmp_path: Path) -> None:
    """Lanes of all doors or of one; what is about events does not go with it."""
    pytest.importorskip("matplotlib", reason="not installed: pip install 'semmap-log[plots]'")
    run_here("add", "office", "--name", "back")

    everything = run_here("history", "office", "--plot", "all.svg")
    one = run_here("history", "office", "front", "--plot", "one.png", "--palette", "colour-blind")
    wrong = run_here("history", "office", "--plot", "all.pdf")
    both = run_here("history", "office", "--plot", "all.svg", "--json")
    nothing = run_here("history", "office", "--until", "2001-01-01", "--plot", "none.svg")

    assert (0, 0, 1, 2, 1) == tuple(r.code for r in (everything, one, wrong, both, nothing))
    assert "doors: 2, rounds: 0" in everything.err
    assert "front" in (tmp_path / "all.svg").read_text()
    assert b"\x89PNG" == (tmp_path / "one.png").read_bytes()[:4]
    assert "expected a name that ends in .png or .svg" in wrong.err
    assert "--plot" in both.json["error"]["message"]
    assert "no door was in the map then" in nothing.err
    assert not (tmp_path / "none.svg").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("report", "office", "office/x.html"),
        ("export", "office", "office/x.csv"),
        ("export", "office", "office/x.mcap", "--markers"),
        ("costmap", "office", "office/x.npy"),
        ("history", "office", "--plot", "office/x.png"),
        ("probabilities", "office", "--plot", "office/x.svg"),
        ("evaluate", "office", "--plot", "office/x.png"),
        ("view", "office", "--save", "office/x.rrd"),
        ("view", "office", "--screenshot", "office/../office/x.png"),
    ],
)
def test_nothing_is_made_in_the_log_s_own_folder(
    run_here, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    """There everything is the log's; all verbs that make a file say so, in the same words."""
    for needed in {"history": ["matplotlib"], "view": ["rerun"]}.get(arguments[0], []):
        pytest.importorskip(needed)
    run_here("add", "office", "--name", "front", "--state", "open")
    before = sorted((tmp_path / "office").iterdir())
    (out,) = (each for each in arguments if "/" in each)

    done = run_here(*arguments)

    assert (1, f"semmap-log: {out}: lies in the log's own folder; choose another place.\n") == (
        done.code, done.err
    )  # fmt: skip
    assert before == sorted((tmp_path / "office").iterdir())


@pytest.mark.parametrize(
    "arguments",
    [
        ("init", "lab"),
        ("probabilities", "office"),
        ("probabilities", "office", "--by", "week", "--json"),
        ("best-time", "office", "front"),
        ("evaluate", "office"),
    ],
)
def test_no_name_is_no_zone(run_here, arguments: tuple[str, ...]) -> None:
    """As a variable of the shell that was never set gives: an error, and not the usual zone."""
    done = run_here(*arguments, "--tz", "")

    assert 1 == done.code
    assert "No time zone '': expected an IANA name" in " ".join((done.err + done.out).split())


@pytest.mark.slow
@pytest.mark.usefixtures("terminal")
def test_info_draws_a_day(run_here) -> None:
    """The last, or the one asked for; of a single file, which knows not all of it, none."""
    run_here("observe", "office", "front", "open", "--at", "2026-02-27T12:00")
    run_here("observe", "office", "front", "closed", "--at", "2026-02-27T18:00")

    told = run_here("info", "office", "--json").json["day"]
    drawn = run_here("info", "office")
    asked = run_here("info", "office", "--day", "2026-02-27T08:00")
    never = run_here("info", "office", "--day", "2001-01-01")
    file = run_here("info", "office/office_000000.mcap", "--json").json

    assert ["front"] == [door["name"] for door in told["doors"]]
    assert len(told["edges"]) - 1 == len(told["doors"][0]["open"]) == 48
    assert told["date"] in drawn.out
    assert "\x1b" not in drawn.out
    assert all(len(line) <= 80 for line in drawn.out.splitlines())
    assert (0, 0) == (asked.code, never.code)
    assert "no door was in the map on that day" in never.err
    assert file["day"] is None


def test_warnings_of_info(run_here) -> None:
    """Probabilities above 1 together, and times from the future, are named."""
    run_here("update", "office", "front", "--prob-open", 0.8, "--prob-closed", 0.7)
    run_here("observe", "office", "front", "open", "--at", "2200-01-01")

    warnings = run_here("info", "office", "--json").json["warnings"]

    assert any("front: P(open) + P(closed) = 1.5" in text for text in warnings)
    assert any("happened after they were recorded" in text for text in warnings)


def test_errors_are_one_line_and_change_nothing(
    run_here: Verb, tmp_path: Path, refuses: Refuses
) -> None:
    """1 is our error, 2 is usage; the log's bytes stay as they are."""
    before = (tmp_path / "office" / "office_000000.mcap").read_bytes()

    refuses("""
        observe office 7 open
        observe office frnt open
        observe office front ajar
        observe office front open --accuracy 0.2
        add office --x 1
        add office --from 1,2
        add office --id 1
        add office --id 4294967296
        add office --prob-open 1.2
        add office --prob-open nan
        add office --level L9
        update office front
        replay nolog
        replay office --at soon
        show office 99
        export office doors.doc
        export office doors.yaml
        history office --kind DoorSlammed
        init office
        patrol office finish
        import office nothing.yaml
        init other --tz Mars/Olympus
    """)

    assert before == (tmp_path / "office" / "office_000000.mcap").read_bytes()


def test_patrol_rounds_are_numbered(run_here) -> None:
    """Each start counts one on; a finish closes the last."""
    numbers = [
        run_here("patrol", "office", phase, "--json").json["patrol"]
        for phase in ("start", "finish", "start", "finish")
    ]

    assert [1, 1, 2, 2] == numbers


def test_the_same_file_again_changes_nothing(run_here: Verb, golden: GoldenText) -> None:
    """A file's digest is its command id."""
    Path("a.yaml").write_text("5: {position: {x: 1, y: 2, theta: 0}, width: 1, status: OPEN}\n")

    found = [run_here("import", "office", "a.yaml", "--json").json[0] for _ in range(2)]

    assert [(1, False), (0, True)] == [(each["count"], each["known_before"]) for each in found]
    golden("import", "the same file again", run_here("import", "office", "a.yaml").out)


def _start(*arguments: object, **more: Any) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "semmap_log", *map(str, arguments)],
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **more,
    )


@pytest.mark.slow
def test_record_answers_each_line(run_here, tmp_path: Path) -> None:
    """By its event once it is durable, or by what is wrong with it; then the exit code is 1."""
    lines = [
        '{"kind": "DoorObserved", "door": "front", "state": "OPEN", "accuracy": 0.9}',
        '{"kind": "RobotPose", "x": 1, "y": 2, "theta": 0}',
        "not json",
        '{"kind": "DoorObserved", "door_id": 99, "state": "OPEN"}',
        '{"kind": "DoorAdded", "actor": "me"}',
    ]
    process = _start("record", tmp_path / "office", "--ack")
    out, err = process.communicate("\n".join(lines))

    answers = {answer["line"]: answer for answer in map(json.loads, out.splitlines())}
    assert {1: 2, 2: 3, 5: 4} == {n: a["event"] for n, a in answers.items() if "event" in a}
    assert {3, 4} == {n for n, a in answers.items() if "error" in a}
    assert 1 == process.returncode
    assert "door 99" in err
    kinds = [type(e.event).__name__ for e in sl.read(tmp_path / "office").history()]
    assert ["DoorObserved", "RobotPose", "DoorAdded"] == kinds[2:]


@pytest.mark.slow
def test_record_strict_stops_at_the_first_bad_line(run_here, tmp_path: Path) -> None:
    """What came before it is stored, what comes after is not."""
    good = '{"kind": "DoorObserved", "door": "front", "state": "OPEN"}'
    process = _start("record", tmp_path / "office", "--strict")
    _, err = process.communicate(f"{good}\nbad\n{good}\n")

    assert (1, 3) == (process.returncode, sl.read(tmp_path / "office").replay().event + 1)
    assert "line 2" in err


@pytest.mark.slow
@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_record_ends_well_when_asked_to(sign: signal.Signals, run_here, tmp_path: Path) -> None:
    """Ctrl-C, SIGTERM and a terminal that is closed."""
    process = _start("record", tmp_path / "office", "--ack")
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write('{"kind": "DoorObserved", "door": "front", "state": "OPEN"}\n')
    process.stdin.flush()
    assert {"line": 1, "event": 2} == json.loads(process.stdout.readline())

    process.send_signal(sign)

    assert 0 == process.wait(timeout=DEADLINE_S)
    assert sl.read(tmp_path / "office")._reader.segments[-1].closed


@pytest.mark.slow
def test_the_same_log_gives_the_same_pictures(tmp_path: Path) -> None:
    """Byte for byte, in processes that hash in another order and live in other zones."""
    pytest.importorskip("matplotlib", reason="not installed: pip install 'semmap-log[plots]'")
    log = small_log(tmp_path / "log").path

    made = [_pictures(log, seed, zone) for seed, zone in (("0", "UTC"), ("1", "Asia/Tokyo"))]

    assert {"x.html", "x.mcap", "x.svg"} == set(made[0])
    assert [] == [name for name, data in made[0].items() if data != made[1][name]]


RUN_ALL = """
import json, sys
from semmap_log.cli import main
for line in json.loads(sys.argv[1]):
    try:
        main(line)
    except SystemExit as left:
        assert not left.code
"""


def _pictures(log: Path, seed: str, zone: str) -> dict[str, bytes]:
    """Return the files, by name, that a process of its own makes from a log."""
    folder = log.with_name(f"made_{seed}")
    folder.mkdir()
    lines = [
        ["report", str(log), "x.html"],
        ["export", str(log), "x.mcap", "--markers"],
        ["history", str(log), "--plot", "x.svg"],
    ]
    env = {**os.environ, "PYTHONPATH": str(Path(sl.__file__).parents[1]),
           "PYTHONHASHSEED": seed, "TZ": zone}  # fmt: skip
    command = [sys.executable, "-c", RUN_ALL, json.dumps(lines)]
    subprocess.run(command, cwd=folder, env=env, check=True, capture_output=True)
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_python_m_is_the_same(tmp_path: Path) -> None:
    """`python -m semmap_log` runs the same program, with `--version`."""
    done = subprocess.run(
        [sys.executable, "-m", "semmap_log", "--version"],
        capture_output=True,
        text=True,
        check=True,
    )

    assert done.stdout.startswith("semmap-log ")


@pytest.mark.slow
def test_a_warning_is_one_line_on_stderr(tmp_path: Path) -> None:
    """
    A keyframe that cannot be used: the answer is there, the warning beside it, no Python in it.
    """
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log, pytest.MonkeyPatch.context() as patch:
        patch.setattr("semmap_log.log.replay.keyframes.STATE_VERSION", 99)
        patch.setattr("semmap_log.store.writing.segment_chain.ROLL_COMMITS", 1)
        log.add_door(name="front")
        log.add_door(name="back")

    done = subprocess.run(
        [sys.executable, "-m", "semmap_log", "replay", path],
        check=False,
        capture_output=True,
        text=True,
    )

    assert 0 == done.returncode
    assert "front" in done.stdout
    assert re.fullmatch(
        r"semmap-log: warning: .*log_000001.mcap: the keyframe at byte \d+ is not used: it is of "
        r"state version 99, ours is \d+\n2 doors, up to event \d\n", done.stderr
    )  # fmt: skip


WAITS_HALF_WAY = """
import time
from itertools import islice
from semmap_log.cli import main
from semmap_log.interop.exporting.stream import LogStream

def some(stream, progress=None, messages=LogStream.messages):
    yield from islice(messages(stream, progress), 100)
    print("half way", flush=True)
    time.sleep(1000)

LogStream.messages = some
main()
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_no_half_file(tmp_path: Path, number: signal.Signals) -> None:
    """While a bag is being written, to a file that has another name until it is whole."""
    office = Path(__file__).parents[2] / "recordings" / "office"
    command = [sys.executable, "-c", WAITS_HALF_WAY, "export", str(office), "x.mcap", "--markers"]
    env = {**os.environ, "PYTHONPATH": str(Path(sl.__file__).parents[1])}
    with subprocess.Popen(command, cwd=tmp_path, env=env, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert b"half way\n" == process.stdout.readline()
        (begun,) = tmp_path.iterdir()

        process.send_signal(number)
        code = process.wait(DEADLINE_S)

    assert begun.name.startswith(".x.mcap.")
    assert 128 + number == code
    assert [] == list(tmp_path.iterdir())


def test_ctrl_c_inside_an_exec_is_a_code_too(tmp_path: Path) -> None:
    """Python would end itself by the signal, at its exit."""
    (tmp_path / "interrupted.py").write_text(
        "import semmap_log.cli as cli, semmap_log.cli.app as verbs\n"
        "verbs.app = lambda **_: exec('import signal; signal.raise_signal(signal.SIGINT)')\n"
        "cli.main()\n"
    )
    env = {**os.environ, "PYTHONPATH": str(Path(sl.__file__).parents[1])}

    done = subprocess.run([sys.executable, "-m", "interrupted"], cwd=tmp_path, env=env, check=False)

    assert 130 == done.returncode


ENDS_SLOWLY = """
import atexit, time
from semmap_log.cli import main

def last():
    print("all is done", flush=True)
    time.sleep(1000)

atexit.register(last)
main()
"""


def test_ctrl_c_behind_the_end_is_no_traceback() -> None:
    """
    Python takes a moment to end, too: whoever presses it then is not told of Python's insides.
    """
    command = [sys.executable, "-c", ENDS_SLOWLY, "--version"]
    with subprocess.Popen(command, text=True, stdout=PIPE, stderr=PIPE) as process:
        assert process.stdout is not None
        assert "all is done\n" in iter(process.stdout.readline, "")

        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=DEADLINE_S)

    assert (-signal.SIGINT, "") == (process.returncode, err)


def test_verbs_take_a_state_alike(run_here) -> None:
    """As a word, or by --state; not both."""
    for verb in ("observe", "update"):
        assert 0 == run_here(verb, "office", "1", "open").code
        assert 0 == run_here(verb, "office", "1", "--state", "closed").code
        assert 2 == run_here(verb, "office", "1", "open", "--state", "closed").code
    assert 2 == run_here("observe", "office", "1").code


def test_a_point_as_two_numbers_is_said_to_be_meant_as_one(run_here) -> None:
    refused = run_here("add", "office", "--from", "1", "-2.5", "--to", "2,2")

    assert 2 == refused.code
    assert "type: --from 1,-2.5" in refused.err
