"""Show how much there is to read, how it is connected, and in what words, against a baseline.

    python tools/house.py                 this checkout: baseline, now, and their ratio
    python tools/house.py PATH            another checkout
    python tools/house.py --json [PATH]   one document; `house_baseline.json` is such a one

The baseline is commit 766f04a3, measured by these rules, with Python 3.11 and the `dev` extra:

    git worktree add --detach ../base 766f04a3
    python tools/house.py --json ../base > tools/house_baseline.json

Definitions. All but the walks are read from the source of `semmap_log`, with `ast` and `tokenize`.

files: Python files in packages; programs for robots (launch files, samples) lie in none.
code lines: lines with a token that is no comment and no docstring, of modules, classes, functions
    or attributes.
rooms: packages directly in `semmap_log`. arrows: pairs of rooms of which one imports the other,
    anywhere in a file. imports: pairs of files of which one imports the other.
longest import chain: files, each of which imports the next, anywhere in the file. Who imports a
    name from a package that loads it late, imports the file that its `__init__.pyi` names.
import lines: their share of the code lines, in percent.
private functions called once: functions and methods whose name begins with one underscore, and
    stands once in their file beside its definition.
public names: functions, classes and their methods without an underscore, one in each file.
a walk: functions of ours that are called (comprehensions and lambdas are none), and their files,
    while a program runs a verb on a copy of `recordings/office`; what runs while a module is
    imported is not counted. The compiled loops are off, as in a checkout without a C compiler.
words: occurrences per 10,000 words of docstrings, capital or small.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

PACKAGE = "semmap_log"
ROOT = Path(__file__).resolve().parent.parent
BASELINE = Path(__file__).with_name("house_baseline.json")
WORDS = (
    "told", "tells?", "said", "says?", "asked", "anew", "behind", "beside", "ever", "is none",
    "what",
)  # fmt: skip
"""Expressions of this house that stand for terms of the field, or for nothing."""
VERBS = {
    "observe": ("observe", "LOG", "1", "open", "--actor", "house"),
    "replay --at": ("replay", "LOG", "--at", "2026-03-02 12:00"),
}
_NO_CODE = {
    tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.COMMENT,
    tokenize.ENCODING, tokenize.ENDMARKER,
}  # fmt: skip
_WALK = """
import sys, threading
root, walked = sys.argv[1], set()
def note(frame, event, _):
    code = frame.f_code
    if event == "call" and code.co_filename.startswith(root) and code.co_name[0] != "<":
        while frame and frame.f_code.co_name != "<module>":
            frame = frame.f_back
        if not (frame and frame.f_code.co_filename.startswith(root)):  # no module is imported
            walked.add((code.co_filename, code.co_firstlineno))
sys.argv = ["semmap-log", *sys.argv[2:]]
threading.setprofile(note)
sys.setprofile(note)
try:
    from semmap_log.cli import main
    main()
except SystemExit as end:
    sys.setprofile(None)
    if end.code:
        raise
