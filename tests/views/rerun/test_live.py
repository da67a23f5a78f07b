"""A log that is followed in the viewer: what comes is shown, as if it had always been there."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

from rerun.experimental import ViewerClient

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import RobotPose
from semmap_log.views.palette import COLOUR_BLIND, DEFAULT, Rgb
from semmap_log.views.rerun.live_view import LiveViewOptions, follow_in_viewer
from semmap_log.views.rerun.process import Viewer
from tests.views.rerun.pictures import a_viewer, has_colour
from tests.views.rerun.some_logs import room

pytestmark = pytest.mark.viewer

SIZE = (800, 600)
ARRIVES_S = 120.0
"""On a machine that has much else to do, and draws without a graphics card; an idle one takes
0.3 s, and draws for half a second."""


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[sl.DoorLogWriter]:
    """A room with one door, closed, and another process's hand on the log."""
    with sl.create(tmp_path / "room", tz="UTC") as log:
        log.append([room()])
        log.add_door(x=-1.0, y=0.0, theta=0.0, width=2.0, state="closed", name="front")
        yield log


@contextmanager
def _followed(log: sl.DoorLogWriter, *, is_empty: bool = False, **shown: Any) -> Iterator[Viewer]:
    """A viewer that follows the log, from a thread of its own."""
    is_over, failed = threading.Event(), []
    with a_viewer(None, size=SIZE, quiet=False) as viewer:

        def follow() -> None:
            try:
                follow_in_viewer(
                    sl.read(log.path), viewer.url, LiveViewOptions(**{"beliefs": False, **shown}),
                    stop=is_over.is_set, forget=viewer.forget,
                )  # fmt: skip
            except BaseException as error:
                failed.append(error)
                raise

        thread = threading.Thread(target=follow)
        thread.start()
        try:
            if not is_empty:
                viewer.wait_until_loaded()
            yield viewer
            assert [] == failed
        finally:
            is_over.set()
            thread.join(100)


def _becomes(viewer: Viewer, colour: Rgb, *, gone: Rgb | None = None, view: str) -> None:
    """Return once the view has a colour, and another one not any more."""
    deadline = time.monotonic() + ARRIVES_S
    while time.monotonic() < deadline:
        picture = _picture(viewer, view)
        if picture and has_colour(picture, colour) and not (gone and has_colour(picture, gone)):
            return
    pytest.fail(f"{colour} did not come into {view!r} within {ARRIVES_S:.0f} s")


def _picture(viewer: Viewer, view: str) -> bytes | None:
    """Return what a view shows at this moment; None: it is being replaced."""
    ids = {each.name: each.view_id for each in viewer.state().views}
    try:
        client = ViewerClient.connect(viewer.url)
        return client.take_screenshot(ids[view]) if view in ids else None
    except (OSError, RuntimeError):
        return None


def _at_event(viewer: Viewer, number: int) -> Any:
    """Return the viewer's only recording, once it ends with an event, and the cursor is there."""
    deadline = time.monotonic() + ARRIVES_S
    while time.monotonic() < deadline:
        recordings = viewer.state().recordings
        ends = [{t.name: t.end for t in each.timelines} for each in recordings]
        if [number] == [each.get("event") for each in ends]:
            (only,) = recordings
            if only.current_time == ends[0].get(only.current_timeline):
                return only
        time.sleep(0.1)
    return pytest.fail(f"no recording to event {number} was alone within {ARRIVES_S:.0f} s")


@pytest.mark.slow
def test_what_is_seen_is_shown(writer: sl.DoorLogWriter) -> None:
    """A sighting soon turns the door green on the plan and on the costmap."""
    with _followed(writer) as viewer:
        _becomes(viewer, DEFAULT.closed, view="Floor plan")
        number = writer.observe(DoorId(1), "open").first_event
        _becomes(viewer, DEFAULT.open, gone=DEFAULT.closed, view="Floor plan")
        viewer.show("Costmap")
        _becomes(viewer, DEFAULT.open, gone=DEFAULT.closed, view="Costmap")
        recording = _at_event(viewer, number)
        state = viewer.state()

    timelines = {each.name: each for each in recording.timelines}
    assert timelines["event"].end == number
    assert recording.current_time == timelines["happened"].end
    assert [] == [(each.name, each.reports) for each in state.views if each.reports]


