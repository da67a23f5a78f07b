"""What the viewer makes of a recording: no complaints, and the right colours at two moments."""

from __future__ import annotations

import io
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")
from PIL import Image

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorAnnotated
from semmap_log.errors import ViewerError
from semmap_log.views.palette import DEFAULT
from semmap_log.views.rerun.process import (
    LOCAL,
    Viewer,
    explained,
    headless,
    open_viewer,
    reserved_port,
    screenshot,
)
from semmap_log.views.rerun.recording import save_rrd
from tests.conftest import SteadyClock
from tests.views.rerun.pictures import a_viewer, colours_of, has_colour, middle_of
from tests.views.rerun.some_logs import SECOND, START, small_log

pytestmark = pytest.mark.viewer

SIZE = (1280, 800)
VIEWS = {
    "Floor plan", "Costmap", "front (UTC)", "Rounds (UTC)", "Door states (UTC)", "Event log (UTC)",
}  # fmt: skip
OPEN_NS, CLOSED_NS = START + 1000 * SECOND, START + 60 * SECOND
"""When `front` is open, and when it is closed."""


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    save_rrd(small_log(folder / "log"), folder / "small.rrd")
    return folder / "small.rrd"


@pytest.fixture(scope="module")
def viewer(rrd: Path) -> Iterator[Viewer]:
    """A viewer without a window."""
    with a_viewer(rrd, size=SIZE, quiet=False) as viewer:
        yield viewer


@pytest.mark.slow
def test_the_viewer_has_nothing_to_complain_about(viewer: Viewer) -> None:
    """Every view, once shown, draws all it was given, and the viewer logs no warning of its own."""
    for name in sorted(VIEWS):
        viewer.picture(name)

    state = viewer.state()

    assert VIEWS == {view.name for view in state.views}
    assert [] == [(view.name, view.reports) for view in state.views if view.reports]
    logged = viewer.ask(lambda client: client.get_logs())
    assert [] == [
        entry.message for entry in logged
        if entry.level in {"WARN", "ERROR"} and "oftware rasterizer" not in entry.message
    ]  # fmt: skip


def test_it_opens_at_the_end_along_happened(viewer: Viewer) -> None:
    """The cursor stands at the last event: the state as it is now."""
    (recording,) = viewer.state().recordings

    (happened,) = [each for each in recording.timelines if each.name == "happened"]
    assert {"happened", "recorded", "event"} == {each.name for each in recording.timelines}
    assert ("happened", happened.end) == (recording.current_timeline, recording.current_time)


@pytest.mark.slow
def test_the_plan_shows_the_door_in_the_colour_of_its_state(viewer: Viewer) -> None:
    """Open green at one moment, closed red at another; a removed door is not drawn any more."""
    viewer.go_to("happened", CLOSED_NS)
    closed = viewer.picture("Floor plan")
    viewer.go_to("happened", OPEN_NS)
    opened = viewer.picture("Floor plan")
    viewer.go_to("happened", START + 3000 * SECOND)
    removed = viewer.picture("Floor plan")

    assert (True, False) == (has_colour(closed, DEFAULT.closed), has_colour(closed, DEFAULT.open))
    assert (False, True) == (has_colour(opened, DEFAULT.closed), has_colour(opened, DEFAULT.open))
    assert (True, False) == (
        has_colour(opened, DEFAULT.unknown),
        has_colour(removed, DEFAULT.unknown),
    )
    assert has_colour(opened, DEFAULT.wall)


@pytest.mark.slow
def test_the_cells_lie_on_the_door(viewer: Viewer) -> None:
    """The costmap's cells are where the plan shows the door."""
    for moment, colour in ((CLOSED_NS, DEFAULT.closed), (OPEN_NS, DEFAULT.open)):
        viewer.go_to("happened", moment)
        plan, cells = viewer.picture("Floor plan"), viewer.picture("Costmap")

        assert has_colour(cells, colour)
        np.testing.assert_allclose(middle_of(plan, colour), middle_of(cells, colour), atol=3)


def test_a_view_alone_has_nearly_all_of_the_picture(viewer: Viewer) -> None:
    """Whatever room it has beside the others; only the bars of the window are missing."""
    for name in ("Floor plan", "Event log (UTC)", "front"):
        with Image.open(io.BytesIO(viewer.picture(name))) as picture:
            width, height = picture.size

        assert width > 0.95 * SIZE[0], name
        assert height > 0.8 * SIZE[1], name


