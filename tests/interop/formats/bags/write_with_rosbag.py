"""Writes a bag with ROS 1's own library; run by the Python that has it, not by the tests'.

    python3 write_with_rosbag.py OUT.bag none|bz2|lz4 < messages.json

Each message is a list: topic, type (`std_msgs/Bool`), its bytes as hexadecimal digits, the text of
the type, its md5 sum, the time in ns.
"""

import json
import sys

import genpy
import rosbag

out, compression = sys.argv[1:]
with rosbag.Bag(out, "w", compression=compression, chunk_threshold=2000) as bag:
    for topic, kind, data, text, md5, at_ns in json.load(sys.stdin):
        known = type("Known", (), {"_type": kind, "_full_text": text, "_md5sum": md5})
        at = genpy.Time(at_ns // 10**9, at_ns % 10**9)
        header = {
            "topic": topic,
            "type": kind,
            "md5sum": md5,
            "message_definition": text,
            "callerid": "/talker",
        }
        bag.write(
            topic,
            (kind, bytes.fromhex(data), md5, 0, known),
            at,
            raw=True,
            connection_header=header,
        )
