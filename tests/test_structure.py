"""The tree is the architecture: imports point one way, and heavy libraries stay at their edge."""

from __future__ import annotations

import ast
import importlib
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from types import ModuleType

import pytest

from semmap_log import errors

PACKAGE = Path(__file__).parents[1] / "semmap_log"

ROOMS = ["core", "store", "log", "analysis", "fleet", "views", "interop", "live", "cli", "__main__"]
"""From the plain nouns up: a room imports only from those before it, or from itself."""

INSIDE: dict[str, list[set[str]]] = {
    "core": [{"lazily", "late_answers", "loops"}, {"texts", "users_line"}, {"errors"}, {"io"},
             {"model"}, {"events"},
             {"messages"}, {"arrow"}, {"batches"}, {"folds"}],
    "store": [{"reading"}, {"compaction"}, {"trimming"}, {"writing"}, {"repairing"}, {"copying"}],
    "log": [{"replay"}, {"door_log"}, {"trimming"}, {"signing"}],
    "analysis": [{"costmap_2d", "probabilities"}, {"costmaps", "beliefs", "scans", "rooms"},
                 {"sql", "planning"}],
    "views": [{"bounds"}, {"excerpt"}, {"plots", "report", "rerun"}, {"notebook"}],
    "interop": [{"formats"}, {"topics", "copies"}, {"importing", "exporting"}, {"pseudonyms"}],
    "live": [{"ros"}, {"planners"}, {"oprs"}],
}  # fmt: skip
"""Room -> what is inside of it, in the same order; files of a room itself stand where they want."""

PACKAGE_FILES = {"errors", "events"}
"""At the top of the package for its users; they belong to `core`."""


EDGES: dict[str, set[str]] = {
    "rerun": {"views"},
    "rerun_bindings": {"views"},
    "rerun_cli": {"views"},
    "yaml": {"interop.formats"},
    "PIL": {"interop.formats", "views"},
    "matplotlib": {"views"},
    "pyarrow": {"core.arrow"},
    "pandas": {"core.arrow"},
    "polars": {"core.arrow"},
    "duckdb": {"analysis.sql"},
    "cryptography": {"log.signing"},
    "mcap": {"store", "interop.formats"},
    "zstandard": {"store", "interop.formats"},
    "lz4": {"store", "interop.formats"},
    "rosbags": {"interop.formats"},
    "pydantic": set(),
    "typer": {"cli"},
    "rospy": {"live"},
    "actionlib": {"live"},
    "genpy": {"live"},
    "rclpy": {"live"},
    "distributed": {"fleet"},
}
"""Third party -> the only rooms that import it: pictures are read in one and drawn in another, and
`formats` has other programs' bags."""


MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _statements(tree: ast.AST) -> Iterator[ast.stmt]:
    """Yield all statements, also those inside of others."""
    for field in ("body", "orelse", "handlers", "finalbody", "cases"):
        for node in getattr(tree, field, ()):
            if isinstance(node, ast.stmt):
                yield node
            yield from _statements(node)