def test_an_unknown_view_or_timeline_is_told_with_the_known_ones(viewer: Viewer) -> None:
    """The message lists what there is."""
    with pytest.raises(ViewerError, match=r"view 'Plan': expected one of .*Floor plan"):
        viewer.picture("Plan")
    with pytest.raises(ViewerError, match="timeline 'log_time': expected one of event, happened"):
        viewer.go_to("log_time", 0)


@pytest.mark.slow
def test_a_screenshot_is_a_file_and_the_viewer_is_gone(viewer: Viewer, tmp_path: Path) -> None:
    """Names in scripts that the viewer has no letters for do not end it."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=DoorId(1), x=0, y=0, theta=0, width=1)])
        log.append([DoorAnnotated(door_id=DoorId(1), key="name", value="会議室 3/🚪\n")])
    save_rrd(sl.read(tmp_path / "log"), tmp_path / "x.rrd")

    screenshot(tmp_path / "x.rrd", tmp_path / "x.png", size=(800, 600))

    assert (600, 800, 3) == colours_of((tmp_path / "x.png").read_bytes()).shape


@pytest.mark.slow
def test_an_empty_log_is_shown_at_any_moment(viewer: Viewer, tmp_path: Path) -> None:
    """A recording without events has no timeline, and is waited for no longer than others."""
    sl.create(tmp_path / "log", tz="UTC").close()
    save_rrd(sl.read(tmp_path / "log"), tmp_path / "x.rrd")

    screenshot(tmp_path / "x.rrd", tmp_path / "x.png", at_ns=START, size=(800, 600))

    assert (600, 800, 3) == colours_of((tmp_path / "x.png").read_bytes()).shape


def test_the_viewer_ends_with_the_block(viewer: Viewer, rrd: Path) -> None:
    """An error inside leaves no viewer behind."""
    processes = []

    def fail() -> None:
        with headless(rrd, size=(640, 480)) as another:
            processes.append(another.program)
            raise RuntimeError("ours")

    with pytest.raises(RuntimeError, match="ours"):
        fail()
    assert processes[0].has_ended()


def test_a_viewer_that_was_ended_leaves_no_file(
    viewer: Viewer, rrd: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rerun has a folder of data that it only takes away itself; a signal does not let it."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    with headless(rrd, size=(640, 480)):
        assert list(tmp_path.rglob("rerun-data-*"))

    assert [] == list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it is only a port that was free")
def test_a_port_that_is_reserved_is_rerun_s_alone() -> None:
    """Who listens as rerun does may have it, another may not, so long as the block is not over."""
    with reserved_port() as port, socket.socket() as other, socket.socket() as rerun:
        rerun.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)

        with pytest.raises(OSError, match="in use"):
            other.bind((LOCAL, port))
        rerun.bind((LOCAL, port))
        rerun.listen()


def test_without_a_screen_there_is_no_window(rrd: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error says what to do instead."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)

    with pytest.raises(ViewerError, match="found no screen"):
        open_viewer(rrd)


def test_a_missing_recording_is_told_before_anything_starts(tmp_path: Path) -> None:
    """The path is named."""
    with pytest.raises(ViewerError, match=r"no\.rrd: there is no such recording"):
        screenshot(tmp_path / "no.rrd", tmp_path / "x.png")


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("thread 'main' panicked at 'No graphics adapter was found'", "apt install mesa-vulkan"),
        ("thread 'main' panicked at 'Failed to get render context'", "apt install mesa-vulkan"),
        ("neither WAYLAND_DISPLAY nor WAYLAND_SOCKET nor DISPLAY is set.", "found no screen"),
        (
            "INFO hello\\nthread 'main' panicked at 'a bug'",
            "ended: thread 'main' panicked at 'a bug'",
        ),
        ("\x1b[2mat\x1b[0m an \x1b[31merror\x1b[0m", "ended: at an error"),
        ("", "was ended by SIGKILL"),
    ],
)
def test_the_viewers_last_words_are_explained(said: str, expected: str) -> None:
    """What the viewer prints when it ends becomes one line that says what to do."""
    assert expected in str(explained(said.replace("\\n", "\n"), -signal.SIGKILL))
