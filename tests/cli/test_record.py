"""`record` as a process: what it promises of a line, lines that come again, broken pipes."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.commits import Durability
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.importing.importing import import_file
from tests.live.ros.running import DEADLINE_S

LINE = '{"kind": "DoorObserved", "door": "front", "state": "OPEN"}\n'
ID = "0123456789abcdef" * 2


@pytest.fixture
def office(tmp_path: Path) -> Path:
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(name="front")
    return tmp_path / "office"


def _start(office: Path, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "semmap_log", "record", office, *options],
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def _record(office: Path, text: str, *options: str) -> tuple[int, list[Any], str]:
    """Return the exit code, the answers, and what was said."""
    process = _start(office, "--ack", *options)
    out, err = process.communicate(text, timeout=DEADLINE_S)
    return process.returncode, [json.loads(line) for line in out.splitlines()], err


@pytest.mark.slow
@pytest.mark.parametrize("level", ["event", "batch", "flush", "none"])
def test_every_level_answers_every_line(level: str, office: Path) -> None:
    """The log says of each commit under which promise it was made."""
    code, answers, _ = _record(office, LINE * 300, "--durability", level)

    assert 0 == code
    assert [{"line": n, "event": n + 1} for n in range(1, 301)] == answers
    levels = [commit.durability for commit in sl.read(office).commits()]
    assert [Durability.EVENT] + [Durability.parse(level)] * 300 == levels


@pytest.mark.slow
def test_a_line_of_a_batch_is_answered_when_the_batch_is_over(office: Path) -> None:
    """Not at once, and not never: after the time that was given, though nothing more comes."""
    process = _start(office, "--ack", "--durability", "batch", "--batch-ms", "300")
    assert process.stdin is not None
    assert process.stdout is not None
    answers, waited_s = [], []
    for _ in range(2):  # the first line may have had to wait for the process itself
        asked = time.monotonic()
        process.stdin.write(LINE)
        process.stdin.flush()
        answers.append(json.loads(process.stdout.readline()))
        waited_s.append(time.monotonic() - asked)
    process.stdin.close()

    assert [{"line": 1, "event": 2}, {"line": 2, "event": 3}] == answers
    assert waited_s[1] >= 0.3
    assert 0 == process.wait(timeout=DEADLINE_S)


@pytest.mark.slow
@pytest.mark.parametrize("level", ["event", "batch", "flush"])
def test_killed_it_has_every_line_that_it_answered(level: str, office: Path) -> None:
    """Only `none` may answer what is still in memory."""
    process = _start(office, "--ack", "--durability", level, "--batch-ms", "20")
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(LINE * 500)
    process.stdin.flush()
    answered = [json.loads(process.stdout.readline())["event"] for _ in range(100)]
    process.kill()
    answered += [json.loads(text)["event"] for text in process.stdout.read().splitlines()]
    process.wait(timeout=DEADLINE_S)  # its lock may outlive its answers' pipe

    with sl.append(office) as log:
        assert list(range(2, 2 + len(answered))) == answered
        assert log.replay().event >= answered[-1]


@pytest.mark.slow
def test_a_line_with_a_command_id_is_stored_once(office: Path) -> None:
    """In one run and in the next, though its door has another name by now; its spacing is free."""
    line = LINE.replace("}", f', "command_id": "{ID}"}}')
    spaced = json.dumps(json.loads(line), indent=None, separators=(" , ", ":"), sort_keys=True)
    first = _record(office, line + spaced + "\n")
    with sl.append(office) as log:
        log.annotate("front", "name", "back")
    again = _record(office, line)

    assert (0, [{"line": 1, "event": 2}, {"line": 2, "event": 2}]) == first[:2]
    assert (0, [{"line": 1, "event": 2}]) == again[:2]
    assert 4 == sl.read(office).replay().event + 1


@pytest.mark.slow
def test_another_line_with_the_same_command_id_is_a_bad_line(office: Path) -> None:
    """Reported with its number; what was stored under that id is named."""
    line = LINE.replace("}", f', "command_id": "{ID}"}}')
    code, answers, err = _record(office, line + line.replace("OPEN", "CLOSED"))

    assert 1 == code
    assert {"line": 1, "event": 2} in answers
    assert "line 2: command_id: stored already, as event 2, for another line" in err


@pytest.mark.slow
def test_an_added_door_that_is_sent_again_keeps_its_id(office: Path) -> None:
    """Though the next free id is another by then."""
    line = f'{{"kind": "DoorAdded", "command_id": "{ID}"}}\n'
    code, answers, _ = _record(office, line + '{"kind": "DoorAdded"}\n' + line)

    assert 0 == code
    assert [2, 3, 2] == [answer["event"] for answer in sorted(answers, key=lambda a: a["line"])]
    assert [1, 2, 3] == sorted(sl.read(office).replay().doors)


@pytest.mark.slow
def test_who_no_longer_listens_stops_nothing_that_was_read(office: Path) -> None:
    """With its answers' pipe closed it ends, and what it read is stored and closed."""
    process = _start(office, "--ack")
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdout.close()
    process.stdin.write(LINE * 50)
    process.stdin.close()
    process.wait(timeout=DEADLINE_S)

    assert 52 == sum(len(batch) for batch in sl.read(office).batches())
    assert sl.read(office)._reader.segments[-1].closed


