"""The flight recorder of a robot's door map.

    import semmap_log as sl

    with sl.create("office", tz="Europe/Vienna") as log:
        door = log.add_door(x=2.0, y=1.5, theta=0.0, width=0.9, state="closed", actor="survey")
        log.observe(door, "open", accuracy=0.9)

    sl.read("office").replay().doors[door].state    # <DoorState.OPEN: 1>

Names are loaded when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semmap_log.core.io.virtual_logs import register_maker
from semmap_log.core.late_answers import register_answers
from semmap_log.core.lazily import lazy_names

if TYPE_CHECKING:
    from semmap_log.analysis.sql.sql_query import sql
    from semmap_log.core.batches.event_batch import EventBatch
    from semmap_log.core.folds.projection import Projection
    from semmap_log.core.io.virtual_logs import VirtualLog
    from semmap_log.core.model.commits import Note
    from semmap_log.core.model.doors import Door, DoorId, DoorMap, DoorState, Geometry, ObjectClass
    from semmap_log.errors import SemmapError
    from semmap_log.fleet.jobs.fleet_run import fleet
    from semmap_log.fleet.join.joining_logs import join
    from semmap_log.log import Appended, DoorLog, DoorLogWriter, append, create, read

__all__ = [
    "Appended",
    "Door",
    "DoorId",
    "DoorLog",
    "DoorLogWriter",
    "DoorMap",
    "DoorState",
    "EventBatch",
    "Geometry",
    "Note",
    "ObjectClass",
    "Projection",
    "SemmapError",
    "append",
    "create",
    "fleet",
    "join",
    "read",
    "sql",
]

_HOMES = {
    "analysis.sql.sql_query": ("sql",),
    "core.batches.event_batch": ("EventBatch",),
    "core.folds.projection": ("Projection",),
    "core.model.commits": ("Note",),
    "core.model.doors": ("Door", "DoorId", "DoorMap", "DoorState", "Geometry", "ObjectClass"),
    "errors": ("SemmapError",),
    "fleet.join.joining_logs": ("join",),
    "log": ("Appended", "DoorLog", "DoorLogWriter", "append", "create", "read"),
}

_load = lazy_names(__name__, _HOMES)


def __getattr__(name: str) -> Any:
    if name == "fleet":  # a package, which can be called
        return import_module("semmap_log.fleet")
    return _load(name)


def _joined(path: Path) -> VirtualLog:
    made: VirtualLog = import_module("semmap_log.fleet.join.joining_logs").view_of_file(path)
    return made


register_maker(".join.json", _joined)
register_answers(
    {
        "html": "semmap_log.views.belief_table:html_of",
        "plot of a log": "semmap_log.views.belief_table:plot_log",
        "plot of a timeline": "semmap_log.views.belief_table:plot_timeline",
        "sql": "semmap_log.analysis.sql.sql_query:sql_of_log",
        "why": "semmap_log.analysis.beliefs.explaining:explain",
    }
)


def __dir__() -> list[str]:
    return __all__
