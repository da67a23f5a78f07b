"""Run rerun's own program as a child process, on this machine only and no longer than ours.

The viewer is a window for a person, or makes a picture without any screen.
"""

from __future__ import annotations

import os
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
from typing import Any, TypeVar

from semmap_log.core.io.disk import output_errors, replace_file
from semmap_log.errors import MissingExtraError, ViewerError

LOAD_S = 60.0
ANSWER_S = 45.0
"""A call may take rerun's own limit of 15 s on a busy machine, and is then made again."""
SETTLE_S = 20.0
"""A picture that still changes after this long is taken as it is."""
REPAINT_S = 0.5
EMPTY_S = 2.0
"""A loaded recording without a timeline for so long is taken for that of an empty log."""

T = TypeVar("T")


def open_viewer(rrd: Path, *, at_ns: int | None = None, timeline: str = "happened") -> None:
    """Show a recording in a window, until it is closed.

    Args:
        rrd: The recording.
        at_ns: Where the cursor stands at first (nanoseconds; on the timeline `event`, a number);
            None: at the end.
        timeline: The timeline to look along.

    Raises:
        MissingExtraError: rerun is not installed.
        ViewerError: There is no screen, or the viewer failed.
    """
    with window(rrd) as viewer:
        if at_ns is not None:
            viewer.wait_until_loaded()
            viewer.go_to(timeline, at_ns)
        viewer.wait_until_closed()


@contextmanager
def window(source: Path | None = None) -> Iterator[Viewer]:
    """Open a window; it is gone when the block ends.

    Args:
        source: A recording to show; None: what will be sent to it.

    Raises:
        MissingExtraError: rerun is not installed.
        ViewerError: There is no such recording.
    """
    with running(["--hide-welcome-screen", *_shown(source)], os.environ) as program:
        yield Viewer(program)


def screenshot(
    rrd: Path,
    png: Path,
    *,
    at_ns: int | None = None,
    timeline: str = "happened",
    size: tuple[int, int] = (1920, 1080),
    view: str | None = None,
) -> None:
    """Write a picture of what the viewer shows; needs no screen, but a Vulkan driver.

    Args:
        rrd: The recording.
        png: The picture; what is there is replaced.
        at_ns: The moment to show (nanoseconds; on the timeline `event`, a number); None: the end.
        timeline: The timeline to look along.
        size: Width and height in pixels.
        view: Only the view of that name, such as `Floor plan`; None: all of the window.

    Raises:
        MissingExtraError: rerun is not installed.
        ViewerError: There is no Vulkan driver, or the viewer failed.
        OutputError: The picture cannot be written.
    """
    with headless(rrd, size=size) as viewer:
        if at_ns is not None:
            viewer.go_to(timeline, at_ns)
        picture = viewer.picture(view)
    with output_errors(png):
        replace_file(png, picture)


@contextmanager
def headless(
    source: Path | str | None, *, size: tuple[int, int] = (1920, 1080), quiet: bool = True
) -> Iterator[Viewer]:
    """Run a viewer without a window; it is gone when the block ends.

    Args:
        source: A recording; or the address where another rerun hands one out; None: what will be
            sent to it.
        size: Width and height in pixels.
        quiet: No notices in the corner of the picture, which would be gone only after 10 s.

    Raises:
        MissingExtraError: rerun is not installed.
        ViewerError: There is no Vulkan driver, or the viewer failed.
    """
    width, height = size
    options = ["--headless", "--hide-welcome-screen", "--window-size", f"{width}x{height}"]
    with tempfile.TemporaryDirectory(prefix="semmap-viewer-") as home:
        # A home of its own: a picture must not depend on somebody's settings, nor change them.
        # CI keeps it from sending usage data, and from announcing so.
        own = {"XDG_CONFIG_HOME": home, "XDG_DATA_HOME": home, "XDG_RUNTIME_DIR": home, "CI": "1",
               "RUST_LOG": "error" if quiet else "info"}  # fmt: skip
        with running([*options, *_shown(source)], {**os.environ, **own}) as program:
            viewer = Viewer(program)
            if source is not None:
                viewer.wait_until_loaded()
            yield viewer


