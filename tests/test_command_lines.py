"""Command lines in messages: a shell reads them as they were meant."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, LevelAdded
from semmap_log.core.texts import command_line
from semmap_log.errors import CommandError, CorruptLogError, FormatError, NotALogError
from semmap_log.interop.formats.bags.bag_protocol import own_log
from semmap_log.interop.importing.importing import import_file
from tests.marks import marks
from tests.verbs import run

AWKWARD = 'my robot\'s "log" $HOME; `x` ä'
START = 1_772_400_000 * 10**9


def pasted(text: str) -> list[str]:
    """Return the words of the command line that ends a text, as a shell takes them."""
    line = text[text.index("semmap-log ") :].splitlines()[0]
    return shlex.split(line)


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log at a path that a shell would take apart, in the folder where one stands."""
    monkeypatch.chdir(tmp_path)
    with sl.create(AWKWARD, tz="UTC", clock=SteadyClock(START)) as made:
        made.add_door(name="front")
    return Path(AWKWARD)


def test_paths_are_quoted_and_are_no_options() -> None:
    """Words in capitals stay as they are."""
    line = command_line("export", Path(AWKWARD), Path("-x"), "OUT.yaml", "--at", "2h ago")

    assert ["semmap-log", "export", AWKWARD, "./-x", "OUT.yaml", "--at", "2h ago"] == (
        shlex.split(line)
    )
    assert "semmap-log verify office --head HASH" == (
        command_line("verify", Path("office"), "--head", "HASH")
    )


def test_a_log_that_is_not_there() -> None:
    """How to make one."""
    with pytest.raises(NotALogError) as refused:
        sl.read(AWKWARD)

    assert ["semmap-log", "init", AWKWARD] == pasted(str(refused.value))


def test_a_log_that_was_cut(log: Path) -> None:
    """How to go on; by the mark of what was closed, and by the list of rosbag2."""
    marks(log)[-1].write_text("{}")
    with pytest.raises(CorruptLogError) as refused:
        sl.read(log)

    assert ["semmap-log", "recover"] == pasted(str(refused.value))[:2]
    assert Path(pasted(str(refused.value))[2]).absolute() == log.absolute()


def test_a_log_whose_end_is_missing(log: Path) -> None:
    older = {file: file.read_bytes() for file in log.glob("*.mcap")}
    with sl.append(log) as opened:
        opened.add_door()
    for file in log.glob("*.mcap"):
        file.unlink()
    for file, data in older.items():
        file.write_bytes(data)
    with pytest.raises(CorruptLogError) as refused:
        sl.read(log)

    words = pasted(str(refused.value))
    assert "recover" == words[1]
    assert Path(words[2]).absolute() == log.absolute()


@pytest.mark.usefixtures("terminal")
def test_verify_and_info_say_what_to_keep(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In one line, however long the path is."""
    far = Path("a very long way " * 8) / "log"
    far.parent.mkdir()
    shutil.copytree(log, far)
    for verb in ("verify", "info"):
        assert 0 == run(verb, str(far))
        assert ["semmap-log", "verify", str(far), "--head", "HASH"] == (
            pasted(capsys.readouterr().out)
        )


def test_verify_says_how_to_recover(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = next(log.glob("*.mcap"))
    data = bytearray(first.read_bytes())
    data[len(data) // 2] ^= 1
    first.write_bytes(data)

    assert 4 == run("verify", str(log))
    assert ["semmap-log", "recover", str(log)] == pasted(capsys.readouterr().out)


def test_a_round_that_was_not_begun(log: Path) -> None:
    """How to begin one."""
    with sl.append(log) as opened, pytest.raises(CommandError) as refused:
        opened.finish_patrol()

    assert ["semmap-log", "patrol", str(log.absolute()), "start"] == pasted(str(refused.value))


def test_a_bag_that_is_a_log() -> None:
    """How to take its events."""
    refused = own_log(Path(AWKWARD) / "x_000000.mcap")

    assert isinstance(refused, FormatError)
    assert ["semmap-log", "export", AWKWARD] == pasted(str(refused))[:3]


BUILDING = """
name: lab
levels:
  L1:
    elevation: 0.0
    measurements: [[0, 1, {distance: [3, 10.0]}]]
    vertices: [[0, 0, 0, ""], [100, 0, 0, ""]]
    doors: [[0, 1, {name: [1, front]}]]
"""


def test_a_name_of_two_doors(log: Path, tmp_path: Path) -> None:
    """How to rename one."""
    (tmp_path / "x.building.yaml").write_text(BUILDING)
    with sl.append(log) as opened:
        opened.append([LevelAdded(level=1, name="L1")])
        for number in (11, 12):
            door = DoorId(number)
            opened.append([DoorAdded(door_id=door, level=1),
                           DoorAnnotated(door_id=door, key="name", value="front")])  # fmt: skip
        with pytest.raises(CommandError) as refused:
            import_file(opened, tmp_path / "x.building.yaml")

    assert ["semmap-log", "annotate", str(log.absolute()), "12", "name", "NEW_NAME"] == (
        pasted(str(refused.value))
    )


def test_the_demo_says_what_to_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each line names the log that it made."""
    monkeypatch.chdir(tmp_path)
    assert 0 == run("demo", AWKWARD)

    said = capsys.readouterr().out.partition("What to type next:\n")[2].splitlines()
    words = [shlex.split(line) for line in said if line]
    assert ["history", "replay", "diff", "probabilities", "costmap", "view"] == (
        [line[1] for line in words]
    )
    assert {f"{AWKWARD}/office"} == {line[2] for line in words}


def test_no_message_tells_a_line_by_hand() -> None:
    """A verb behind the program's name in a text is that of a docstring."""
    package = Path(sl.__file__).parent
    by_hand = re.compile(r'f?"[^"\n]*semmap-log [a-z-]+ (LOG|\{)')
    found = [
        f"{path.relative_to(package)}: {line.strip()}"
        for path in package.rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if by_hand.search(line)
    ]

    assert [] == found
