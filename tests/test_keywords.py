"""No call of the Python API swallows a keyword that it does not know."""

from __future__ import annotations

import ast
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from batch_columns import MODULE, written

import semmap_log as sl
from semmap_log.analysis.beliefs.applying import apply_probabilities
from semmap_log.analysis.beliefs.best_times import best_time
from semmap_log.analysis.beliefs.door_beliefs import learn, probabilities, typical_weeks
from semmap_log.analysis.beliefs.evaluation import evaluate
from semmap_log.analysis.beliefs.protocol import Patrol, Protocol
from semmap_log.analysis.beliefs.sensor_calibration import calibrate
from semmap_log.analysis.costmaps import costmap_at
from semmap_log.analysis.costmaps.level_costmap import CostmapOptions
from semmap_log.analysis.planning.round_planner import begun_round, patrol_plan
from semmap_log.core.batches.taken_columns import MadeOfColumns
from semmap_log.core.messages import OBJECT_KINDS
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import KINDS, DoorObserved, DoorPassed, defaults_of, field_names
from semmap_log.errors import (
    InvalidEventError,
    MomentError,
    UnknownDoorError,
    UnknownKeywordError,
)
from semmap_log.fleet.jobs.fleet_run import fleet
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.exporting.stream import StreamOptions
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.live.ros.player import PlayOptions
from semmap_log.live.ros.serving.server import ServeOptions
from semmap_log.log.door_log.queries import LogTables
from tests.conftest import SteadyClock

UNKNOWN = "acuracy_of_nothing"

WRITTEN_WITH = (sl.DoorLog, sl.DoorLogWriter, sl.EventBatch, sl.Note)
OPTIONS = (CostmapOptions, ImportOptions, PlayOptions, ServeOptions, StreamOptions, Protocol,
           Patrol)  # fmt: skip
FUNCTIONS = (
    sl.create, sl.append, sl.read, import_file, export, probabilities, apply_probabilities,
    best_time, typical_weeks, evaluate, calibrate, learn, costmap_at, patrol_plan, begun_round,
    fleet,
)  # fmt: skip


def _public_calls() -> Iterator[tuple[str, Callable[..., Any]]]:
    for function in FUNCTIONS:
        yield function.__name__, function
    for cls in (*WRITTEN_WITH, *OPTIONS):
        yield cls.__name__, cls
    for cls in (*WRITTEN_WITH, LogTables):  # which is a part of a log, and made by nobody
        for name, member in vars(cls).items():
            call = getattr(member, "__func__", member)
            if not name.startswith("_") and inspect.isfunction(call):
                yield f"{cls.__name__}.{name}", call


CALLS = dict(_public_calls())


@pytest.mark.parametrize("name", CALLS)
def test_an_unknown_keyword_is_refused_by_a_word_on_the_known_ones(name: str) -> None:
    """
    Before anything else is looked at: what was meant is not done in part.
    """
    parameters = inspect.signature(CALLS[name]).parameters.values()
    known = {p.name for p in parameters if p.kind is not p.VAR_POSITIONAL} - {"self", "cls"}

    with pytest.raises(UnknownKeywordError if known else TypeError, match=UNKNOWN) as error:
        CALLS[name](**{UNKNOWN: 1})

    told = str(error.value).rpartition("expected some of ")[2]
    assert not known or known == {word.strip(".,") for word in told.split()}


@pytest.mark.parametrize("name", CALLS)
def test_a_call_says_what_it_takes(name: str) -> None:
    """
    Each parameter by its name and type, so that editors and type checkers know.
    """
    parameters = list(inspect.signature(CALLS[name]).parameters.values())

    assert [] == [p.name for p in parameters if p.kind is inspect.Parameter.VAR_KEYWORD]
    assert [] == [
        p.name for p in parameters
        if p.annotation is inspect.Parameter.empty and p.name not in ("self", "cls")
    ]  # fmt: skip


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.kind not in OBJECT_KINDS])
def test_a_batch_names_the_columns_of_its_kind(kind: type[Any]) -> None:
    """
    They are the kind's fields, which a signature cannot tell for all kinds at once.
    """
    with pytest.raises(UnknownKeywordError) as error:
        sl.EventBatch.of(kind, **{UNKNOWN: [1]})

    assert {"happened_ns", *field_names(kind)} <= {w.strip(".,") for w in str(error.value).split()}


@pytest.mark.parametrize("kind", KINDS)
def test_events_refuse_what_they_do_not_know(kind: type[Any]) -> None:
    """
    As Python does it.
    """
    with pytest.raises(TypeError, match=UNKNOWN):
        kind(**{UNKNOWN: 1})


TAKE_ANY = {
    "semmap_log.core.model.keywords.checked": "asks for unknown ones first",
    "semmap_log.core.batches.taken_columns.of": "asks the kind for its fields",
    "semmap_log.views.plots.figures.new_figure": "matplotlib's own, which refuses others",
    "semmap_log.interop.formats.ros.ros_types.new": "a message's fields, which its class knows",
    "semmap_log.core.arrow.scanned_table.scanner": "DuckDB's own, which says more than is wanted",
    "semmap_log.log.door_log.queries.sql": "names of logs, as whoever asks calls them",
    "semmap_log.analysis.sql.sql_query.sql": "names of logs, as whoever asks calls them",
    "semmap_log.fleet.__call__": "hands all on to `fleet_run.fleet`, which is looked at above",
}
"""Functions outside the command line that take any keyword, and why nothing is swallowed."""


