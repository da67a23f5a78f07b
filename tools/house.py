"""Say in figures how the house is kept: what a person meets who takes it over.

    python tools/house.py            a table
    python tools/house.py --json     the same as one JSON document
    python tools/house.py --twice    also the names that stand for two things

Lines are those of code files; a public name is a class, function or method without an underscore
before it; an arrow leads from a room to another one from which it imports. A switch is a call
that leads from one file of ours into another, while a log that is open gets one more sighting, or
is replayed.
"""

from __future__ import annotations

import argparse
import ast
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1] / "semmap_log"
NOT_OURS = "robot_files"
"""Files that other systems run, and nobody imports."""
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Module:
    """A file of the package, taken apart."""

    path: Path
    tree: ast.Module
    lines: int

    @property
    def name(self) -> str:
        """Its name in its room; of a room's own file, that of the room."""
        return self.path.parent.name if self.path.stem == "__init__" else self.path.stem

    @property
    def room(self) -> str:
        """The folder in the package that it lies in; of a file at the root, its own name."""
        return self.path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures."""
    args = _parsed(sys.argv[1:] if arguments is None else arguments)
    modules = list(_modules())
    found = figures(modules)
    if args.json:
        print(json.dumps(found, indent=1))
        return 0
    for name, value in found.items():
        print(f"{name:<44}{value:>8,}")
    if args.twice:
        for title, names in (("classes", classes_twice(modules)), ("files", files_twice(modules))):
            print(f"{title}: {', '.join(sorted(names)) or 'none'}")
    return 0


def figures(modules: Sequence[Module]) -> dict[str, int]:
    """Return what is counted, by its name."""
    functions = [node for module in modules for node in _functions(module.tree)]
    imports = [len(set(_imported(module))) for module in modules]
    observe, replay = _switches()
    return {
        "files": len(modules),
        "lines": sum(module.lines for module in modules),
        "lines of the longest file": max(module.lines for module in modules),
        "lines of the longest function": max(map(_length, functions)),
        "public names": sum(1 for module in modules for _ in _public(module.tree)),
        "names of two classes": len(classes_twice(modules)),
        "names of two files": len(files_twice(modules)),
        "rooms": len({module.room for module in modules}),
        "files at the root": sum(module.path.parent == PACKAGE for module in modules),
        "arrows between rooms": len(set(_arrows(modules))),
        "imports of ours in a file, at most": max(imports),
        "imports of ours in a file, of 10 files": round(10 * sum(imports) / len(imports)),
        "files that an observe goes through": observe[0],
        "switches of an observe": observe[1],
        "files that a replay goes through": replay[0],
        "switches of a replay": replay[1],
    }


def classes_twice(modules: Sequence[Module]) -> list[str]:
    """Return the names that two public classes have, those of the command line left out."""
    names = Counter(
        node.name
        for module in modules
        if module.room != "cli"
        for node in module.tree.body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    return [name for name, count in names.items() if count > 1]


def files_twice(modules: Sequence[Module]) -> list[str]:
    """Return the names that two files have, those of the command line and the root left out.

    A file may be called as its own room.
    """
    names = Counter(
        module.name
        for module in modules
        if module.room != "cli"
        and module.path.parent != PACKAGE
        and module.name != module.path.parent.name
    )
    return [name for name, count in names.items() if count > 1]


def _modules() -> Iterator[Module]:
    for path in sorted(PACKAGE.rglob("*.py")):
        if NOT_OURS not in path.relative_to(PACKAGE).parts:
            text = path.read_text(encoding="utf-8")
            yield Module(path, ast.parse(text), text.count("\n"))


def _functions(tree: ast.AST) -> Iterator[Function]:
    return (node for node in ast.walk(tree) if isinstance(node, Function))


def _length(function: Function) -> int:
    assert function.end_lineno is not None
    return function.end_lineno - function.lineno + 1


def _public(tree: ast.AST) -> Iterator[str]:
    """Yield the public functions and classes of a module, and the methods of those classes."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, Function | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name
            if isinstance(node, ast.ClassDef):
                yield from _public(node)


def _imported(module: Module) -> Iterator[str]:
    for node in ast.walk(module.tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("semmap_log."):
            yield str(node.module)


def _arrows(modules: Sequence[Module]) -> Iterator[tuple[str, str]]:
    for module in modules:
        for name in _imported(module):
            if name.split(".")[1] != module.room:
                yield module.room, name.split(".")[1]


def _switches() -> tuple[tuple[int, int], tuple[int, int]]:
    """Return through how many files an observe, and a replay, goes, and how often it changes."""
    import semmap_log as sl

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        with sl.create(path, tz="UTC", compact=False) as log:
            door = log.add_door(x=0.0, y=0.0, theta=0.0, width=0.9, name="front")
            log.observe(door, "open")
            observe = _way(lambda: log.observe(door, "closed"))
        sl.read(path).replay()
        replay = _way(lambda: sl.read(path).replay())
    return observe, replay


def _way(work: Callable[[], object]) -> tuple[int, int]:
    """Return how many files of ours a call goes through, and how often from one into another."""
    files: Counter[str] = Counter()
    switches = 0

    def note(frame: FrameType, event: str, _: Any) -> None:
        nonlocal switches
        if event != "call" or not frame.f_code.co_filename.startswith(str(PACKAGE)):
            return
        files[frame.f_code.co_filename] += 1
        caller = frame.f_back
        switches += caller is not None and caller.f_code.co_filename != frame.f_code.co_filename

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return len(files), switches


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Say in figures how the house is kept.")
    parser.add_argument("--json", action="store_true", help="one JSON document")
    parser.add_argument("--twice", action="store_true", help="also the names that stand twice")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
