"""Many logs, where they lie: sent to a store, brought back, joined, and queried at once.

May import the rooms below. Start with `shipping.py`, `join/joining_logs.py` and
`jobs/fleet_run.py`. The package can be called: `semmap_log.fleet(...)` is `jobs.fleet_run.fleet`.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _CallablePackage(ModuleType):
    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return import_module("semmap_log.fleet.jobs.fleet_run").fleet(*args, **kwargs)


sys.modules[__name__].__class__ = _CallablePackage
