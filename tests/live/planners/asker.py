"""An oracle that is asked line by line, without a socket."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import semmap_log as sl
from semmap_log.errors import SemmapError
from semmap_log.live.planners.oracle import Oracle
from semmap_log.live.planners.question_lines import LineError, read_line, write_answer, write_error
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver
from semmap_log.live.ros.serving.yaml_start import DoorFollower

CLIENT = "pid 7"


class Asker:
    """A log, its oracle, and what was said of actions that were refused."""

    def __init__(
        self, path: Path, *, clock: Any = None, is_read_only: bool = False, **more: object
    ) -> None:
        self.said: list[str] = []
        changes: list[Callable[[], None]] = []

        def changed() -> None:
            for each in changes:
                each()

        keywords = {} if clock is None else {"clock": clock}
        self.doors: Any = (
            DoorFollower(path, changed=changed, poll_s=0.001)
            if is_read_only
            else DoorServer(
                lambda: sl.append(path, **keywords), DoorSaver(None, path), changed=changed
            )
        )
        clock_ns = (lambda: 0) if is_read_only else self.doors.log.now_ns
        self.oracle = Oracle(self.doors, say=self.said.append, **{"clock_ns": clock_ns, **more})
        changes.append(self.oracle.refresh)

    def __call__(self, text: str) -> str:
        """Return the line that answers a line."""
        try:
            line = read_line(text.encode())
        except LineError as error:
            said = write_error(str(error), is_json=error.is_json, given_id=error.given_id)
            return self._one_line(said)
        try:
            return self._one_line(write_answer(line, self.oracle.answer(line.asked, CLIENT)))
        except SemmapError as error:
            said = write_error(str(error), is_json=line.is_json, given_id=line.given_id)
            return self._one_line(said)

    def json(self, name: str, *words: object, **more: object) -> Any:
        """Return the answer in JSON to a question in JSON."""
        return json.loads(self(json.dumps({"ask": name, "args": words, **more})))

    @staticmethod
    def _one_line(said: bytes) -> str:
        assert said.endswith(b"\n")
        assert said.count(b"\n") == 1
        return said.decode()[:-1]

    def close(self) -> None:
        self.doors.close()
