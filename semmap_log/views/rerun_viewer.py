"""The rerun viewer: a window for a person, or a picture without any screen."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semmap_log.errors import MissingExtraError, SemmapError
from semmap_log.log.disk import whole_file

LOCAL = "127.0.0.1"
"""Rerun listens on all interfaces unless it is told otherwise; a building's log is nobody's."""

LOAD_TIMEOUT_S = 60.0
ANSWER_TIMEOUT_S = 60.0
SETTLE_S = 1.0
POLL_S = 0.2
END_S = 10.0

NO_DRIVER = "No graphics adapter was found"


class ViewerError(SemmapError):
    """The rerun viewer did not start, or did not do what it was asked."""


def open_viewer(
    rrd: Path, *, at_ns: int | None = None, timeline: str = "happened"
) -> None:
    """Show a recording in a window, and return once it is closed.

    Args:
        rrd: The recording.
        at_ns: Where the cursor stands at first, nanoseconds; None: at the end.
        timeline: The timeline that `at_ns` is on.

    Raises:
        MissingExtraError: rerun is not installed.
        ViewerError: There is no screen, or the viewer failed.
    """