def test_nothing_else_takes_any_keyword() -> None:
    """
    Whoever adds `**` to a function looks here, and says who refuses the wrong ones. Keywords that
    are told of a `TypedDict` are refused by the calls that are looked at above.
    """
    looked_at = {f"{call.__module__}.{call.__name__}" for call in CALLS.values()}
    package = Path(sl.__file__).parent
    found = set()
    for module in pkgutil.walk_packages([str(package)], "semmap_log."):
        path = package.parent / Path(*module.name.split("."))
        path = path / "__init__.py" if module.ispkg else path.with_suffix(".py")
        if ".cli" in module.name or not path.exists():  # what is compiled has no such functions
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and node.args.kwarg is not None:
                name = f"{module.name}.{node.name}"
                if name not in looked_at or "Unpack[" not in ast.unparse(node.args.kwarg):
                    found.add(name)

    assert found == TAKE_ANY.keys()


def test_the_columns_spelt_out_are_the_fields_of_the_events() -> None:
    """
    For each kind a signature: its fields, those without a default required. Else:
    python tools/batch_columns.py.
    """
    assert written() == MODULE.read_text(encoding="utf-8")
    source = ast.parse(Path(inspect.getfile(MadeOfColumns)).read_text())
    spelt: dict[str, dict[str, bool]] = {}
    for node in ast.walk(source):
        if isinstance(node, ast.FunctionDef) and node.name == "of" and node.args.kwarg is None:
            kind = ast.unparse(node.args.args[1].annotation).removeprefix("type[").rstrip("]")
            spelt[kind] = {
                a.arg: default is None
                for a, default in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
                if a.arg != "happened_ns"
            }

    assert spelt == {
        kind.__name__: {name: name not in defaults_of(kind) for name in field_names(kind)}
        for kind in KINDS
        if kind.kind not in OBJECT_KINDS
    }


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda log: log.observe(1, True), "state: expected one of UNKNOWN OPEN .* got True"),
        (lambda log: log.observe(1, False), "state: expected one of UNKNOWN OPEN .* got False"),
        (lambda log: log.observe(1, 1.0), "state: expected one of UNKNOWN OPEN .* got 1.0"),
        (lambda log: log.observe(True, "open"), "door: expected an id, a name, or .* got True"),
        (lambda log: log.observe(1.0, "open"), "door: expected an id, a name, or .* got 1.0"),
        (lambda log: log.observe(1, "open", accuracy=True), "accuracy_open: expected a number"),
        (lambda log: log.observe(1, "open", accuracy="0.9"), "accuracy_open: expected a number"),
        (lambda log: log.observe(1, "open", accuracy=0.4), "expected a number from 0.5 to 1"),
        (lambda log: log.observe(1, "open", accuracy=90), "expected a number from 0.5 to 1"),
        (lambda log: log.observe(1, "open", opening=True), "opening: expected a number, got True"),
        (lambda log: log.observe(1, "open", at=1.7e9), "whole nanoseconds since 1970"),
        (lambda log: log.observe(1, "open", at=True), "whole nanoseconds since 1970"),
        (lambda log: log.passed(1, passed="no"), "passed: expected True or False, got 'no'"),
        (lambda log: log.passed(1, passed=0), "passed: expected True or False, got 0"),
        (lambda log: log.add_door(prob_open=True), "prob_open: expected a number, got True"),
        (lambda log: log.add_door(x="1", y=2, theta=0, width=1), "x: expected a number, got '1'"),
        (lambda log: log.add_door(level=True), "level: expected a whole number"),
        (lambda log: log.add_door(door_id=True), "door_id: expected a whole number"),
        (lambda log: log.update_door(1, width="1"), "width: expected a number, got '1'"),
        (lambda log: log.update_door(True, width=1), "door: expected an id"),
        (lambda log: log.replay(at=0.5), "whole nanoseconds since 1970"),
        (lambda log: log.timeline(True), "door: expected an id"),
        (lambda log: log.replay(event=True), "event True: expected a whole number"),
        (lambda log: log.replay(event="0"), "event '0': expected a whole number"),
        (lambda log: log.observe(1, "open", expected_event=False), "expected_event: expected"),
        (lambda log: log.observe(1, "open", command_id="a" * 16), "command_id: expected 16 bytes"),
    ],
)  # fmt: skip
def test_a_value_of_another_kind_is_refused(
    call: Callable[[Any], object], message: str, tmp_path: Path
) -> None:
    """
    Python counts True as 1, and seconds are no nanoseconds: none is stored as what it is not.
    """
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        before = log.replay().event

        with pytest.raises((InvalidEventError, MomentError), match=message):
            call(log)

        assert before == log.replay().event


def test_numbers_of_numpy_are_numbers(tmp_path: Path, clock: SteadyClock) -> None:
    """
    Ids, states, times and values come out of arrays, too.
    """
    np = pytest.importorskip("numpy")
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.add_door(at=5)
        log.observe(np.uint32(1), np.uint8(1), accuracy=np.float32(0.75), at=np.int64(9))
        log.passed(np.int64(1), passed=np.bool_(True))
        seen, through = log.history(kinds=[DoorObserved, DoorPassed])

    assert (DoorState.OPEN, 0.75, 9) == (seen.event.state, seen.event.accuracy_open,
                                         seen.happened_ns)  # fmt: skip
    assert through.event.passed


def test_doors_are_named_where_many_are_asked_about(tmp_path: Path) -> None:
    """
    A name found nothing, in silence, where an id was meant.
    """
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="front")
        log.observe("front", "open")

        assert 3 == len(list(log.history("front")))
        assert 3 == sum(map(len, log.batches(doors=["front"])))
        assert {1} == log.timelines(["front"]).keys()
        with pytest.raises(UnknownDoorError, match="frnt"):
            list(log.history("frnt"))
        with pytest.raises(UnknownDoorError, match="frnt"):
            list(log.batches(doors=["frnt"]))