@pytest.mark.slow
def test_closed_stdin_is_an_end_like_any(office: Path) -> None:
    """Exit code 0: there was nothing to store."""
    done = subprocess.run(
        f"exec {sys.executable} -m semmap_log record {office} <&-",
        shell=True,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )

    assert (0, "") == (done.returncode, done.stdout), done.stderr
    assert "0 events recorded" in done.stderr


def test_a_second_recorder_is_refused(office: Path) -> None:
    """While one writes, another says so and leaves everything alone."""
    with sl.append(office):
        code, answers, err = _record(office, LINE)

    assert (1, []) == (code, answers)
    assert "is writing to this log" in err


@pytest.fixture
def exported(office: Path) -> Path:
    """A log's events as lines: two commits of several events, one of one, and one taken back."""
    with sl.append(office) as log:
        log.add_door(name="back", actor="eva")
        log.observe("front", "open")
        log.observe("back", "open")
        log.retract(log.state.event)
    export(sl.read(office), office.parent / "lines.jsonl")
    return office.parent / "lines.jsonl"


@pytest.mark.slow
def test_lines_that_a_log_wrote_are_taken_once_each(exported: Path, tmp_path: Path) -> None:
    """Each is a commit; what was taken back does not come to count again."""
    sl.create(tmp_path / "new", tz="UTC").close()
    text = exported.read_text()

    code, answers, err = _record(tmp_path / "new", text)
    again, answers_again, _ = _record(tmp_path / "new", text)

    assert 1 == code == again
    assert answers == answers_again
    assert [0, 1, 2, 3, 4] == [answer["event"] for answer in answers if "event" in answer]
    assert "taken back in the log that wrote the line; `import` keeps both" in err
    assert "line 7: this retraction was exported" in err
    assert ["", "", "eva", "eva", ""] == [e.actor for e in sl.read(tmp_path / "new").history()]


@pytest.mark.slow
def test_a_line_that_was_imported_is_answered_as_it_is_stored(
    exported: Path, tmp_path: Path
) -> None:
    """Nothing is stored twice, whichever way it came."""
    with sl.create(tmp_path / "new", tz="UTC") as log:
        import_file(log, exported)
        held = log.state.event
    single = next(line for line in exported.read_text().splitlines() if '"event": 4' in line)

    code, answers, _ = _record(tmp_path / "new", f"{single}\n")
    other_code, _, err = _record(tmp_path / "new", single.replace("OPEN", "CLOSED") + "\n")

    assert (0, [{"line": 1, "event": 4}]) == (code, answers)
    assert 1 == other_code
    assert "stored already, as event 4, for another line" in err
    assert held == sl.read(tmp_path / "new").replay().event
