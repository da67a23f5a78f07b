"""Compiled loops, if there are any: each has numpy code that does the same.

`tools/build_loops.py` builds them when semmap-log is installed, if there is a C compiler. Without
them everything works, but reading a whole log takes longer. The environment variable
`SEMMAP_LOG_PLAIN` turns them off: no answer may depend on them.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from semmap_log.core.loops.compiled_loops import CompiledLoops

INTERFACE = 1
"""The compiled loops must have been made for this version; older leftovers are not used."""

WITHOUT = "SEMMAP_LOG_PLAIN"
"""The environment variable: anything but "" and "0" turns the loops off."""


@cache
def compiled() -> CompiledLoops | None:
    """Return the compiled loops; None: numpy does it all."""
    if os.environ.get(WITHOUT, "0") not in {"", "0"}:
        return None
    if sys.byteorder != "little" or sys.maxsize < 2**32:
        return None  # they read the bytes of a log as the machine's own numbers
    try:
        found = import_module("semmap_log.core.loops.native")
    except ImportError:  # not built, or for another Python
        return None
    if getattr(found, "INTERFACE", None) != INTERFACE:
        return None
    return cast("CompiledLoops", found)
