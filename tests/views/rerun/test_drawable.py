"""Text that the viewer can draw, and entity paths that a person can read."""

from __future__ import annotations

import csv
import gzip
import struct
import unicodedata
from contextlib import suppress
from io import BytesIO
from mmap import ACCESS_READ, mmap
from pathlib import Path

import pytest

from semmap_log.views.rerun.drawable import _DRAWN, drawable, drawable_name, path_part, unique_parts

FONT = b"\0\1\0\0\0"
"""How a TrueType font begins: a version, and less than 256 tables."""


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
    """Accents and the scripts of Europe stay; others become boxes; control characters blanks."""
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
        ("会議室 3", ""),
        ("a" * 100, "a" * 40),
    ],
)
def test_a_name_becomes_one_part_of_a_path(text: str, expected: str) -> None:
    """Nothing that the viewer would show with backslashes is left."""
    assert expected == path_part(text)


def test_every_door_gets_a_part_of_its_own() -> None:
    """Names that would look the same get their id behind, names without letters are their id."""
    parts = unique_parts(
        [(1, "Lab"), (2, "lab"), (3, "会議室"), (4, ""), (5, "door 3"), (6, "Lab_2")]
    )

    assert {1: "Lab", 2: "lab_2", 3: "door_3", 4: "door_4", 5: "door_3_5", 6: "Lab_2_6"} == parts


def test_robots_and_levels_have_parts_of_their_own_kind() -> None:
    """A robot of which no letter can be drawn is no door."""
    assert {1: "robot_1", 2: "Bob"} == unique_parts([(1, "掃除"), (2, "Bob")], "robot")


@pytest.mark.parametrize(
    "name",
    ["Hall", "Küche", "Ştiinţă", "Đại sảnh", "Κουζίνα", "Кухня №2", "Əli", "Ọ̀yọ́", "Café ½ Süd",
     "Room ½", "→ exit"],
)  # fmt: skip
def test_names_in_latin_greek_and_cyrillic_letters_stay(name: str) -> None:
    """With their accents and signs."""
    assert unicodedata.normalize("NFC", name) == drawable_name(name, "door 7")


@pytest.mark.parametrize(
    "name",
    ["会議室", "会議室 3", "Lab 会議室", "회의실", "かいぎ", "קומה", "قاعة ٣", "ห้อง", "बैठक",
     "Սենյակ", "ოთახი", "", "🚪", "🚪 🙂", "---"],
)  # fmt: skip
def test_a_name_with_a_letter_that_the_font_lacks_gives_way(name: str) -> None:
    """Two rooms may differ in just that letter; and a digit that is left would look like an id."""
    assert "door 7" == drawable_name(name, "door 7")


@pytest.mark.parametrize(("name", "shown"), [("Exit 🚪", "Exit"), ("a\tb 🙂 c\n", "a b c")])
def test_signs_that_the_font_lacks_are_left_out_of_names(name: str, shown: str) -> None:
    """As long as letters are left."""
    assert shown == drawable_name(name, "door 7")


def test_what_is_drawn_is_what_the_viewers_font_has() -> None:
    """Neither more, which would end a headless viewer, nor less: read from the viewer's program."""
    pytest.importorskip("fontTools", reason="not installed: it comes with matplotlib")
    cli = pytest.importorskip("rerun_cli", reason="not installed: the extra 'viewer'")

    held = glyphs_of_inter(Path(cli.__file__).parent / "rerun")

    visible = {code for code in held if unicodedata.category(chr(code)) not in {"Cc", "Cf", "Co"}}
    assert len(visible) > 1000
    assert visible == {code for first, last in _DRAWN for code in range(first, last + 1)}


def glyphs_of_inter(program: Path) -> set[int]:
    """The characters of the font within a program."""
    with program.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as held:
        at = held.find(FONT)
        while at >= 0:
            if found := glyphs_of(held[at : at + 2**20]):
                return found
            at = held.find(FONT, at + 1)
    raise AssertionError("the viewer has no font called Inter any more")


def glyphs_of(beginning: bytes) -> set[int]:
    """The characters of a font, if there begins one called Inter; else none."""
    from fontTools.ttLib import TTFont, TTLibError

    with suppress(TTLibError, AssertionError, struct.error):
        font = TTFont(BytesIO(beginning))
        if "name" in font and (font["name"].getDebugName(1) or "").startswith("Inter"):
            return set(font.getBestCmap())
    return set()


def test_real_names_keep_apart(shared_data: Path) -> None:
    """The 142 hackerspaces of the real data all get a path, each a different one."""
    with gzip.open(shared_data / "doors/spaces_polled/doors.csv.gz", "rt") as file:
        names = sorted({row["door"] for row in csv.DictReader(file)})

    parts = unique_parts(enumerate(names, start=1))

    assert 142 == len(names)
    assert 142 == len({part.casefold() for part in parts.values()})
    assert all(part == path_part(part) for part in parts.values())
