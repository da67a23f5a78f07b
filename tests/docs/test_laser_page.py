"""The page about lasers, run with a bag of a robot that drives by a door twice."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from doc_pages import ROOT, Runner, blocks_of

from semmap_log.interop.topics.mapping_file import read_mapping
from semmap_log.interop.topics.topic_rules import ReadScan
from tests.interop.formats.bags.bags_of_others import write_ros1
from tests.interop.topics.laser_room import drives_by

PAGE = (ROOT / "docs" / "guides" / "doors_from_a_laser.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_what_the_page_says_about_a_bag(tmp_path: Path) -> None:
    """From the bag to the door map, and back to the truth."""
    runner = Runner(tmp_path)
    write_ros1(tmp_path / "patrol.bag", drives_by(1))

    for block in blocks_of(PAGE):
        runner.run(block)

    assert 6 == len(blocks_of(PAGE))


def test_the_mapping_of_the_page_can_be_read(tmp_path: Path) -> None:
    """With the lasers that it names."""
    text = PAGE.partition("```yaml\n")[2].partition("```")[0]
    (tmp_path / "robot.yaml").write_text(text, encoding="utf-8")

    mapping = read_mapping(tmp_path / "robot.yaml")

    lasers = [rule.reading for rule in mapping.topics.values()
              if isinstance(rule.reading, ReadScan)]  # fmt: skip
    assert [None, None, "tug2"] == [laser.robot for laser in lasers]
    assert "/tug2/amcl_pose" == lasers[2].pose_topic


def test_pictures_of_the_page_are_small_and_told_in_words() -> None:
    """For who cannot see them, and for who is on the road."""
    pictures = re.findall(r"!\[([^]]*)\]\(([^)]*)\)", PAGE)

    assert 3 == len(pictures)
    for words, path in pictures:
        assert len(words) > 60
        assert (ROOT / "docs" / "guides" / path).stat().st_size < 150_000


@pytest.mark.slow
def test_pictures_of_the_page_can_be_made_anew(tmp_path: Path) -> None:
    """By the command that the contributors' page names."""
    command = "python tools/laser_pictures.py"
    assert command in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")

    subprocess.run(
        [sys.executable, ROOT / command.split()[1], tmp_path, "--no-view"], check=True, cwd=ROOT
    )

    made = {path.name: path.stat().st_size for path in tmp_path.iterdir()}
    assert {"laser_visits.png", "laser_proposed.png"} == made.keys()
    assert max(made.values()) < 150_000
