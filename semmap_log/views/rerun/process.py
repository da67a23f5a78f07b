"""Rerun's own program as a process of ours: on this machine only, and gone when we are done."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from semmap_log.errors import MissingExtraError, ViewerError

LOCAL = "127.0.0.1"
"""Rerun listens on every interface unless told otherwise; a building's log is nobody else's."""

POLL_S = 0.2
END_S = 10.0
GRACE_S = 2.0
"""Its port closes before it ends."""


@dataclass(frozen=True, slots=True)
class RerunProcess:
    """A rerun that runs."""

    process: subprocess.Popen[bytes]
    port: int
    """Where recordings are sent to."""
    log: Path
    """What it wrote to stderr."""

    @property
    def url(self) -> str:
        """The address of the port, as rerun writes it."""
        return f"rerun+http://{LOCAL}:{self.port}/proxy"

    def has_ended(self) -> bool:
        """Tell whether it runs no more: its window was closed, or it failed."""
        return self.process.poll() is not None

    def wait_for(self, what: str, done: Callable[[], bool], *, most_s: float) -> None:
        """Return once something is so.

        Args:
            what: What is waited for, as the end of `The rerun viewer did not …`.
            done: Tells whether it is so.
            most_s: How long to wait.

        Raises:
            ViewerError: It took longer, or the viewer ended.
        """
        deadline = time.monotonic() + most_s
        while not done():
            if self.has_ended():
                raise self.failure()
            if time.monotonic() > deadline:
                raise ViewerError(f"The rerun viewer did not {what} within {most_s:.0f} s.")
            time.sleep(POLL_S)

    def ended_well(self) -> bool:
        """Tell whether it ends by itself, now or in a moment, as when a person closes its window.

        Raises:
            ViewerError: It ended otherwise.
        """
        try:
            code = self.process.wait(GRACE_S)
        except subprocess.TimeoutExpired:
            return False
        if code != 0:
            raise self.failure()
        return True

    def is_listening(self, port: int | None = None) -> bool:
        """Tell whether a port of it (else: its own) takes connections by now."""
        with socket.socket() as probe:
            return probe.connect_ex((LOCAL, port or self.port)) == 0

    def failure(self) -> ViewerError:
        """Return why it ended, as far as it said."""
        return explained(self.log.read_text(errors="replace"), self.process.poll())


@contextmanager
def running(arguments: Sequence[str], env: Mapping[str, str]) -> Iterator[RerunProcess]:
    """Start rerun on a port of its own; end it, whatever happens.

    Raises:
        MissingExtraError: rerun is not installed.
    """
    with reserved_port() as port, tempfile.TemporaryDirectory(prefix="semmap-viewer-") as folder:
        command = [str(_binary()), "--bind", LOCAL, "--port", str(port), *arguments]
        log = Path(folder) / "viewer.log"
        with log.open("wb") as stderr:
            process = subprocess.Popen(  # noqa: S603 - rerun's own binary, with our arguments
                command,
                env={**env, "TMPDIR": folder},  # what it leaves behind there goes with the folder
                stdin=subprocess.DEVNULL, stdout=stderr, stderr=stderr,
                start_new_session=True,  # Ctrl-C is for us; we end it when we are done with it
            )  # fmt: skip
        try:
            yield RerunProcess(process, port, log)
        finally:
            _end(process)


@contextmanager
def reserved_port() -> Iterator[int]:
    """Hand out a port that nobody listens on; on Linux nobody else gets it within the block.

    There it stays bound, and rerun may listen on it all the same, as both say SO_REUSEADDR.
    """
    with socket.socket() as holder:
        holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        holder.bind((LOCAL, 0))
        port: int = holder.getsockname()[1]
        if sys.platform != "linux":
            holder.close()
        yield port


def explained(log: str, code: int | None = None) -> ViewerError:
    """Return what rerun's own words mean, or else its exit code."""
    if re.search("graphics adapter|render context", log):
        return ViewerError(
            "The rerun viewer found no graphics driver. Without a GPU, a software one will do: "
            "apt install mesa-vulkan-drivers"
        )
    if re.search("WAYLAND_DISPLAY|XOpenDisplay|DISPLAY is set", log):
        return ViewerError(
            "The rerun viewer found no screen. Look at it in a browser (--web), save the recording "
            "(--save X.rrd) and open it where there is one, or take a picture of it "
            "(--screenshot X.png)."
        )
    plain = re.sub(r"\x1b\[[0-9;]*m", "", log)
    said = [line for line in plain.splitlines() if re.search("panicked|[Ee]rror", line)]
    if said:
        return ViewerError(f"The rerun viewer ended: {said[0]}")
    if code is not None and code < 0:
        return ViewerError(f"The rerun viewer was ended by {signal.Signals(-code).name}.")
    return ViewerError(f"The rerun viewer ended: it did not say why; its exit code was {code}.")


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _binary() -> Path:
    """Return the viewer itself: the `rerun` script only starts it, and does not end with it."""
    try:
        import rerun_cli
    except ImportError:
        raise MissingExtraError("rerun-sdk", "viewer") from None
    folder = Path(rerun_cli.__file__).parent
    names = ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun")
    for binary in (folder / name for name in names):
        if binary.is_file():
            return binary
    raise ViewerError(f"{folder}: expected rerun's binary, found none; install rerun-sdk again.")
