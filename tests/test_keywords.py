"""No call of the Python API swallows a keyword that it does not know."""

from __future__ import annotations

import ast
import inspect
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from batch_columns import MODULE, written

import semmap_log as sl
from semmap_log.analysis.planning.round_planner import patrol_plan
from semmap_log.core.batches.columnar_events import ColumnConstructor
from semmap_log.core.messages import OBJECT_KINDS
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import KINDS, DoorObserved, DoorPassed, defaults_of, field_names
from semmap_log.errors import (
    InvalidEventError,
    MomentError,
    UnknownDoorError,
    UnknownKeywordError,
)
from tests.conftest import SteadyClock

UNKNOWN = "acuracy_of_nothing"


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (lambda log: log.observe(1, "open", acuracy=0.9), "did you mean 'accuracy'"),
        (lambda log: log.to_arrow(colums=["door_id"]), "colums"),
        (lambda log: patrol_plan(log, rums=["1"]), "rums"),
        (lambda log: log.pin("noon", actr="me"), "did you mean 'actor'"),
        (lambda log: sl.append(log.path, durabilty="none"), "did you mean 'durability'"),
        (lambda log: sl.create(log.path / "new", buildng="x"), "did you mean 'building'"),
    ],
)
def test_a_keyword_that_many_calls_share_is_named_where_it_was_meant(
    call: Callable[[Any], object], expected: str, tmp_path: Path
) -> None:
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        before = log.replay().event

        with pytest.raises(TypeError, match=expected):
            call(log)

        assert before == log.replay().event


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
    "semmap_log.core.batches.columnar_events.of": "asks the kind for its fields",
    "semmap_log.views.plots.figures.new_figure": "matplotlib's own, which refuses others",
    "semmap_log.interop.formats.ros.ros_types.new": "a message's fields, which its class knows",
    "semmap_log.core.arrow.scanned_table.scanner": "DuckDB's own, which says more than is wanted",
    "semmap_log.log.door_log.queries.sql": "names of logs, as whoever asks calls them",
    "semmap_log.analysis.sql.sql_query.sql": "names of logs, as whoever asks calls them",
    "semmap_log.fleet.__call__": "passes all on to `fleet_run.fleet`, which knows its keywords",
}
"""Functions outside the command line that take any keyword, and why nothing is swallowed."""


def test_nothing_else_takes_any_keyword() -> None:
    """
    Whoever adds `**` to a function looks here, and says who refuses the wrong ones. Keywords that
    are those of a `TypedDict` are looked at above.
    """
    package = Path(sl.__file__).parent
    found = set()
    for module in pkgutil.walk_packages([str(package)], "semmap_log."):
        path = package.parent / Path(*module.name.split("."))
        path = path / "__init__.py" if module.ispkg else path.with_suffix(".py")
        if ".cli" in module.name or not path.exists():  # what is compiled has no such functions
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            any_of = node.args.kwarg if isinstance(node, ast.FunctionDef) else None
            if any_of is not None and "Unpack[" not in ast.unparse(any_of):
                found.add(f"{module.name}.{node.name}")

    assert found == TAKE_ANY.keys()


def test_the_columns_spelt_out_are_the_fields_of_the_events() -> None:
    """
    For each kind a signature: its fields, those without a default required. Else:
    python tools/batch_columns.py.
    """
    assert written() == MODULE.read_text(encoding="utf-8")
    source = ast.parse(Path(inspect.getfile(ColumnConstructor)).read_text())
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
        assert all({1} == log.timelines(alone).keys() for alone in ("front", 1))
        with pytest.raises(UnknownDoorError, match="frnt"):
            list(log.history("frnt"))
        with pytest.raises(UnknownDoorError, match="frnt"):
            list(log.batches(doors=["frnt"]))
