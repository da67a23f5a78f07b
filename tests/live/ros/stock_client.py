"""A client of the thesis's server in another process, of rospy or rclpy and nothing of ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running, wait_until

CLIENTS = Path(__file__).parent / "clients"
DB = "/lta_semantic_map_door_db"
PLAN = "/semmap/patrol_plan"


class StockClient:
    """Asks for goals, and tells what it has seen on the topics."""

    def __init__(self, ros: RosWorld, name: str, prefix: str = "") -> None:
        script = CLIENTS / f"ros{ros.version}_client.py"
        self.running: Running = ros.python(script, name, prefix)
        self._lines = 1

    def __enter__(self) -> StockClient:  # noqa: PYI034 - Self came with Python 3.11
        self.running.wait_for("^ready")
        return self

    def __exit__(self, *_: object) -> None:
        self.running.__exit__(*_)

    def goal(
        self, action: str, goal_id: str | None = None, *, name: str = "", **values: Any
    ) -> dict[str, Any]:
        snake = {"AddDoor": "add_door", "UpdateDoor": "update_door", "RemoveDoor": "remove_door",
                 "SaveDoorDB": "save_door_db"}[action]  # fmt: skip
        server = name or f"/lta_semantic_map/{snake}"
        return self.ask("goal", name=server, action=action, values=values, goal_id=goal_id)

    def wait(self, topic: str, wanted: Any) -> None:
        """Return once the last message of a topic, summarized, is that."""
        answer = self.ask("wait", topic=topic, wanted=wanted)
        assert answer["there"], f"{topic}: expected {wanted}, got {answer['seen']}"

    def ask(self, do: str, **values: Any) -> dict[str, Any]:
        self.send(do, **values)
        return self.answer()

    def send(self, do: str, **values: Any) -> None:
        self.running.write(json.dumps({"do": do, **values}) + "\n")

    def answer(self) -> dict[str, Any]:
        line = self._lines
        wait_until(
            lambda: self.running.output.count("\n") > line or self.running.is_over,
            lambda: f"an answer of {self.running}",
        )
        assert not self.running.is_over, f"it ended: {self.running}"
        self._lines += 1
        answer: dict[str, Any] = json.loads(self.running.output.splitlines()[line])
        return answer
