"""Servers of a log, without ROS."""

from __future__ import annotations

from pathlib import Path

import semmap_log as sl
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver


def door_server(path: Path, root: Path | None = None, **more: object) -> DoorServer:
    """Return a server of a log, which saves in `root`; `more` as for the server and its saver."""
    saver = DoorSaver(root, path, default_prob=more.pop("default_prob", None))
    return DoorServer(lambda: sl.append(path), saver, **more)


def events_in(server: DoorServer) -> int:
    """Return how many events its log has."""
    last = server.log._reader.last_commit()
    return 0 if last is None else last.last_event + 1
