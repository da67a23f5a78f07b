"""The tree is the architecture: imports point one way, and heavy libraries stay at their edge."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "semmap_log"

ORDER = [
    {"common"},
    {"errors"},
    {"domain"},
    {"events"},
    {"messages"},
    {"arrow"},
    {"batches"},
    {"costmap"},
    {"projections"},
    {"probabilities"},
    {"log"},
    {"folding"},
    {"door_log"},
    {"costmaps", "beliefs"},
    {"formats"},
    {"views", "ros_mapping"},
    {"importing", "exporting"},
    {"live"},
    {"oprs"},
    {"demo"},
    {"cli"},
    {"__main__"},
]
"""From the plain nouns up: a room imports only from rooms above it in this list, or from itself.

`formats` and `views` know values and the log's questions; what joins them to a log comes after.
"""

EDGES: dict[str, set[str]] = {
    "rerun": {"views"},
    "rerun_bindings": {"views"},
    "rerun_cli": {"views"},
    "yaml": {"formats"},
    "PIL": {"formats", "views"},
    "matplotlib": {"views"},
    "pyarrow": {"arrow"},
    "pandas": {"arrow"},
    "mcap": {"log", "formats"},
    "zstandard": {"log", "formats"},
    "lz4": {"log", "formats"},
    "rosbags": {"messages", "formats"},
    "typer": {"cli"},
    "rospy": {"live", "ros"},
    "actionlib": {"live", "ros"},
    "genpy": {"live"},
    "rclpy": {"live", "ros"},
}
"""Third party -> the only rooms that import it: pictures are read in one and drawn in another, and
`formats` has other programs' bags."""


def _rank(room: str) -> int:
    return next(i for i, rooms in enumerate(ORDER) if room in rooms)


def _imports(path: Path) -> list[tuple[int, str]]:
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.append((node.lineno, node.module))
    return found


MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_toward_the_nouns(path: Path) -> None:
    """
    No room imports from one that is built on it.
    """
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")

    wrong = [
        f"line {line}: {name}"
        for line, name in _imports(path)
        if name.startswith("semmap_log.")
        and name.split(".")[1] != room
        and _rank(name.split(".")[1]) >= _rank(room)
    ]

    assert [] == wrong


LOG_ORDER = ["", "reading", "compaction", "writing", "verification", "salvage"]
"""The rooms inside `log`, in the order in which they are built on each other; "": `log` itself."""


def _room_in_log(module: str) -> str:
    """Return the room of `semmap_log.store.<room>.<file>`; "" for a file in `log` itself."""
    name = module.split(".")[2] if module.count(".") > 1 else ""
    return name if name in LOG_ORDER else ""


@pytest.mark.parametrize(
    "path",
    [path for path in MODULES if path.relative_to(PACKAGE).parts[0] == "log"],
    ids=lambda path: str(path.relative_to(PACKAGE)),
)
def test_inside_the_log_imports_point_one_way_too(path: Path) -> None:
    """
    Nothing shared leans on a room; verification leans on none: it believes not even the reader.
    """
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    room = _room_in_log(".".join(("semmap_log", *parts)))
    may_use = {"", room} | set(LOG_ORDER[: LOG_ORDER.index(room)])
    if room == "verification":
        may_use = {"", room}

    wrong = [
        f"line {line}: {name}"
        for line, name in _imports(path)
        if name.startswith("semmap_log.store") and _room_in_log(name) not in may_use
    ]

    assert [] == wrong


VIEWS = {"bounds", "excerpt", "plots", "report", "rerun"}
"""What is inside `views` beside single files; the last three are ways to look at a log."""
MAY_USE = {"excerpt": set[str](), "report": {"bounds", "excerpt"}, "plots": {"bounds", "excerpt"},
           "rerun": {"bounds", "excerpt"}}  # fmt: skip