@pytest.mark.slow
def test_colours_are_those_asked_for(writer: sl.DoorLogWriter) -> None:
    """Of another palette, from the first row on."""
    with _followed(writer, palette=COLOUR_BLIND) as viewer:
        _becomes(viewer, COLOUR_BLIND.closed, view="Floor plan")
        writer.observe(DoorId(1), "open")
        _becomes(viewer, COLOUR_BLIND.open, gone=COLOUR_BLIND.closed, view="Floor plan")


@pytest.mark.slow
def test_a_new_door_appears_with_its_name(writer: sl.DoorLogWriter) -> None:
    """The history is sent anew, and the recording before it is gone."""
    with _followed(writer) as viewer:
        _becomes(viewer, DEFAULT.closed, view="Floor plan")
        writer.add_door(x=-1.0, y=2.0, theta=0.0, width=2.0, state="open", name="back")
        *_, commit = sl.read(writer.path).commits()
        _becomes(viewer, DEFAULT.open, view="Floor plan")
        recording = _at_event(viewer, commit.last_event)
        paths = {
            each.entity_path for each in viewer.ask(lambda c: c.get_recording_schema()).entities
        }

    assert str(recording.store_id).endswith(f":{sl.read(writer.path).info.log_id}-1")
    assert {"/map/doors/front", "/map/doors/back"} <= paths


@pytest.mark.slow
def test_a_late_event_takes_its_place(writer: sl.DoorLogWriter) -> None:
    """What happened before the last sighting does not change the door's state of now."""
    with _followed(writer) as viewer:
        writer.observe(DoorId(1), "open")
        _becomes(viewer, DEFAULT.open, gone=DEFAULT.closed, view="Floor plan")
        seen_ns = sl.read(writer.path).event(3).happened_ns
        number = writer.observe(DoorId(1), "closed", at=seen_ns - 1).first_event
        _at_event(viewer, number)
        _becomes(viewer, DEFAULT.open, gone=DEFAULT.closed, view="Floor plan")


def test_what_is_retracted_is_gone(writer: sl.DoorLogWriter) -> None:
    """The door shows again what it did before."""
    with _followed(writer) as viewer:
        number = writer.observe(DoorId(1), "open").first_event
        _becomes(viewer, DEFAULT.open, gone=DEFAULT.closed, view="Floor plan")
        writer.retract(number)
        _becomes(viewer, DEFAULT.closed, gone=DEFAULT.open, view="Floor plan")


@pytest.mark.slow
def test_a_robot_that_explores_stays_on_the_plan(tmp_path: Path) -> None:
    """Without walls the plan reaches as far as anything was, and grows."""
    with sl.create(tmp_path / "field", tz="UTC") as log:
        log.robot_pose(RobotPose(x=0.0, y=0.0, theta=0.0))
        with _followed(log) as viewer:
            _becomes(viewer, DEFAULT.robot, view="Floor plan")
            log.robot_pose(RobotPose(x=40.0, y=0.0, theta=0.0))
            log.robot_pose(RobotPose(x=41.0, y=0.0, theta=0.0))
            _at_event(viewer, 2)
            _becomes(viewer, DEFAULT.robot, view="Floor plan")


@pytest.mark.slow
def test_an_empty_log_fills(tmp_path: Path) -> None:
    """There is a viewer with nothing to see, then a door."""
    with sl.create(tmp_path / "new", tz="UTC") as log, _followed(log, is_empty=True) as viewer:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, state="closed")
        _becomes(viewer, DEFAULT.closed, view="Floor plan")
