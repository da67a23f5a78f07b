"""The set-up of Dask's workers on this machine."""

from __future__ import annotations

import signal

from semmap_log.core.io.object_source import keep_at_most

KEPT_BYTES = 2**22
"""Of objects in memory; few are needed, since a log is queried once."""


def dask_setup(worker: object) -> None:  # noqa: ARG001  Dask calls it by this name
    """Leave Ctrl-C, which a terminal sends to all processes, to the run; keep little in memory."""
    keep_at_most(KEPT_BYTES)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
