"""Compiled loops are built where they can be; elsewhere an installation goes on, and says why."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import build_loops
import pytest

from semmap_log.core import loops

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "semmap_log" / "core" / "loops" / "native.pyx"


class _Said:
    """What the build's output says."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def display_warning(self, line: str) -> None:
        self.lines.append(line)

    display_info = display_warning


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The part of a checkout that is looked at, with loops that an older version left behind."""
    folder = tmp_path / "semmap_log" / "core" / "loops"
    folder.mkdir(parents=True)
    shutil.copy(SOURCE, folder)
    (tmp_path / build_loops._MODULE).write_bytes(b"older")
    monkeypatch.delenv(build_loops.PLAIN, raising=False)
    return tmp_path


def _built(tree: Path, version: str) -> tuple[dict[str, Any], list[str], build_loops.BuildLoops]:
    said = _Said()

    class Hook(build_loops.BuildLoops):
        """The hook, without Hatchling around it."""

        root, app = str(tree), said

        def __init__(self) -> None:
            pass

    data: dict[str, Any] = {"force_include": {}}
    hook = Hook()
    hook.initialize(version, data)
    return data, said.lines, hook


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [("SEMMAP_LOG_PLAIN", "1", "SEMMAP_LOG_PLAIN asks for it"), ("CC", "false", "false failed")],
)
def test_without_them_an_installation_goes_on(
    tree: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: str, reason: str
) -> None:
    """It says why, in one line, and removes those of an older version, which nobody may use."""
    pytest.importorskip("Cython")
    monkeypatch.setenv(name, value)

    data, said, _ = _built(tree, "editable")

    assert 1 == len(said)
    assert said[0].startswith(f"semmap-log goes without compiled loops: {reason}")
    assert {"force_include": {}} == data
    assert not (tree / build_loops._MODULE).exists()


def test_without_a_compiler_nothing_is_fetched(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither Cython, which is asked for where it is of use."""
    monkeypatch.setattr(shutil, "which", lambda _: None)

    _, said, hook = _built(tree, "standard")

    assert [] == hook.dependencies()
    assert ["semmap-log goes without compiled loops: there is no C compiler (cc)"] == said


@pytest.mark.slow
@pytest.mark.parametrize("version", ["standard", "editable"])
def test_what_is_built_is_used(tree: Path, version: str) -> None:
    """It lies beside its source, or goes into the wheel, which is of this machine then."""
    pytest.importorskip("Cython")
    if build_loops.why_not():
        pytest.skip(build_loops.why_not())

    data, said, hook = _built(tree, version)

    beside = tree / build_loops._MODULE
    made = beside if version == "editable" else Path(*data["force_include"])
    assert loops.INTERFACE == _loaded(made).INTERFACE
    assert [f"semmap-log has compiled loops: {build_loops._MODULE}"] == said
    assert (version == "standard") is data.get("infer_tag", False)
    hook.finalize(version, data, "")
    assert (version == "editable") is made.exists()


def _loaded(path: Path) -> Any:
    spec = spec_from_file_location("native", path)
    assert spec is not None
    assert spec.loader is not None
    made = module_from_spec(spec)
    spec.loader.exec_module(made)
    sys.modules.pop("native", None)
    return made
