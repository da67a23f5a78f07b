"""What Dask's workers of this machine are told first: Ctrl-C is the run's business, not theirs."""

from __future__ import annotations

import signal


def dask_setup(worker: object) -> None:  # noqa: ARG001  Dask calls it by this name
    """Let whoever started the worker end it: a terminal sends Ctrl-C to all processes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
