"""The ROS server under load: goals a second, how long one takes, how far the door map is behind.

    python tools/experiments/serve_load.py  ROS 1, Jazzy and Kilted, 500 doors
    python tools/experiments/serve_load.py --legs ros1 --goals 1000

Stock clients add doors, one goal at a time and eight at once, to a server that syncs each goal
(`event`), one that syncs them together (`batch`), one that does not sync (`none`), and to a plain
server of thirty lines that keeps its doors in memory alone (`plain`): what ROS itself takes. It
needs what the tests of a real ROS need: `python tools/set_up_ros.py`. The exit code is 1 if a goal
did not succeed.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import semmap_log as sl  # noqa: E402
from tests.live.ros.plain_server import SERVER  # noqa: E402
from tests.live.ros.ros_world import NAMES, RosWorld, open_world  # noqa: E402
from tests.live.ros.running import Running  # noqa: E402
from tests.live.ros.serving.goals import DOOR  # noqa: E402
from tests.live.ros.stock_client import StockClient  # noqa: E402

SERVERS = ("event", "batch", "none", "plain")
AT_ONCE = (1, 8)
LAGS = 50
ELSEWHERE = "/nobody"
"""A prefix of topics that nobody publishes: this client decodes no door maps while it is timed."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table for each leg; 0: all goals succeeded."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--legs", nargs="+", default=list(NAMES), choices=list(NAMES))
    parser.add_argument("--servers", nargs="+", default=list(SERVERS), choices=SERVERS)
    parser.add_argument("--goals", type=int, default=300, help="of each measurement")
    parser.add_argument("--doors", type=int, default=500, help="in the map at the beginning")
    args = parser.parse_args(arguments)
    failed = 0
    for leg in args.legs:
        world = open_world(leg)
        print(f"{NAMES[leg]}, {args.doors} doors, {args.goals} goals each")
        print(f"{'':8}{'goals/s, p50, p99: one at a time':>36}{'eight at once':>32}"
              f"{'map behind result: p50, p99':>32}")  # fmt: skip
        try:
            for server in args.servers:
                failed += _measure(world, server, args.doors, args.goals)
        finally:
            world.close()
    return 1 if failed else 0


def _measure(world: RosWorld, server: str, doors: int, goals: int) -> int:
    """Print a server's line; return how many measurements had a goal that did not succeed."""
    with _server(world, server, doors) as prefix:
        with StockClient(world, "timed", ELSEWHERE) as client:
            asked = {"name": f"{prefix}{_action(server, 'AddDoor')}", "action": "AddDoor",
                     "values": DOOR}  # fmt: skip
            client.ask("many", count=20, at_once=1, **asked)  # all connections are there
            said = [client.ask("many", count=goals, at_once=n, **asked) for n in AT_ONCE]
        cells = [f"{goals / each['took']:6.0f}/s {_ms(each['seconds'])}" for each in said]
        lags = "" if server == "plain" else _lags(world, prefix)
    print(f"{server:8}{cells[0]:>36}{cells[1]:>32}{lags:>32}", flush=True)
    return sum(each["statuses"] != ["SUCCEEDED"] for each in said)


def _lags(world: RosWorld, prefix: str) -> str:
    """Return how long after an update's result a subscriber has the map that shows it."""
    with StockClient(world, "watching") as client:
        name = f"{prefix}{_action('event', 'UpdateDoor')}"
        client.ask("lag", name=name, width=0.8)
        return _ms([client.ask("lag", name=name, width=1 + i / 100)["seconds"]
                    for i in range(LAGS)])  # fmt: skip


@contextmanager
def _server(world: RosWorld, server: str, doors: int) -> Iterator[str]:
    """Run a server; yield what stands before the names of its actions."""
    with tempfile.TemporaryDirectory(dir=".", prefix=".serve_load_") as name:
        running = _plain(world, doors) if server == "plain" else _ours(
            world, Path(name).absolute() / "log", server, doors
        )  # fmt: skip
        with running:
            running.wait_for("serves|ready")
            yield "/"
            running.stop(signal.SIGTERM)


def _ours(world: RosWorld, log: Path, durability: str, doors: int) -> Running:
    with sl.create(log, tz="UTC") as opened:
        for i in range(doors):
            opened.add_door(x=float(i % 50), y=float(i // 50), theta=0.0, width=0.9,
                            prob_open=0.5, prob_closed=0.5)  # fmt: skip
    return world.semmap("serve", log, world.option, "--durability", durability)


def _plain(world: RosWorld, doors: int) -> Running:
    entry = "msg.DoorEntry" if world.version == 1 else "DoorEntry"
    filling = f"for each in range(1, {doors + 1}): doors[each] = {entry}(door_id=each)\n"
    before, marker, behind = SERVER[world.version].partition("def serve(")
    return world.code(before + filling + marker + behind)


def _action(server: str, action: str) -> str:
    if server == "plain":
        return f"plain/{action}"
    return {"AddDoor": "lta_semantic_map/add_door",
            "UpdateDoor": "lta_semantic_map/update_door"}[action]  # fmt: skip


def _ms(seconds: Sequence[float]) -> str:
    ordered = sorted(seconds)
    half, most = (1e3 * ordered[int(share * (len(ordered) - 1))] for share in (0.5, 0.99))
    return f"{half:6.1f} {most:7.1f} ms"


if __name__ == "__main__":
    sys.exit(main())
