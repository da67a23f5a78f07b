"""Kill the ROS server among goals, again and again: what a client was told is in the log.

    python tools/serve_kills.py ros1                    1,000 goals, some 40 servers
    python tools/serve_kills.py jazzy --goals 200

Two clients at once send goals that add doors; the server is killed (SIGKILL) at a random moment,
and the next one is sent again what nobody answered. In the end each goal has one door, and each
answer that a client ever saw is that door's number. The exit code is 1 if not.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import semmap_log as sl  # noqa: E402
from semmap_log.core.model.events import DoorAdded  # noqa: E402
from tests.live.ros.ros_world import NAMES, RosWorld, open_world  # noqa: E402
from tests.live.ros.running import Running  # noqa: E402
from tests.live.ros.serving.goals import DOOR  # noqa: E402
from tests.live.ros.stock_client import StockClient  # noqa: E402

IN_A_ROUND = 50
"""Goals that wait when a server starts: it is killed among them."""


@dataclass
class Sweep:
    """The goals, and what was said to each."""

    world: RosWorld
    log: Path
    dice: random.Random
    open: list[str]
    told: dict[str, set[int]] = field(default_factory=dict)
    kills: int = 0

    def run(self) -> list[str]:
        """Return what is wrong in the end."""
        while self.open:
            self._round()
            print(f"{self.kills} servers killed, {len(self.told)} goals answered", flush=True)
        return self._problems()

    def _round(self) -> None:
        asked = self.open[:IN_A_ROUND]
        with self.world.semmap("serve", self.log, self.world.option) as server:
            server.wait_for("serves")
            with StockClient(self.world, "one") as one, StockClient(self.world, "other") as other:
                shares = ((one, asked[::2]), (other, asked[1::2]))
                senders = [threading.Thread(target=self._send, args=each) for each in shares]
                for sender in senders:
                    sender.start()
                self._kill_among(server, senders)
                for sender in senders:
                    sender.join()
        self.open = [each for each in self.open if each not in self.told]

    def _kill_among(self, server: Running, senders: Sequence[threading.Thread]) -> None:
        """End the server once a random number of the goals are answered."""
        last = len(self.told) + self.dice.randrange(1, IN_A_ROUND)
        while len(self.told) < last and any(sender.is_alive() for sender in senders):
            time.sleep(0.001)
        server.kill()
        self.kills += 1

    def _send(self, client: StockClient, goals: list[str]) -> None:
        for goal_id in goals:
            answer = client.ask("goal", **_asked(goal_id), within=2)
            if "result" not in answer:
                return  # the server is dead: what is left comes in another round
            self.told.setdefault(goal_id, set()).add(answer["result"]["door_id"])

    def _problems(self) -> list[str]:
        log = sl.read(self.log)
        stored: dict[str, list[int]] = {}
        for commit in log.commits():
            event = log.event(commit.first_event).event
            assert isinstance(event, DoorAdded)
            stored.setdefault(commit.note.correlation, []).append(int(event.door_id))
        wrong = [
            f"{goal}: told {sorted(doors)}, the log has {stored.get(goal)}"
            for goal, doors in self.told.items()
            if stored.get(goal) != list(doors)
        ]
        ids = sorted(door for doors in stored.values() for door in doors)
        if ids != list(range(1, len(self.told) + 1)):
            wrong.append(f"{len(self.told)} goals made {len(ids)} doors")
        return wrong


def _asked(goal_id: str) -> dict[str, Any]:
    return {"name": "/lta_semantic_map/add_door", "action": "AddDoor", "values": DOOR,
            "goal_id": goal_id}  # fmt: skip


def main() -> int:
    """Run the sweep that the command line asks for."""
    parser = argparse.ArgumentParser(description="Kill the ROS server among goals.")
    parser.add_argument("leg", choices=NAMES)
    parser.add_argument("--goals", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=7)
    args = parser.parse_args()
    dice = random.Random(args.seed)
    goals = [f"{number + 1:032x}" for number in range(args.goals)]
    with tempfile.TemporaryDirectory(dir=ROOT, prefix=".kills_") as folder:
        log = Path(folder) / "log"
        sl.create(log, tz="UTC").close()
        world = open_world(args.leg)
        try:
            sweep = Sweep(world, log, dice, goals)
            wrong = sweep.run()
        finally:
            world.close()
    for line in wrong:
        print(line, file=sys.stderr)
    print(f"{args.goals} goals, {sweep.kills} servers killed: {len(wrong)} problems")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