@pytest.mark.parametrize(
    "path",
    [path for path in MODULES if path.relative_to(PACKAGE).parts[0] == "views"],
    ids=lambda path: str(path.relative_to(PACKAGE)),
)
def test_no_way_to_look_at_a_log_leans_on_another(path: Path) -> None:
    """
    The report needs nothing of rerun's recordings, nor plots: what they share is beside them.
    """
    room = path.relative_to(PACKAGE).with_suffix("").parts[1]
    may_use = {room} | MAY_USE.get(room, set())

    wrong = [
        f"line {line}: {name}"
        for line, name in _imports(path)
        if name.startswith("semmap_log.views.")
        and name.split(".")[2] in VIEWS
        and name.split(".")[2] not in may_use
    ]

    assert [] == wrong


PROBABILITIES_ORDER = [
    {"local_clock", "forecast"},
    {"beta", "scores", "evidence"},
    {"estimator", "chain"},
    {"methods"},
    {"estimators"},
    {"belief_fold"},
]
"""What is inside `probabilities`, in the order in which it is built on each other."""


@pytest.mark.parametrize(
    "path",
    [path for path in MODULES if path.relative_to(PACKAGE).parts[0] == "probabilities"],
    ids=lambda path: str(path.relative_to(PACKAGE)),
)
def test_inside_probabilities_imports_point_one_way_too(path: Path) -> None:
    """
    From evidence to chains to methods; evidence knows no method.
    """

    def rank(room: str) -> int:
        return next((i for i, rooms in enumerate(PROBABILITIES_ORDER) if room in rooms), -1)

    parts = path.relative_to(PACKAGE).with_suffix("").parts
    room = parts[1]

    wrong = [
        f"line {line}: {name}"
        for line, name in _imports(path)
        if name.startswith("semmap_log.probabilities.")
        and (other := name.split(".")[2]) != room
        and rank(other) >= rank(room) >= 0
    ]

    assert [] == wrong


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_third_parties_stay_at_their_edge(path: Path) -> None:
    """
    Only one room knows MCAP, one CDR, one rerun, one YAML.
    """
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")

    strangers = [
        f"line {line}: {name}"
        for line, name in _imports(path)
        if room not in EDGES.get(name.split(".")[0], {room})
    ]

    assert [] == strangers


def test_importing_the_package_loads_nothing_heavy() -> None:
    """
    `import semmap_log` alone does not even load numpy.
    """
    code = (
        "import sys, semmap_log\n"
        "heavy = ('numpy', 'yaml', 'rosbags', 'rerun', 'rich', 'pyarrow', 'pandas',"
        " 'matplotlib')\n"
        "print([name for name in heavy if name in sys.modules])"
    )

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert "[]" == done.stdout.strip()


PUBLIC = ["semmap_log", "semmap_log.beliefs", "semmap_log.costmaps", "semmap_log.events"]
"""The modules that the reference in docs/api.md is made of."""


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_module_has_all_its_names(name: str) -> None:
    """
    Every name of `__all__` is there, once, and documented; a class or function says so itself.
    """
    module = importlib.import_module(name)

    assert len(set(module.__all__)) == len(module.__all__)
    assert [] == [each for each in module.__all__ if not getattr(module, each).__doc__]


@pytest.mark.parametrize("name", ["semmap_log", "semmap_log.beliefs"])
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
    `semmap_log.beliefs.best_time` is the function: no module of the room bears a public name.
    """
    import semmap_log.beliefs

    folder = Path(semmap_log.beliefs.__file__).parent

    assert set() == {path.stem for path in folder.glob("*.py")} & set(semmap_log.beliefs.__all__)


def test_no_two_public_classes_share_a_name() -> None:
    """
    One word for one thing; the command line's are between typer and the verb.
    """
    found = Counter(
        node.name
        for path in MODULES
        if path.relative_to(PACKAGE).parts[0] != "cli"
        for node in ast.parse(path.read_text(encoding="utf-8")).body
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
        if path.relative_to(PACKAGE).parts[0] not in {"cli", "ros", "events.py"}
        and path.stem not in {"__init__", path.parent.name}
    )

    assert [] == [name for name, count in found.items() if count > 1]
