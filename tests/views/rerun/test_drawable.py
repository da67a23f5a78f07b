"""Text that the viewer can draw, and entity paths that a person can read."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import pytest

from semmap_log.views.rerun.drawable import drawable, has_letters, path_part, unique_parts


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Main hall", "Main hall"),
        ("Besprechungsraum Süd", "Besprechungsraum Süd"),
        ("Su\u0308d", "Süd"),
        ("Кухня → 2 €", "Кухня → 2 €"),
        ("会議室 3", "□□□ 3"),
        ("lab\t1\n", "lab 1 "),
        ("door 🚪", "door □"),
    ],
)
def test_what_the_font_lacks_becomes_a_box(text: str, expected: str) -> None:
    """
    Accents and the scripts of Europe stay; others become boxes; control characters blanks.
    """
    assert expected == drawable(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Main hall", "Main_hall"),
        ("/dev/tal", "dev_tal"),
        ("Room 3/4 (left)", "Room_3_4_left"),
        ("H.A.C.K.", "H.A.C.K"),
        ("Jeanne D'Hack", "Jeanne_D_Hack"),
        ("会議室", ""),
        ("a" * 100, "a" * 40),
    ],
)
def test_a_name_becomes_one_part_of_a_path(text: str, expected: str) -> None:
    """
    Nothing that the viewer would show with backslashes is left.
    """
    assert expected == path_part(text)


def test_every_door_gets_a_part_of_its_own() -> None:
    """
    Names that would look the same get their id behind, names without letters are their id.
    """
    parts = unique_parts(
        [(1, "Lab"), (2, "lab"), (3, "会議室"), (4, ""), (5, "door 3"), (6, "Lab_2")]
    )

    assert {1: "Lab", 2: "lab_2", 3: "door_3", 4: "door_4", 5: "door_3_5", 6: "Lab_2_6"} == parts


def test_only_boxes_are_no_name() -> None:
    """
    Where nothing can be read, the door's number stands in.
    """
    assert not has_letters("会議室")
    assert has_letters("会議室 3")


def test_real_names_keep_apart(shared_data: Path) -> None:
    """
    The 142 hackerspaces of the real data all get a path, each a different one.
    """
    with gzip.open(shared_data / "doors/spaces_polled/doors.csv.gz", "rt") as file:
        names = sorted({row["door"] for row in csv.DictReader(file)})

    parts = unique_parts(enumerate(names, start=1))

    assert 142 == len(names)
    assert 142 == len({part.casefold() for part in parts.values()})
    assert all(part == path_part(part) for part in parts.values())
