"""Who is let in: so many clients, as long as files can be opened; the others are told why not."""

from __future__ import annotations

import contextlib
import errno
import os
import resource
import socket
import sys
from collections.abc import Iterator

from semmap_log.live.planners.question_lines import write_error

AT_ONCE = 64
"""Before those that are there have their turn."""
OTHER_FILES = 200
"""Open files that are no clients: the log's, and what else the process has."""
KEPT_FILES = 64
"""No client gets these, however few the system allows: without files no question is answered."""

_NO_FILES = "the server cannot open more files; come later"


class Admission:
    """Lets clients in at a listening socket."""

    def __init__(self, listening: socket.socket, most_clients: int) -> None:
        """Allow so many files, as far as the system lets us."""
        listening.setblocking(False)
        self._listening = listening
        self._most_clients = most_clients
        self._most_files = _allow_files(most_clients + OTHER_FILES)
        self._spare: int | None = os.open(os.devnull, os.O_RDONLY)
        """Given up where no more can be opened, to tell who waits."""

    def admitted(self, present: int) -> Iterator[socket.socket]:
        """Yield who comes in now.

        Args:
            present: How many clients are there already.
        """
        for _ in range(AT_ONCE):
            try:
                connected, _ = self._listening.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno in (errno.EMFILE, errno.ENFILE):
                    self._refuse_by_spare()
                    return
                continue  # that one has gone again
            if connected.fileno() >= self._most_files:  # a new file has the lowest number there is
                _refuse(connected, _NO_FILES)
                continue
            if present >= self._most_clients:
                _refuse(connected, f"{self._most_clients:,} clients are here; come later")
                continue
            present += 1
            yield connected

    def close(self) -> None:
        """Let go of what was kept for telling."""
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None

    def _refuse_by_spare(self) -> None:
        """Tell one client that no more files can be open."""
        self.close()
        with contextlib.suppress(OSError):
            connected, _ = self._listening.accept()
            _refuse(connected, _NO_FILES)
        with contextlib.suppress(OSError):
            self._spare = os.open(os.devnull, os.O_RDONLY)


def _refuse(connected: socket.socket, problem: str) -> None:
    """Tell a client why it is not let in."""
    with connected, contextlib.suppress(OSError):
        connected.setblocking(False)
        connected.send(write_error(problem))


def _allow_files(count: int) -> int:
    """Let the process have so many files open, as far as the system lets it.

    Returns:
        How many may be open while clients are let in.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return sys.maxsize
    wanted = count if hard == resource.RLIM_INFINITY else min(count, hard)
    if soft < wanted:
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            soft = wanted
    return soft - min(KEPT_FILES, soft // 4)
