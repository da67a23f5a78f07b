"""Say which tests a module has.

    python tools/tests_of.py semmap_log/store/chunks.py
    python tools/tests_of.py chunks thesis_yaml

Tests named as the module come first, then those that import it, then those that import what
imports it; further away than the nearest that there are, none is told.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "semmap_log"
TESTS = ROOT / "tests"


def main(names: list[str]) -> int:
    """Print a line for each test module; 1 if a module is not there, or has none."""
    missing = 0
    for name in names:
        modules = [path for path in modules_of(PACKAGE) if Path(name).stem in (path.stem, "")]
        if "/" in name:
            modules = [path for path in modules if path == Path(name).resolve()]
        for path in modules:
            tests = tests_of(path)
            missing += not tests
            for test in tests:
                print(f"{path.relative_to(ROOT)}: {test.relative_to(ROOT)}")
        if not modules:
            missing += 1
            print(f"{name}: no module of {PACKAGE.name} is called so", file=sys.stderr)
    return int(missing > 0)


def tests_of(module: Path) -> list[Path]:
    """Return the test modules that are nearest to a module, those named as it first."""
    tests = [path for path in modules_of(TESTS) if path.stem.startswith("test_")]
    named = [path for path in tests if path.stem == f"test_{module.stem}"]
    reached = {module}
    while reached:
        near = [path for path in tests if _imports(path) & _dotted(reached) and path not in named]
        if named or near:
            return named + near
        everywhere = [*modules_of(PACKAGE), *modules_of(TESTS)]
        wider = reached | {path for path in everywhere if _imports(path) & _dotted(reached)}
        if wider == reached:
            return []
        reached = wider
    return []


@cache
def modules_of(folder: Path) -> list[Path]:
    """Return the Python files of a folder."""
    return sorted(folder.rglob("*.py"))


def _dotted(paths: Iterable[Path]) -> set[str]:
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for path in paths
    }


@cache
def _imports(path: Path) -> frozenset[str]:
    """Return the dotted names of all that a file imports, or names in a string, as to patch it."""
    text = path.read_text(encoding="utf-8")
    found = set(re.findall(r'"(semmap_log(?:\.\w+)+)', text))
    if path.name == "verb_table.py":  # verbs are loaded by their names
        found |= _dotted(path.parent.glob("*.py"))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
            found.update(_home(node.module, alias.name) for alias in node.names)
    return frozenset(found | {name.rpartition(".")[0] for name in found if name.count(".") > 1})


def _home(module: str, name: str) -> str:
    """Return the module that a name comes from, which another only passes on."""
    place = ROOT.joinpath(*module.split("."))
    for path in (place / "__init__.pyi", place / "__init__.py", place.with_suffix(".py")):
        if path.exists():
            home = _passed_on(path).get(name, module)
            return module if home == module else _home(home, name)
    return module


@cache
def _passed_on(path: Path) -> dict[str, str]:
    """Return the names that a file passes on, and the modules that it has them from."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: node.module or "" for node in imports for alias in node.names}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
