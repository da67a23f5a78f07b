"""The rerun viewer: a window for a person, or a picture without any screen."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from semmap_log.errors import MissingExtraError, SemmapError
from semmap_log.log.disk import replace_file

LOCAL = "127.0.0.1"
"""Rerun listens on every interface unless told otherwise; a building's log is nobody else's."""

START_S = 60.0
LOAD_S = 60.0
ANSWER_S = 45.0
"""A call may take rerun's own limit of 15 s on a busy machine, and is then made again."""
SETTLE_S = 20.0
"""A picture that still changes after this long is taken as it is."""
REPAINT_S = 0.5
POLL_S = 0.2
END_S = 10.0

T = TypeVar("T")


class ViewerError(SemmapError):
    """The rerun viewer did not start, or did not do what it was asked for."""


def open_viewer(rrd: Path, *, at_ns: int | None = None, timeline: str = "happened") -> None:
    """Show a recording in a window; return when it is closed.

    Args:
        rrd: The recording.
        at_ns: Where the cursor stands at first (nanoseconds; on the timeline `event`, a number);
            None: at the end.
        timeline: The timeline to look along.

    Raises:
        MissingExtraError: rerun is not installed.
        ViewerError: There is no screen, or the viewer failed.
    """
    with _running(rrd, ["--hide-welcome-screen"], os.environ) as viewer:
        if at_ns is not None:
            viewer.wait_until_loaded()
            viewer.go_to(timeline, at_ns)
        if viewer.process.wait() != 0:
            raise viewer.failure()


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
        SemmapError: The picture cannot be written.
    """
    with headless(rrd, size=size) as viewer:
        if at_ns is not None:
            viewer.go_to(timeline, at_ns)
        picture = viewer.picture(view)
    try:
        replace_file(png, picture)
    except OSError as error:
        raise SemmapError(f"{png}: cannot be written: {error.strerror or error}.") from None


@contextmanager
def headless(
    rrd: Path, *, size: tuple[int, int] = (1920, 1080), quiet: bool = True
) -> Iterator[Viewer]:
    """Run a viewer without a window on a recording; it is gone when the block ends.

    Args:
        rrd: The recording.
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
        with _running(rrd, options, {**os.environ, **own}) as viewer:
            viewer.wait_until_loaded()
            yield viewer


@dataclass(frozen=True, slots=True)
class Viewer:
    """A viewer that runs, and the line to it."""

    process: subprocess.Popen[bytes]
    url: str
    log: Path
    """What the viewer wrote to stderr."""

    def wait_until_loaded(self) -> None:
        """Return once the recording and its layout are there."""
        self._until(LOAD_S, "did not load the recording", lambda: _is_loaded(self.state()))

    def state(self) -> Any:
        """Return rerun's ViewerState: recordings, timelines, views with what failed in them."""
        return self.ask(lambda client: client.get_state())

    def go_to(self, timeline: str, at: int) -> None:
        """Put the cursor at a moment (nanoseconds, or a number on a sequence timeline)."""
        import numpy as np

        kinds = {each.name: each.time_type for each in _active(self.state()).timelines}
        if timeline not in kinds:
            raise ViewerError(f"timeline {timeline!r}: expected one of {', '.join(sorted(kinds))}.")
        where: dict[str, Any] = (
            {"sequence": at}
            if kinds[timeline] == "sequence"
            else {"timestamp": np.datetime64(at, "ns")}
        )
        self.ask(lambda client: client.set_time(timeline, play_state="paused", **where))

    def show(self, view: str) -> str:
        """Bring a view to the front of its tabs, and return its id."""
        ids = {each.name: each.view_id for each in self.state().views}
        if view not in ids:
            raise ViewerError(f"view {view!r}: expected one of {', '.join(sorted(ids))}.")
        layout = self.ask(lambda client: client.get_blueprint()).blueprint
        for part in layout.values():
            container = part.get("ContainerBlueprint", {})
            if "active_tab" in container and f"view/{ids[view]}" in container["contents"]:
                container["active_tab"] = f"view/{ids[view]}"
        self.ask(lambda client: client.set_blueprint(layout, of="recording"))
        return str(ids[view])

    def picture(self, view: str | None = None) -> bytes:
        """Return what is shown, as PNG: the window, or the view of that name."""
        view_id = None if view is None else self.show(view)
        # Nothing tells when all is drawn; so it is when a picture is the same as the one before.
        deadline = time.monotonic() + SETTLE_S
        earlier, picture = b"", b"-"
        while picture != earlier and time.monotonic() < deadline:
            time.sleep(REPAINT_S)
            earlier, picture = picture, self.ask(lambda client: client.take_screenshot(view_id))
        return picture

    def ask(self, question: Callable[[Any], T]) -> T:
        """Return the viewer's answer; ask again while it is too busy to give one."""
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
            self._until(ANSWER_S, "did not answer", asked)
        except ViewerError as error:
            if not said:
                raise
            raise ViewerError(f"{error} Its last word: {said.splitlines()[0]}") from None
        return answers[0]

    def failure(self) -> ViewerError:
        """Return why the viewer ended, as far as it said."""
        return explained(self.log.read_text(errors="replace"))

    def _until(self, most_s: float, problem: str, done: Callable[[], bool]) -> None:
        deadline = time.monotonic() + most_s
        while not done():
            if self.process.poll() is not None:
                raise self.failure()
            if time.monotonic() > deadline:
                raise ViewerError(f"The rerun viewer {problem} within {most_s:.0f} s.")
            time.sleep(POLL_S)


@contextmanager
def _running(rrd: Path, options: list[str], env: Mapping[str, str]) -> Iterator[Viewer]:
    """Start a viewer on a port of its own; end it, whatever happens."""
    if not rrd.is_file():
        raise ViewerError(f"{rrd}: there is no such recording.")
    port = _free_port()
    command = [str(_binary()), *options, "--bind", LOCAL, "--port", str(port), str(rrd)]
    with tempfile.TemporaryDirectory(prefix="semmap-viewer-") as folder:
        log = Path(folder) / "viewer.log"
        with log.open("wb") as stderr:
            process = subprocess.Popen(  # noqa: S603 - rerun's own binary, with our arguments
                command,
                env=dict(env), stdin=subprocess.DEVNULL, stdout=stderr, stderr=stderr,
            )  # fmt: skip
        try:
            yield Viewer(process, f"rerun+http://{LOCAL}:{port}/proxy", log)
        finally:
            _end(process)


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


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOCAL, 0))
        port: int = probe.getsockname()[1]
        return port


def _active(state: Any) -> Any:
    for recording in state.recordings:
        if recording.store_id == state.active_recording:
            return recording
    return None


def _is_loaded(state: Any) -> bool:
    active = _active(state)
    return active is not None and bool(active.timelines and state.views) and not state.loading


def explained(log: str) -> ViewerError:
    """Return what the viewer's own words mean."""
    if re.search("graphics adapter|render context", log):
        return ViewerError(
            "The rerun viewer found no graphics driver. Without a GPU, a software one will do: "
            "apt install mesa-vulkan-drivers"
        )
    if re.search("WAYLAND_DISPLAY|XOpenDisplay|DISPLAY is set", log):
        return ViewerError(
            "The rerun viewer found no screen. Save the recording (--save X.rrd) and open it "
            "where there is one, or take a picture of it (--screenshot X.png)."
        )
    said = [line for line in log.splitlines() if re.search("panicked|[Ee]rror", line)]
    return ViewerError(f"The rerun viewer ended: {said[0] if said else 'it did not say why'}")
