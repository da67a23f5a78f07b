"""A robot for the recorder's tests: publishes what it is told, over the port of nodes.

    python talker.py VERSION [NAME] < lines

Each line of input is a JSON list: a topic, a type, whether it is latched, the message in
hexadecimal digits. It answers `sent N` once somebody subscribes to that topic and it is out, and
ends with its input.
"""

import json
import queue
import sys
import threading
import time

from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.live.ros.joining import open_node

node = open_node(int(sys.argv[1]), (sys.argv[2:] or ["talker"])[0])
lines: queue.SimpleQueue[str] = queue.SimpleQueue()
ended = threading.Event()


def read() -> None:
    publishers = {}
    for number, line in enumerate(sys.stdin):
        topic, ros_type, latched, data = json.loads(line)
        if topic not in publishers:
            publishers[topic] = node.publisher(BagTopic(topic, ros_type, is_latched=latched))
        while not publishers[topic].subscribers():
            time.sleep(0.02)
        publishers[topic].publish(bytes.fromhex(data))
        sys.stdout.write(f"sent {number}\n")
        sys.stdout.flush()
    ended.set()


threading.Thread(target=read, daemon=True).start()
node.run(ended.is_set)
node.close()