sys.setprofile(None)
print(len(walked), len({file for file, _ in walked}), file=sys.stderr)
"""
Function = ast.FunctionDef | ast.AsyncFunctionDef


class HouseError(Exception):
    """A checkout that cannot be measured."""


@dataclass(frozen=True)
class Module:
    """A file of the package, and what is counted in it."""

    name: str
    """Dotted; of a package's own file, that of the package."""
    is_package: bool
    text: str
    stub: str = ""
    """Of a package that loads its names late, what type checkers read."""

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax."""
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> list[ast.AST]:
        """All nodes of its syntax."""
        return list(ast.walk(self.tree))

    @property
    def room(self) -> str | None:
        """The package in `semmap_log` that it belongs to; None: it is beside those."""
        parts = self.name.split(".")
        return parts[1] if len(parts) > 2 or (self.is_package and len(parts) > 1) else None

    @property
    def functions(self) -> list[Function]:
        """All functions and methods."""
        return [node for node in self.nodes if isinstance(node, Function)]

    @property
    def docstrings(self) -> list[ast.Constant]:
        """Every string that stands by itself."""
        return [
            node.value
            for node in self.nodes
            if isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ]

    @property
    def code_lines(self) -> int:
        """How many lines are code."""
        lines: set[int] = set()
        for token in tokenize.generate_tokens(io.StringIO(self.text).readline):
            if token.type not in _NO_CODE:
                lines.update(range(token.start[0], token.end[0] + 1))
        for text in self.docstrings:
            lines.difference_update(_lines(text))
        return len(lines)

    @property
    def import_lines(self) -> int:
        """How many lines are imports."""
        imports = [node for node in self.nodes if isinstance(node, ast.Import | ast.ImportFrom)]
        return len({line for node in imports for line in _lines(node)})

    def imported(self, modules: Mapping[str, Module]) -> set[str]:
        """Return the modules among these that it imports."""
        names: set[str] = set()
        for node in self.nodes:
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                names |= (inner & modules.keys()) or {node.module}
        return (names & modules.keys()) - {self.name}

    @cached_property
    def homes(self) -> dict[str, str]:
        """The names that it loads late, and the modules that they come from."""
        imports = [node for node in ast.parse(self.stub).body if isinstance(node, ast.ImportFrom)]
        return {alias.name: node.module or "" for node in imports for alias in node.names}

    def followed(self, modules: Mapping[str, Module]) -> set[str]:
        """Return what it imports, and the homes of the names among it that are loaded late."""
        late = {
            modules[node.module].homes.get(alias.name, "")
            for node in self.nodes
            if isinstance(node, ast.ImportFrom) and node.module in modules
            for alias in node.names
        }
        return self.imported(modules) | ((late & modules.keys()) - {self.name})

    def called_once(self) -> int:
        """Return how many private functions one place of the file names."""
        used = Counter(
            node.id if isinstance(node, ast.Name) else node.attr
            for node in self.nodes
            if isinstance(node, ast.Name | ast.Attribute)
        )
        return sum(
            used[each.name] == 1 and each.name.startswith("_") and not each.name.startswith("__")
            for each in self.functions
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures."""
    args = _parsed(sys.argv[1:] if arguments is None else arguments)
    try:
        modules = modules_of(args.checkout)
        found = figures(modules) | walks(args.checkout)
    except HouseError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    if args.json:
        document = {"commit": _commit(args.checkout), "python": platform.python_version()}
        print(json.dumps(document | {"figures": found}, indent=1))
        return 0
    _print_table(json.loads(BASELINE.read_text(encoding="utf-8")), found)
    return 0


def modules_of(checkout: Path) -> dict[str, Module]:
    """Return the modules of a checkout by their names."""
    found = {}
    for path in sorted((checkout / PACKAGE).rglob("*.py")):
        if not path.with_name("__init__.py").exists():
            continue
        parts = path.relative_to(checkout).with_suffix("").parts
        is_package = parts[-1] == "__init__"
        name = ".".join(parts[:-1] if is_package else parts)
        stub = path.with_suffix(".pyi")
        late = stub.read_text(encoding="utf-8") if stub.exists() else ""
        found[name] = Module(name, is_package, path.read_text(encoding="utf-8"), late)
    if not found:
        raise HouseError(f"{checkout}: expected a checkout, found no package {PACKAGE}")
    return found


