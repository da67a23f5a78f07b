"""What the stock clients of both ROS share: what they have seen, and how they are asked."""

import json
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

WITHIN_S = 60
MEET_S = 5
"""A client finds its server within that, or the server is dead."""

DB = "/lta_semantic_map_door_db"

seen = {}
arrived = {}
news = threading.Condition()


def say(text):
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def keep(topic, summary):
    """Return what takes a topic's messages, and notes what matters of each."""

    def take(message):
        with news:
            arrived[topic] = time.monotonic()
            seen.setdefault(topic, []).append(summary(message))
            news.notify_all()

    return take


def doors(message):
    return [[e.door_id, e.door_state, e.pos_x, e.width, e.prob_open] for e in message.door_db]


def closed(message):
    return sum(cell == 100 for cell in message.data)


def places(message):
    poses = (pose.position for pose in message.poses)
    return [message.header.frame_id, *([round(at.x, 2), round(at.y, 2)] for at in poses)]


def many(goal, count, at_once, **asked):
    """Return the seconds of each goal, from sending it to its result, and of all together."""

    def one(_):
        begin = time.monotonic()
        status = goal(**asked)["status"]
        return time.monotonic() - begin, status

    begin = time.monotonic()
    with ThreadPoolExecutor(at_once) as threads:
        done = list(threads.map(one, range(count)))
    statuses = sorted({status for _, status in done})
    took = time.monotonic() - begin
    return {"seconds": [each for each, _ in done], "statuses": statuses, "took": took}


def lag(goal, name, width):
    """Return how long after the result of an update the door map shows it, in seconds."""
    values = {"door_id": 1, "change_width": True, "width": width}
    status = goal(name, "UpdateDoor", values)["status"]
    answered = time.monotonic()
    with news:
        there = news.wait_for(lambda: seen.get(DB) and seen[DB][-1][0][3] == width, WITHIN_S)
        return {"status": status, "there": bool(there), "seconds": arrived[DB] - answered}


def wait(topic, wanted):
    with news:
        there = news.wait_for(lambda: (seen.get(topic) or [None])[-1] == wanted, WITHIN_S)
        return {"there": there, "seen": seen.get(topic, [])[-5:]}


def serve(goal):
    """Answer what is asked, a line of JSON each, until there is no more."""
    answers = {
        "goal": goal,
        "many": lambda **asked: many(goal, **asked),
        "lag": lambda **asked: lag(goal, **asked),
        "wait": wait,
    }
    say("ready")
    for line in sys.stdin:
        asked = json.loads(line)
        say(json.dumps(answers[asked.pop("do")](**asked)))
