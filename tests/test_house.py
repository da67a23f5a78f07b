"""`tools/house.py`: figures of a small checkout, counted by hand, and of this one."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import house
import pytest

ROOT = Path(__file__).parents[1]
FILES = {
    "semmap_log/__init__.py": "",
    "semmap_log/errors.py": "class DoorError(Exception): ...\n",
    "semmap_log/core/__init__.py": "",
    "semmap_log/core/doors.py": '''"""Doors that were told of.

What a door is.
"""

# a comment
from semmap_log.errors import DoorError

SIZE = 1
"""Of a door."""


def size(door: int) -> int:
    """Return it."""
    return _size(door)


def _size(door: int) -> int:
    if door < 0:
        raise DoorError
    return door
''',
    "semmap_log/store/__init__.py": "",
    "semmap_log/store/reading/__init__.py": "",
    "semmap_log/store/reading/rows.py": "from semmap_log.core import (\n    doors,\n)\n",
    "semmap_log/store/reading/doors.py": "from semmap_log.store.reading.rows import doors\n",
    "semmap_log/store/robot_files/sample.py": "import semmap_log.core.doors\n",
}


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_figures_are_those_counted_by_hand(checkout: Path) -> None:
    found = house.figures(house.modules_of(checkout))

    assert (
        found
        | {
            "files": 8,
            "code lines": 1 + 8 + 3 + 1,
            "lines of the longest function": 4,
            "rooms": 2,
            "arrows between rooms": 1,
            "imports between files": 3,
            "longest import chain": 4,
            "import lines, % of code": round(100 * 5 / 13, 1),
            "private functions called once": 1,
            "public names": 2,
            '"told", of 10,000 words': round(10_000 / 14, 1),
            '"what", of 10,000 words': round(10_000 / 14, 1),
        }
        == found
    )


def test_files_that_import_each_other_are_an_error(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with (checkout / "semmap_log/errors.py").open("a") as file:
        file.write("import semmap_log.core.doors\n")

    assert 1 == house.main([str(checkout)])
    assert "semmap_log.errors <- semmap_log.core.doors" in capsys.readouterr().err


def test_a_chain_goes_on_through_a_name_that_is_loaded_late(checkout: Path) -> None:
    """
    `cli.size` imports `store.reading`, whose stub takes the name from the last of a chain of four.
    """
    (checkout / "semmap_log/store/reading/__init__.pyi").write_text(
        "from semmap_log.store.reading.doors import doors as doors\n"
    )
    (checkout / "semmap_log/cli").mkdir()
    (checkout / "semmap_log/cli/__init__.py").write_text("")
    (checkout / "semmap_log/cli/size.py").write_text("from semmap_log.store.reading import doors\n")

    assert 5 == house.figures(house.modules_of(checkout))["longest import chain"]


def test_a_folder_without_the_package_is_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert 1 == house.main([str(tmp_path)])
    assert f"{tmp_path}: expected a checkout" in capsys.readouterr().err


def test_verbs_walk_through_what_they_call(checkout: Path) -> None:
    """
    Each verb calls `main`, which calls `size`, once and again; what an import calls is left out.
    """
    shutil.copytree(ROOT / "recordings" / "office", checkout / "recordings" / "office")
    (checkout / "semmap_log" / "cli").mkdir()
    (checkout / "semmap_log" / "cli" / "__init__.py").write_text(
        "from semmap_log.core.doors import size, _size\n"
        "_size(2)\n"
        "def unused(): ...\n"
        "unused()\n"
        "def main(): return [size(n) for n in range(3)]\n"
    )

    assert {
        "functions that observe walks": 3,
        "files that observe walks": 2,
        "functions that replay --at walks": 3,
        "files that replay --at walks": 2,
    } == house.walks(checkout)


@pytest.mark.slow
def test_this_checkout_stands_beside_the_baseline(capsys: pytest.CaptureFixture[str]) -> None:
    assert 0 == house.main([])
    rows = capsys.readouterr().out.splitlines()

    names = json.loads(house.BASELINE.read_text())["figures"]
    assert list(names) == [row[:36].strip() for row in rows[1:]]
