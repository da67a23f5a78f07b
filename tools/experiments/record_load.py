"""The recorder under load: a sensor that speaks a thousand times a second, in a real ROS.

    python tools/experiments/record_load.py  ROS 1 and Jazzy, durability event and batch
    python tools/experiments/record_load.py --legs ros1 --rate 2000 --messages 20000

It needs what the tests of a real ROS need: `python tools/set_up_ros.py`. The exit code is 1 if a
message was lost.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import semmap_log as sl  # noqa: E402
from semmap_log.core.model.events import DoorObserved  # noqa: E402
from tests.live.ros.ros_world import RosWorld, open_world  # noqa: E402

MAPPING = """
topics:
  /front/contact: {read: sensor, door: front, states: {open: true, closed: false}}
repeats: 0
"""

_SENSOR = """
import sys, time
count, rate = int(sys.argv[1]), float(sys.argv[2])
while not listeners():
    time.sleep(0.02)
begun = time.monotonic()
for number in range(count):
    publish(number % 2 == 0)
    time.sleep(max(0.0, begun + (number + 1) / rate - time.monotonic()))
print(time.monotonic() - begun, flush=True)
time.sleep(1)
"""

SENSOR = {
    1: """
import rospy
from std_msgs.msg import Bool
rospy.init_node("sensor")
publisher = rospy.Publisher("/front/contact", Bool, queue_size=10_000)
listeners, publish = publisher.get_num_connections, publisher.publish
""" + _SENSOR,
    2: """
import rclpy
from std_msgs.msg import Bool
rclpy.init()
publisher = rclpy.create_node("sensor").create_publisher(Bool, "/front/contact", 1000)
listeners = publisher.get_subscription_count
publish = lambda is_open: publisher.publish(Bool(data=is_open))
""" + _SENSOR,
}  # fmt: skip
"""By the version of ROS."""


def main() -> int:
    """Print a line for each leg and durability; 0: nothing was lost."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--legs", nargs="+", default=["ros1", "jazzy"])
    parser.add_argument("--durability", nargs="+", default=["event", "batch"])
    parser.add_argument("--messages", type=int, default=10_000)
    parser.add_argument("--rate", type=float, default=1000.0)
    args = parser.parse_args()
    lost = 0
    for leg in args.legs:
        world = open_world(leg)
        try:
            for durability in args.durability:
                lost += _measure(world, durability, args.messages, args.rate)
        finally:
            world.close()
    return 1 if lost else 0


def _measure(world: RosWorld, durability: str, messages: int, rate: float) -> int:
    """Return how many messages are not in the log."""
    with tempfile.TemporaryDirectory(dir=".", prefix=".record_load_") as name:
        log, mapping = Path(name).absolute() / "log", Path(name).absolute() / "mapping.yaml"
        mapping.write_text(MAPPING)
        with sl.create(log, tz="UTC") as opened:
            opened.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="front")
        recorder = world.semmap(
            "record", log, world.option, "--mapping", mapping, "--durability", durability
        )
        with recorder:
            sensor = world.code(SENSOR[world.version], messages, rate)
            recorder.wait_for("recording")
            before_s = _cpu_s(recorder.process.pid)
            took_s = float(sensor.finish(timeout_s=60 + 2 * messages / rate))
            used_s = _cpu_s(recorder.process.pid) - before_s
            recorder.stop()
        stored = sum(isinstance(entry.event, DoorObserved) for entry in sl.read(log).history())
    print(f"{world.leg}, {durability}: {messages:,} messages at {messages / took_s:,.0f}/s, "
          f"{messages - stored} lost, {used_s / took_s:.0%} of a core")  # fmt: skip
    return messages - stored


def _cpu_s(pid: int) -> float:
    """Return the processor time of a process so far, seconds."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    sys.exit(main())
