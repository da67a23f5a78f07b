"""Many logs, where they lie: sent to a store, brought back, joined, and queried at once.

`semmap_log.fleet(...)` is `jobs.fleet_run.fleet`: the package can be called.
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