def figures(modules: Mapping[str, Module]) -> dict[str, float]:
    """Return what the source says, by its name."""
    every = modules.values()
    imports = {module.name: module.imported(modules) for module in every}
    functions = [function for module in every for function in module.functions]
    code = sum(module.code_lines for module in every)
    counted: dict[str, float] = {
        "files": len(modules),
        "lines": sum(module.text.count("\n") for module in every),
        "code lines": code,
        "lines of the longest file": max(module.text.count("\n") for module in every),
        "lines of the longest function": max((len(_lines(each)) for each in functions), default=0),
        "rooms": len({module.room for module in every} - {None}),
        "arrows between rooms": len(_arrows(modules, imports)),
        "imports between files": sum(map(len, imports.values())),
        "longest import chain": longest_chain(
            {module.name: module.followed(modules) for module in every}
        ),
        "import lines, % of code": _rounded(100 * sum(m.import_lines for m in every) / code),
        "private functions called once": sum(module.called_once() for module in every),
        "public names": sum(1 for module in every for _ in _public(module.tree)),
    }
    prose = " ".join(str(text.value) for module in every for text in module.docstrings)
    words = len(re.findall(r"[A-Za-z']+", prose)) or 1
    for word in WORDS:
        count = len(re.findall(rf"\b{word}\b", prose, re.IGNORECASE))
        counted[f'"{word.replace("s?", "(s)")}", of 10,000 words'] = _rounded(
            10_000 * count / words
        )
    return counted


def longest_chain(imports: Mapping[str, set[str]]) -> int:
    """Return how many modules the longest chain of imports has."""
    lengths: dict[str, int] = {}
    try:
        for name in TopologicalSorter(imports).static_order():
            lengths[name] = 1 + max((lengths[other] for other in imports[name]), default=0)
    except CycleError as error:
        raise HouseError(f"files import each other: {' <- '.join(error.args[1])}") from error
    return max(lengths.values())


def walks(checkout: Path) -> dict[str, float]:
    """Return how many functions and files of ours each verb calls into, by its name."""
    found: dict[str, float] = {}
    for name, verb in VERBS.items():
        functions, files = _walk(checkout.resolve(), verb)
        found |= {f"functions that {name} walks": functions, f"files that {name} walks": files}
    return found


def _walk(checkout: Path, verb: Sequence[str]) -> tuple[int, int]:
    with tempfile.TemporaryDirectory() as folder:
        log = shutil.copytree(checkout / "recordings" / "office", Path(folder) / "log")
        words = [str(log) if word == "LOG" else word for word in verb]
        environment = {"PYTHONPATH": str(checkout), "SEMMAP_LOG_PLAIN": "1", "HOME": folder}
        done = subprocess.run(
            [sys.executable, "-c", _WALK, str(checkout / PACKAGE), *words],
            env=os.environ | environment, cwd=folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
    if done.returncode:
        raise HouseError(f"`{' '.join(verb)}` fails in {checkout}: {done.stderr.strip()[-200:]}")
    functions, files = done.stderr.split()[-2:]
    return int(functions), int(files)


def _arrows(
    modules: Mapping[str, Module], imports: Mapping[str, set[str]]
) -> set[tuple[str | None, str | None]]:
    pairs = {
        (modules[name].room, modules[other].room)
        for name, others in imports.items()
        for other in others
    }
    return {(one, other) for one, other in pairs if one and other and one != other}


def _public(tree: ast.AST) -> Iterator[str]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, Function | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name
            if isinstance(node, ast.ClassDef):
                yield from _public(node)


def _lines(node: Any) -> range:
    return range(node.lineno, node.end_lineno + 1)


def _rounded(value: float) -> float:
    return round(value, 1)


def _commit(checkout: Path) -> str:
    command = ["git", "-C", str(checkout), "rev-parse", "--short=8", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def _print_table(baseline: Mapping[str, Any], found: Mapping[str, float]) -> None:
    print(f"{'':<36}{baseline['commit']:>10}{'now':>10}{'ratio':>8}")
    for name, now in found.items():
        before = baseline["figures"].get(name)
        ratio = f"{now / before:.2f}" if before else "-"
        print(f"{name:<36}{'-' if before is None else f'{before:,}':>10}{now:>10,}{ratio:>8}")
    if platform.python_version_tuple()[:2] != tuple(baseline["python"].split(".")[:2]):
        print(f"The baseline was measured with Python {baseline['python']}.", file=sys.stderr)


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("checkout", type=Path, nargs="?", default=ROOT, help="default: this one")
    parser.add_argument("--json", action="store_true", help="one JSON document")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
