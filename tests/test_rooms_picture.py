"""`tools/rooms_picture.py`: the picture of the rooms in the documentation."""

from __future__ import annotations

from pathlib import Path

import rooms_picture

from tests.test_structure import ROOMS


def test_the_picture_shows_the_imports_as_they_are() -> None:
    """Where this fails, run `python tools/rooms_picture.py`."""
    drawn = rooms_picture.picture(rooms_picture.ROOT)

    assert drawn == rooms_picture.PICTURE.read_text(encoding="utf-8")


def test_the_rooms_are_those_whose_order_is_tested() -> None:
    assert [*rooms_picture.ROOMS, "__main__"] == ROOMS


def test_an_import_between_rooms_is_a_dot(tmp_path: Path) -> None:
    """Ten imports make a larger one; an import within a room makes none."""
    for room in rooms_picture.ROOMS:
        folder = tmp_path / "semmap_log" / room
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text('"""What is <here>.\n\nMore."""\n')
    (tmp_path / "semmap_log" / "__init__.py").touch()
    for number in range(10):
        text = "import semmap_log.core\nimport semmap_log.store.part_0\n"
        (tmp_path / "semmap_log" / "store" / f"part_{number}.py").write_text(text)
    (tmp_path / "semmap_log" / "log" / "doors.py").write_text("import semmap_log.core\n")

    drawn = rooms_picture.picture(tmp_path)

    assert drawn.count("<circle") == 2
    assert {'r="6"', 'r="10"'} <= set(drawn.replace("/>", "").split())
    assert drawn.count("What is &lt;here&gt;.</text>") == len(rooms_picture.ROOMS)
    assert "More" not in drawn