@cache
def _imports(path: Path) -> list[tuple[str, str]]:
    """Return where a module imports something, and its name."""
    place, found = str(path.relative_to(PACKAGE)), []
    for node in _statements(_tree(path)):
        if isinstance(node, ast.Import):
            found += [(f"{place}, line {node.lineno}", alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.append((f"{place}, line {node.lineno}", node.module))
    return found


def _name_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _place(name: str) -> tuple[str, str]:
    """Return the room of a module, and what of it: "" for the room itself."""
    parts = [*name.split(".")[1:], ""]
    return ("core", parts[0]) if parts[0] in PACKAGE_FILES else (parts[0], parts[1])


def _is_before(one: tuple[str, str], other: tuple[str, str]) -> bool:
    """Return whether a module there may be imported from the other place."""
    if one[0] != other[0]:
        return ROOMS.index(one[0]) < ROOMS.index(other[0])
    ranks = {part: rank for rank, parts in enumerate(INSIDE.get(one[0], [])) for part in parts}
    return one[1] == other[1] or ranks.get(one[1], -1) < ranks.get(other[1], len(ranks))


def test_imports_point_toward_the_nouns() -> None:
    """
    No room imports from one that is built on it; nor do the parts of a room.
    """
    wrong = [
        f"{place}: {name}"
        for path in MODULES
        for place, name in _imports(path)
        if name.startswith("semmap_log.") and not _is_before(_place(name), _place(_name_of(path)))
    ]

    assert [] == wrong


MUST_NOT_USE = {
    "store": ["core.folds"],
    "store.verification": ["store." + part for part in ("reading", "writing", "repairing")],
    "analysis.costmap_2d": ["store", "log"],
    "analysis.probabilities": ["store", "log"],
    **{f"views.{one}": [f"views.{other}" for other in ("plots", "report", "rerun") if one != other]
       for one in ("plots", "report", "rerun", "excerpt")},
}  # fmt: skip
"""A store knows no doors, and its check believes not even the reader; estimators and layers fold
what they are given, wherever it lies; no way to look at a log leans on another."""


@pytest.mark.parametrize("room", MUST_NOT_USE)
def test_some_know_nothing_of_each_other(room: str) -> None:
    """
    Though their order would allow it.
    """
    strangers = tuple(f"semmap_log.{other}." for other in MUST_NOT_USE[room])

    wrong = [
        f"{place}: {name}"
        for path in _in(room)
        for place, name in _imports(path)
        if f"{name}.".startswith(strangers)
    ]

    assert [] == wrong


def _in(room: str) -> list[Path]:
    return [path for path in MODULES if f"{_name_of(path)}.".startswith(f"semmap_log.{room}.")]


PROBABILITIES_ORDER = [
    {"local_clock", "forecast"},
    {"beta", "scores", "evidence"},
    {"estimator", "chain", "sensors"},
    {"methods"},
    {"estimators"},
    {"belief_fold"},
]
"""What is inside `probabilities`, in the order in which it is built on each other."""


def test_inside_probabilities_imports_point_one_way_too() -> None:
    """
    From evidence to chains to methods; evidence knows no method.
    """

    def rank(room: str) -> int:
        return next((i for i, rooms in enumerate(PROBABILITIES_ORDER) if room in rooms), -1)

    rooms = {path: _name_of(path).split(".")[3:4] for path in _in("analysis.probabilities")}
    wrong = [
        f"{place}: {name}"
        for path, own in rooms.items()
        for room in own
        for place, name in _imports(path)
        if name.startswith("semmap_log.analysis.probabilities.")
        and (other := name.split(".")[3]) != room
        and rank(other) >= rank(room) >= 0
    ]

    assert [] == wrong


def test_third_parties_stay_at_their_edge() -> None:
    """
    Only one room knows MCAP, one CDR, one rerun, one YAML.
    """
    strangers = [
        f"{place}: {name}"
        for path in MODULES
        for place, name in _imports(path)
        if (party := name.split(".")[0]) in EDGES
        and not any(path in _in(room) for room in EDGES[party])
    ]

    assert [] == strangers


CORE = {"numpy", "mcap", "zstandard"}
"""What it takes to read a log."""

STARTS = [
    ("import semmap_log", set(), 13),
    ("import semmap_log as sl; sl.read(sys.argv[1]).replay()", CORE, 105),
    *((f"_verb({verb}, '--json')", CORE | {"typer"}, 140) for verb in (
        "'replay', sys.argv[1]", "'history', sys.argv[1], '-n', '3'", "'show', sys.argv[1], '58'",
        "'diff', sys.argv[1], '10:00', '11:00'", "'timeline', sys.argv[1], '1'",
    )),
    ("_verb('replay', sys.argv[1])", CORE | {"typer", "rich"}, 140),
    ("_verb('history', sys.argv[1], '-n', '3')", CORE | {"typer", "rich"}, 145),
    ("_verb('info', sys.argv[1], '--json')", CORE | {"typer"}, 145),
    ("_verb('probabilities', sys.argv[1], '--json')", CORE | {"typer"}, 198),
    ("_verb('why', sys.argv[1], '1', '--json')", CORE | {"typer"}, 200),
    ("_verb('--help')", {"typer"}, 25),
    ("_verb('--version')", {"typer"}, 27),
]  # fmt: skip
"""What a program does -> which third parties it loads, and at most how many modules of ours.

What is not here is not asked for: no types of rosbags, no pandas, no pydantic, no YAML.
"""

NEEDLESS = {
    "concurrent.futures", "importlib.resources", "logging", "mcap.records", "numpy.ma", "secrets",
    "tempfile", "zipfile",
}  # fmt: skip
"""Modules that no question to a small log needs: threads, temporary files, writing; two to nine
milliseconds each."""

_START = """
import sys
def _verb(*words):
    from semmap_log.cli import main
    try:
        main(words)
    except SystemExit as end:
        assert not end.code
"""
_LOADED = """
import json
print(json.dumps(sorted({name for name in sys.modules})), file=sys.stderr)
"""


@pytest.mark.parametrize(("program", "parties", "most"), STARTS, ids=[one[0] for one in STARTS])
def test_a_start_loads_what_it_asks_for(program: str, parties: set[str], most: int) -> None:
    """
    Modules are counted, not seconds: which third parties, and how many of ours.
    """
    loaded = _loaded_by(program)

    ours = [name for name in loaded if name.split(".")[0] == "semmap_log"]
    assert {name.split(".")[0] for name in loaded} & HEAVY == parties
    assert len(ours) <= most
    assert "numpy" not in loaded or not NEEDLESS.intersection(loaded)


def _loaded_by(program: str) -> list[str]:
    """Return the names of all modules that a program loads which is given a small log."""
    log = str(PACKAGE.parent / "recordings" / "office")
    command = [sys.executable, "-c", f"{_START}{program}{_LOADED}", log]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    names: list[str] = json.loads(done.stderr.splitlines()[-1])
    return names


HEAVY = EDGES.keys() | {"numpy", "rich", "duckdb", "polars", "hypothesis"}
"""Each costs more to load than a small log to be replayed, or nearly."""


PUBLIC = [
    "semmap_log",
    "semmap_log.analysis.beliefs",
    "semmap_log.analysis.costmaps",
    "semmap_log.events",
    "semmap_log.analysis.planning",
    "semmap_log.analysis.rooms",
]
"""The modules that the reference in docs/api.md is made of."""


FACE = "semmap_log.log"
KERNEL = ("core", "store", "log")
MOST_IN_FACE = 65
"""How many names the face has; who adds one to it takes another out, or says why there are more."""
SEAM = f"{FACE}.transport"
"""A log's files as they lie: for `fleet` alone."""


def _past_the_face(path: Path) -> Iterator[str]:
    """Yield what a module above the kernel imports of it, and is neither a noun nor in the face."""
    room = _place(_name_of(path))[0] if path.parent != PACKAGE else ""
    for node in _statements(_tree(path)):
        if isinstance(node, ast.ImportFrom):
            module = node.module or ""
            names = {f"{module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            module, names = "", {alias.name for alias in node.names}
        else:
            continue
        if module == SEAM and room == "fleet":
            continue
        allowed = {f"{FACE}.{name}" for name in _face().__all__}
        for name in sorted(names - allowed):
            if f"{name}.".startswith(("semmap_log.store.", f"{FACE}.")):
                yield f"{path.relative_to(PACKAGE)}, line {node.lineno}: {name}"


def _face() -> ModuleType:
    return importlib.import_module(FACE)


def test_above_the_kernel_its_face_is_used_and_nothing_from_inside() -> None:
    """
    Nouns of `core`, and what `semmap_log.log` exports; `fleet` also sends files as they lie.
    """
    above = [
        path
        for path in [PACKAGE / "__init__.py", *MODULES]
        if path.parent == PACKAGE or _place(_name_of(path))[0] not in KERNEL
    ]

    assert [] == [found for path in above for found in _past_the_face(path)]


def test_what_goes_past_the_face_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """
    Modules and their names, wherever in a file they are imported; the seam, outside of `fleet`.
    """
    monkeypatch.setattr(sys.modules[__name__], "PACKAGE", tmp_path)
    (tmp_path / "views").mkdir()
    path = tmp_path / "views" / "x.py"
    path.write_text(
        "from semmap_log.core.model.doors import Door\n"
        "from semmap_log.log import DoorLog, transport\n"
        "from semmap_log.log.transport import LogFolder\n"
        "def f():\n"
        "    import semmap_log.store.segment\n"
        "    from semmap_log.log.door_log.door_log import DoorLog\n"
        "    from semmap_log import store\n"
    )

    assert [
        "views/x.py, line 2: semmap_log.log.transport",
        "views/x.py, line 3: semmap_log.log.transport.LogFolder",
        "views/x.py, line 5: semmap_log.store.segment",
        "views/x.py, line 6: semmap_log.log.door_log.door_log.DoorLog",
        "views/x.py, line 7: semmap_log.store",
    ] == list(_past_the_face(path))


def test_the_face_stays_small() -> None:
    """
    Its names are those that type checkers see; somebody above the kernel uses each.
    """
    stub = _tree(PACKAGE / "log" / "__init__.pyi").body
    seen = [
        (node.module, alias.name)
        for node in stub
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]
    used = {
        alias.name
        for path in [PACKAGE / "__init__.py", *MODULES]
        for node in ast.walk(_tree(path))
        if isinstance(node, ast.ImportFrom) and node.module == FACE
        for alias in node.names
    }

    assert MOST_IN_FACE == len(_face().__all__) <= 70
    assert sorted(name for _, name in seen) == sorted(_face().__all__) == sorted(used)
    assert {name: module for module, name in seen} == {
        name: f"semmap_log.{home}" for home, names in _face()._HOMES.items() for name in names
    }


def test_each_name_of_the_face_has_its_paragraph_in_the_reference() -> None:
    """
    The kernel's page has the docstrings of all, but for those that the users' page has.
    """
    page = (PACKAGE.parent / "docs" / "kernel.md").read_text(encoding="utf-8")
    shown = re.findall(
        r"^\.\. auto(?:class|function):: semmap_log\.log\.(\w+)$", page, re.MULTILINE
    )
    front = importlib.import_module("semmap_log").__all__

    assert sorted(set(_face().__all__) - set(front)) == sorted(shown)


@pytest.mark.parametrize("name", [*PUBLIC, FACE, SEAM])
def test_a_public_module_has_all_its_names(name: str) -> None:
    """
    Every name of `__all__` is there, once, and documented; a class or function says so itself.
    """
    module = importlib.import_module(name)

    assert len(set(module.__all__)) == len(module.__all__)
    assert [] == [each for each in module.__all__ if not getattr(module, each).__doc__]


@pytest.mark.parametrize("name", ["semmap_log", "semmap_log.analysis.beliefs", FACE])
def test_a_lazy_module_shows_its_names_and_no_others(name: str) -> None:
    """
    `dir` lists them before they are loaded; a name that is not there is an AttributeError.
    """
    module = importlib.import_module(name)

    assert sorted(module.__all__) == dir(module)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        module.nothing  # noqa: B018  # asking is what is tested


def test_a_name_is_what_it_is_called_also_after_a_module_of_the_same_room_was_imported() -> None:
    """
    `analysis.beliefs.best_time` is the function: no module of the room bears a public name.
    """
    import semmap_log.analysis.beliefs

    folder = Path(semmap_log.analysis.beliefs.__file__).parent

    assert set() == {path.stem for path in folder.glob("*.py")} & set(
        semmap_log.analysis.beliefs.__all__
    )


def test_no_two_public_classes_share_a_name() -> None:
    """
    One word for one thing; the command line's are between typer and the verb.
    """
    found = Counter(
        node.name
        for path in MODULES
        if path.relative_to(PACKAGE).parts[0] != "cli"
        for node in _tree(path).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )

    assert [] == [name for name, count in found.items() if count > 1]


def test_no_two_modules_share_a_name() -> None:
    """
    Outside the command line; a module may be called as its own room.
    """
    found = Counter(
        path.stem
        for path in MODULES
        if path not in {*_in("cli"), *_in("live.robot_files"), *_in("events")}
        and path.stem not in {"__init__", path.parent.name}
    )

    assert [] == [name for name, count in found.items() if count > 1]


MAY_READ_BYTES = ("store", "log.replay", "log.door_log", "live.robot_files")
"""Rooms that know how a log is read; `robot_files` holds programs that import nothing of ours."""


def _reaching(path: Path) -> list[str]:
    """Return where a module takes the `reader` of an object that is not itself, nor a module."""
    tree = _tree(path)
    modules = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import)
        for alias in node.names
    }
    own = {"self", *modules}
    return [
        f"line {node.lineno}: {ast.unparse(node)}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and node.attr in {"reader", "_reader"}
        and not (isinstance(node.value, ast.Name) and node.value.id in own)
    ]


def test_who_asks_a_log_does_not_reach_through_it() -> None:
    """
    Above `door_log` a log answers questions; what it reads with is its own.
    """
    above = set(MODULES).difference(*map(_in, MAY_READ_BYTES))

    assert {} == {path: found for path in above if (found := _reaching(path))}


def test_what_reaches_through_a_log_is_found(tmp_path: Path) -> None:
    """
    Whatever the log is called; modules of that name, and what is an object's own, are let be.
    """
    path = tmp_path / "x.py"
    path.write_text(
        "import csv, yaml\n"
        "csv.reader(f); yaml.reader.ReaderError; self.reader.lines()\n"
        "log.reader.batches(); self._log._reader; excerpt.log.reader\n"
    )

    assert 3 == len(_reaching(path))


def test_the_reader_of_a_log_is_not_public() -> None:
    """
    Neither of one that is read nor of one that is written.
    """
    import semmap_log as sl

    assert not hasattr(sl.DoorLog, "reader")
    assert not hasattr(sl.DoorLogWriter, "reader")


def _modules_imported(path: Path, modules: set[str]) -> set[str]:
    """Return the modules of ours that a file imports, wherever in it."""
    found = set()
    for node in _statements(_tree(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (names & modules) or {node.module}
    return found & modules


def test_no_module_imports_itself_by_way_of_others() -> None:
    """
    Imports inside of functions count, too: each file can be read before those that use it.
    """
    modules = {_name_of(path): path for path in MODULES}
    imports = {name: _modules_imported(path, set(modules)) for name, path in modules.items()}

    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        pytest.fail(" <- ".join(error.args[1]))


def test_no_module_binds_a_name_twice() -> None:
    """
    A second constant or function of one name replaces the first in silence, as after a merge.
    """
    root = PACKAGE.parent
    paths = [
        path
        for folder in (PACKAGE, root / "tools", root / "tests")
        for path in folder.rglob("*.py")
    ]

    assert {} == {str(path): twice for path in paths if (twice := _bound_twice(_tree(path)))}


def test_a_name_that_is_bound_twice_is_found(tmp_path: Path) -> None:
    """
    Overloads, properties and branches are no second binding.
    """
    path = tmp_path / "x.py"
    path.write_text(
        "A = 4\ndef f(): pass\nA: int = 6\n@overload\ndef g(): pass\ndef g(): pass\n"
        "class f: pass\nif A:\n  B = 1\nelse:\n  B = 2\nC = 1\nC += 1\n"
    )

    assert ["A", "f"] == _bound_twice(_tree(path))


def _bound_twice(tree: ast.Module) -> list[str]:
    """Return the names that statements of a module itself bind more than once."""
    names: Counter[str] = Counter()
    for node in tree.body:
        if isinstance(node, ast.Assign):
            names.update(target.id for target in node.targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.AnnAssign) and node.value and isinstance(node.target, ast.Name):
            names[node.target.id] += 1
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.decorator_list:
            names[node.name] += 1
    return sorted(name for name, count in names.items() if count > 1)


def test_every_colour_is_in_the_palette() -> None:
    """
    Red, green and blue, or what a web page writes for them; nowhere else in the views.
    """
    a_colour = re.compile(r"#[0-9a-fA-F]{6}\b|0x[0-9a-fA-F]{2}, 0x|Rgb = \(")

    found = [
        f"{path.relative_to(PACKAGE)}: {line.strip()}"
        for path in MODULES
        if path.relative_to(PACKAGE).parts[0] == "views" and path.name != "palette.py"
        for line in path.read_text(encoding="utf-8").splitlines()
        if a_colour.search(line)
    ]

    assert [] == found


def test_every_error_that_a_user_can_meet_is_in_one_file() -> None:
    """
    Errors and warnings of ours; a room's own, which it catches itself, may lie in it.
    """
    ours = {name for name, each in vars(errors).items() if isinstance(each, type)}
    caught_where_they_lie = {"GoneError", "LineError"}

    found = [
        f"{path.relative_to(PACKAGE)}: {node.name}"
        for path in MODULES
        if path.name != "errors.py"
        for node in _tree(path).body
        if isinstance(node, ast.ClassDef)
        and {base.id for base in node.bases if isinstance(base, ast.Name)}
        & (ours | {"UserWarning"})
        and node.name not in caught_where_they_lie
    ]

    assert [] == found
