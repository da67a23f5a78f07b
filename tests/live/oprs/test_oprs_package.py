"""`oprs-package`: the module, laid out to be built."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from build_oprs_module import main as build_main

from semmap_log.live.oprs.oprs_package import MADE
from tests.live.oprs.building import MODULE, ROOT, STUB, compiler
from tests.verbs import run


def _files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not any(path.match(made) for made in MADE)
    }


def test_a_folder_gets_all_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every file as it is here; and it says how to go on."""
    assert 0 == run("oprs-package", tmp_path)

    assert _files(MODULE) == _files(tmp_path / MODULE.name)
    said = capsys.readouterr().err
    assert f"make -C {tmp_path}/semantic_map_oprs OPRS=FOLDER" in said
    assert f"oprs -a -A -n K1 -l none -x {tmp_path}/semantic_map_oprs/semantic_map.inc" in said


def test_a_second_copy_changes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also when it was built in between."""
    for is_new in (True, False):
        assert 0 == run("oprs-package", tmp_path, "--json")
        (tmp_path / MODULE.name / "semantic_map_oprs.so").touch()
        package = str(tmp_path / MODULE.name)
        assert {"package": package, "written": is_new} == json.loads(capsys.readouterr().out)


def test_what_somebody_changed_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Plans are there to be changed; the first file that differs is named."""
    assert 0 == run("oprs-package", tmp_path)
    theirs = tmp_path / MODULE.name / "semantic_map.opf"
    theirs.write_text("theirs", encoding="utf-8")

    assert 1 == run("oprs-package", tmp_path)

    assert "differs from this module (semantic_map.opf differs)" in capsys.readouterr().err
    assert "theirs" == theirs.read_text(encoding="utf-8")


def test_a_folder_must_be_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A misspelt path makes no folder."""
    assert 1 == run("oprs-package", tmp_path / "robott")

    assert "no such folder; expected one to put semantic_map_oprs in" in capsys.readouterr().err
    assert [] == list(tmp_path.iterdir())


def test_what_was_built_here_is_not_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module of this machine is of no use on another."""
    package = tmp_path / "semmap_log" / "live" / "oprs" / MODULE.name
    shutil.copytree(MODULE, package)
    for name in ("client.o", "semantic_map_oprs.so", "semantic_map.inc"):
        (package / name).touch()
    monkeypatch.setattr(
        "semmap_log.live.oprs.oprs_package.files", lambda _package: tmp_path / "semmap_log"
    )

    for _ in range(2):
        assert 0 == run("oprs-package", tmp_path)

    assert not list((tmp_path / MODULE.name).glob("*.[os]*o"))
    assert _files(MODULE) == _files(tmp_path / MODULE.name)


@pytest.mark.slow
def test_make_builds_the_module(tmp_path: Path) -> None:
    """Also in a folder with a blank in its name; nothing but its init function is seen outside."""
    if compiler() is None or shutil.which("make") is None:
        pytest.skip("no C compiler or no make here")
    folder = tmp_path / "my robot & I"
    folder.mkdir()
    assert 0 == run("oprs-package", folder)
    package = folder / MODULE.name

    missing = subprocess.run(["make", "-C", package], capture_output=True, text=True, check=False)
    assert "expected: make OPRS=/path/to/OpenPRS" in missing.stderr
    assert 0 != missing.returncode
    wrong = subprocess.run(
        ["make", "-C", package, f"OPRS={tmp_path}"], capture_output=True, text=True, check=False
    )
    assert f"OPRS={tmp_path}: has no src/oprs-type_f-pub.h" in wrong.stderr
    assert 0 != wrong.returncode
    done = subprocess.run(
        ["make", "-C", package, "OPRS=stub", f"HEADERS={STUB}", "CFLAGS=-Wall -Wextra -Werror"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip

    assert (0, "") == (done.returncode, done.stderr)
    include = (package / "semantic_map.inc").read_text(encoding="utf-8")
    assert f'load external "{package}/semantic_map_oprs" "init_semantic_map_oprs"' in include
    symbols = subprocess.run(
        ["nm", "-D", "--defined-only", package / "semantic_map_oprs.so"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ["init_semantic_map_oprs"] == re.findall(r" T (\S+)", symbols.stdout)
    subprocess.run(["make", "-C", package, "clean"], check=True, capture_output=True)
    assert _files(MODULE) == _files(package)
    assert not list(package.glob("*.[os]*o"))


def test_each_action_is_a_goal() -> None:
    """The module's actions and the plans that make them goals are the same."""
    source = (MODULE / "semantic_map_oprs.c").read_text(encoding="utf-8")
    table = source.partition("ACTIONS[] = {")[2].partition("};")[0]
    plans = (MODULE / "semantic_map.opf").read_text(encoding="utf-8")

    goals = re.findall(r":invocation \(! \((\w+)[^)]*\)\)\s+:action \(\1", plans)

    assert set(re.findall(r'\{"(\w+)"', table)) == set(goals) & set(re.findall(r'"(\w+)"', table))


def test_the_guide_names_all_that_is_declared() -> None:
    """And the numbers that the module says when it is loaded."""
    source = (MODULE / "semantic_map_oprs.c").read_text(encoding="utf-8")
    guide = (ROOT / "docs" / "guides" / "planners_oprs.md").read_text(encoding="utf-8")
    declared = set(re.findall(r'^    \{"([A-Z_]+)", \w+, ', source, re.MULTILINE))
    declared |= set(re.findall(r'eval_pred_no_eval_var\("([A-Z_]+)"', source))

    assert 25 == len(declared)
    assert {"DOOR_MAP_LOADED"} == {name for name in declared if f"({name}" not in guide}
    assert "loaded: 7 predicates, 12 functions, 6 actions" in guide


def test_the_tool_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No variable; a folder that is not built."""
    monkeypatch.delenv("SEMMAP_OPRS", raising=False)
    assert 1 == build_main([str(tmp_path)])
    monkeypatch.setenv("SEMMAP_OPRS", str(tmp_path))
    assert 1 == build_main([str(tmp_path)])

    said = capsys.readouterr().err
    assert "SEMMAP_OPRS is not set: it names the folder in which OpenPRS was built" in said
    assert f"SEMMAP_OPRS={tmp_path}: has no src/oprs" in said
