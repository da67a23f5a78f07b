"""The guide's commands for a robot run as they stand, in a real ROS 2."""

from __future__ import annotations

import re
import shlex
from contextlib import ExitStack
from pathlib import Path

import semmap_log as sl
from tests.live.ros.ros_world import ROOT, RosWorld
from tests.live.ros.running import DEADLINE_S, Running

UNTIL_STOPPED = {"serve": " serves ", "record": ": recording ", "play": " plays "}
"""Verbs that do not end by themselves -> what they say once they are at work."""
PATIENCE = {"call": ["--timeout", f"{DEADLINE_S:.0f}"], "play": ["--keep-alive"]}
"""Verbs -> what they are told where all is busy: its listeners may find a player late."""
SLOW, FAST = "--rate 600", "--rate 100000"


def _commands() -> list[list[str]]:
    """Return the words of each command, without the program's name; a day passes faster."""
    guide = (ROOT / "docs" / "guides" / "robot.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```bash\n(.*?)```", guide, flags=re.DOTALL)
    assert SLOW in block
    lines = block.replace(SLOW, FAST).splitlines()
    return [shlex.split(line, comments=True)[1:] for line in lines]


def test_the_commands_run_as_they_stand(jazzy: RosWorld, tmp_path: Path) -> None:
    """
    One after the other: the server has done what was called, the recorder has what was played.
    """
    (tmp_path / "recordings").symlink_to(ROOT / "recordings")
    with sl.create(tmp_path / "office", tz="Europe/Vienna") as log:
        log.add_door(x=2.0, y=1.5, theta=0.0, width=0.9, state="closed", name="front")
    running: list[Running] = []

    with ExitStack() as stack:
        for verb, *words in _commands():
            options = PATIENCE.get(verb, [])
            started = stack.enter_context(jazzy.semmap(verb, *words, *options, cwd=tmp_path))
            if verb in UNTIL_STOPPED:
                started.wait_for(UNTIL_STOPPED[verb])
                running.append(started)
            else:
                started.finish()
        rounds = tmp_path / "rounds"
        jazzy.wait_until(lambda: len(sl.read(rounds).replay()) > 0, f"what was played: {running}")
        codes = [each.stop() for each in reversed(running)]

    assert [0] * len(UNTIL_STOPPED) == codes
    sources = [commit.note.source for commit in sl.read(tmp_path / "office").commits()]
    assert ["", "action UpdateDoor", "action AddDoor"] == sources
