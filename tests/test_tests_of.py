"""Each module has a test, and `tools/tests_of.py` tells which."""

from __future__ import annotations

from pathlib import Path

import pytest
import tests_of

TESTS = Path(__file__).parent
SEEN_FROM_OUTSIDE = {"__main__.py"}
"""What only starts the program, as many tests do."""


def test_each_module_has_a_test() -> None:
    """One that imports it, or imports what imports it."""
    modules = [
        path
        for path in tests_of.modules_of(tests_of.PACKAGE)
        if tests_of.PACKAGE / "live" / "robot_files" not in path.parents
        and path.name not in SEEN_FROM_OUTSIDE
    ]

    assert 100 < len(modules)
    assert [] == [module for module in modules if not tests_of.tests_of(module)]


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small checkout."""
    for path, text in [
        ("semmap_log/core/model/doors.py", ""),
        ("semmap_log/room/rows.py", "from semmap_log.core.model.doors import Door"),
        ("semmap_log/room/table.py", "from semmap_log.room import rows"),
        ("semmap_log/alone.py", "import semmap_log.core.model.doors"),
        ("semmap_log/log/__init__.pyi", "from semmap_log.log.far import far as far"),
        ("semmap_log/log/far.py", ""),
        ("semmap_log/views/near.py", "from semmap_log.log import far"),
        ("tests/test_doors.py", ""),
        ("tests/test_view.py", "from semmap_log.views.near import far"),
        ("tests/test_else.py", "from semmap_log.core.model.doors import Door"),
        ("tests/room/test_all.py", "import semmap_log.room.table"),
    ]:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    monkeypatch.setattr(tests_of, "ROOT", tmp_path)
    monkeypatch.setattr(tests_of, "PACKAGE", tmp_path / "semmap_log")
    monkeypatch.setattr(tests_of, "TESTS", tmp_path / "tests")
    return tmp_path


def test_those_of_the_modules_name_come_first_and_the_nearest_behind(
    tree: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By its name, by its import, by the import of what imports it."""
    assert 0 == tests_of.main(["doors", str(tree / "semmap_log/room/rows.py")])

    assert capsys.readouterr().out.splitlines() == [
        "semmap_log/core/model/doors.py: tests/test_doors.py",
        "semmap_log/core/model/doors.py: tests/test_else.py",
        "semmap_log/room/rows.py: tests/room/test_all.py",
    ]


def test_a_name_leads_to_the_file_that_others_pass_it_on_from(
    tree: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert 0 == tests_of.main([str(tree / "semmap_log/log/far.py")])

    assert "semmap_log/log/far.py: tests/test_view.py\n" == capsys.readouterr().out


@pytest.mark.parametrize("name", ["alone", "nothing"])
def test_a_module_without_a_test_is_an_error(name: str, tree: Path) -> None:
    assert 1 == tests_of.main([name])


def test_the_readme_of_the_tests_names_every_folder() -> None:
    """So that one finds a room's tests, whatever they are called."""
    readme = (TESTS / "README.md").read_text(encoding="utf-8")
    folders = {path.parent.relative_to(TESTS).as_posix() for path in TESTS.rglob("test_*.py")} - {
        "."
    }

    assert 20 < len(folders)
    assert [] == sorted(folder for folder in folders if f"`{folder}/`" not in readme)