@dataclass(frozen=True, slots=True)
class Viewer:
    """A running viewer, and the connection to it."""

    program: RerunProcess

    @property
    def url(self) -> str:
        """Where recordings are sent to."""
        return self.program.url

    def wait_until_loaded(self) -> None:
        """Wait until a recording and its layout are loaded; an empty log's has no more."""
        bare_since: float | None = None

        def is_loaded() -> bool:
            nonlocal bare_since
            state = self.state()
            if not _is_laid_out(state):
                bare_since = None
                return False
            if _active(state).timelines:
                return True
            bare_since = bare_since or time.monotonic()
            return time.monotonic() - bare_since > EMPTY_S

        self.program.wait_for("load the recording", is_loaded, most_s=LOAD_S)

    def wait_until_closed(self) -> None:
        """Wait until the window is closed.

        Raises:
            ViewerError: It ended otherwise than by a person.
        """
        if self.program.process.wait() != 0:
            raise self.program.failure()

    def state(self) -> Any:
        """Return rerun's ViewerState: recordings, timelines, views with what failed in them."""
        return self.ask(lambda client: client.get_state())

    def go_to(self, timeline: str, at: int) -> None:
        """Put the cursor at a moment (nanoseconds, or a number on a sequence timeline)."""
        import numpy as np

        kinds = {each.name: each.time_type for each in _active(self.state()).timelines}
        if not kinds:
            return  # an empty log looks the same at any moment
        if timeline not in kinds:
            raise ViewerError(f"timeline {timeline!r}: expected one of {', '.join(sorted(kinds))}.")
        where: dict[str, Any] = (
            {"sequence": at}
            if kinds[timeline] == "sequence"
            else {"timestamp": np.datetime64(at, "ns")}
        )
        self.ask(lambda client: client.set_time(timeline, play_state="paused", **where))

    def show(self, view: str) -> str:
        """Maximise a view, and return its id; the part in brackets may be left out."""
        ids = {each.name: each.view_id for each in self.state().views}
        short = {name.partition(" (")[0]: view_id for name, view_id in ids.items()}
        if (view_id := ids.get(view, short.get(view))) is None:
            raise ViewerError(f"view {view!r}: expected one of {', '.join(sorted(ids))}.")
        layout = self.ask(lambda client: client.get_blueprint()).blueprint
        layout["/viewport"]["ViewportBlueprint"]["maximized"] = str(view_id)
        self.ask(lambda client: client.set_blueprint(layout, of="recording"))
        return str(view_id)

    def picture(self, view: str | None = None) -> bytes:
        """Return what is shown, as PNG: the window, or the view of that name."""
        view_id = None if view is None else self.show(view)
        # Nothing reports when all is drawn; so it is when a picture equals the one before.
        deadline = time.monotonic() + SETTLE_S
        earlier, picture = b"", b"-"
        while picture != earlier and time.monotonic() < deadline:
            time.sleep(REPAINT_S)
            earlier, picture = picture, self.ask(lambda client: client.take_screenshot(view_id))
        return picture

    def forget(self, recording_id: str) -> None:
        """Close a recording that was sent to it; ignore one that it does not have."""
        old = [each.store_id for each in self.state().recordings
               if str(each.store_id).endswith(f":{recording_id}")]  # fmt: skip
        if old:
            self.ask(lambda client: client.close(store_ids=old))

    def ask(self, question: Callable[[Any], T]) -> T:
        """Return the viewer's answer; repeat the request while it is too busy."""
        from rerun.experimental import ViewerClient

        answers: list[T] = []
        said = ""

        def asked() -> bool:
            nonlocal said
            try:
                answers.append(question(ViewerClient.connect(self.url)))
            except (OSError, RuntimeError) as error:
                said = str(error)
                return False
            return True

        try:
            self.program.wait_for("answer", asked, most_s=ANSWER_S)
        except ViewerError as error:
            if not said or self.program.has_ended():
                raise
            raise ViewerError(f"{error} Its last word: {said.splitlines()[0]}") from None
        return answers[0]


def _shown(source: Path | str | None) -> list[str]:
    """Return what is to be shown as an argument of rerun's."""
    if isinstance(source, Path) and not source.is_file():
        raise ViewerError(f"{source}: there is no such recording.")
    return [] if source is None else [str(source)]


def _active(state: Any) -> Any:
    for recording in state.recordings:
        if recording.store_id == state.active_recording:
            return recording
    return None


def _is_laid_out(state: Any) -> bool:
    return _active(state) is not None and bool(state.views) and not state.loading


LOCAL = "127.0.0.1"
"""Rerun listens on every interface by default; a building's log is nobody else's."""

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
        """Return whether it has ended: its window was closed, or it failed."""
        return self.process.poll() is not None

    def wait_for(self, what: str, done: Callable[[], bool], *, most_s: float) -> None:
        """Wait until a condition holds.

        Args:
            what: What is waited for, as the end of `The rerun viewer did not …`.
            done: Returns whether it holds.
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
        """Return whether it ends normally, now or in a moment, as when a person closes its window.

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
        """Return whether a port (default: its own) accepts connections yet."""
        with socket.socket() as probe:
            return probe.connect_ex((LOCAL, port or self.port)) == 0

    def failure(self) -> ViewerError:
        """Return why it ended, as far as its output shows."""
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
                env={**env, "TMPDIR": folder},  # what it leaves there goes with the folder
                stdin=subprocess.DEVNULL, stdout=stderr, stderr=stderr,
                start_new_session=True,  # Ctrl-C is for us; we end it when we are done with it
            )  # fmt: skip
        try:
            yield RerunProcess(process, port, log)
        finally:
            _end(process)


@contextmanager
def reserved_port() -> Iterator[int]:
    """Reserve a free port; on Linux nobody else gets it within the block.

    There it stays bound, and rerun may still listen on it, since both set SO_REUSEADDR.
    """
    with socket.socket() as holder:
        holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        holder.bind((LOCAL, 0))
        port: int = holder.getsockname()[1]
        if sys.platform != "linux":
            holder.close()
        yield port


def explained(log: str, code: int | None = None) -> ViewerError:
    """Return an error that explains rerun's own message, or else its exit code."""
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
