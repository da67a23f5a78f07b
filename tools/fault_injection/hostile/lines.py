"""Lines of JSON and questions that are deep, long, or contain numbers without end."""

from __future__ import annotations

import random
from pathlib import Path

DEPTHS = (1_000, 20_000, 300_000)
MANY = 200_000


def json_bomb(path: Path, dice: random.Random) -> str:
    """Write lines of JSON that are deep, long, or hold numbers without end."""
    depth = dice.choice(DEPTHS)
    good = '{"kind": "DoorObserved", "door": "front", "state": "OPEN"}\n'
    lines = {
        f"{depth} lists in each other": "[" * depth + "]" * depth,
        f"{depth} objects in each other": '{"a":' * depth + "1" + "}" * depth,
        "a number of 3 million digits": '{"kind": "DoorObserved", "door": ' + "9" * 3_000_000 + "}",
        "a number that is too large": '{"kind": "DoorObserved", "door_id": 1, "accuracy": 1e999}',
        "a line of 60 MB": '{"kind": "' + "x" * 60_000_000 + '"}',
        "a million keys": "{" + ",".join(f'"{i}":1' for i in range(10**6)) + "}",
        "many keys, the last one twice": (
            "{" + ",".join(f'"{i}":0' for i in [*range(MANY), MANY - 1]) + "}"
        ),
        "NaN": '{"kind": "RobotPose", "x": NaN, "y": Infinity, "theta": 0}',
        "a lone surrogate": '{"kind": "DoorObserved", "door": "\\ud800", "state": "OPEN"}',
        "60 MB without an end": "x" * 60_000_000,
        "nulls": "\0" * 1_000_000,
    }
    what = dice.choice(list(lines))
    path.write_text(good + lines[what] + dice.choice(("\n", "")) + dice.choice(("", good)))
    return f"JSON with {what}"


def _keys(count: int) -> str:
    names = [*range(count), count - 1]
    return ",".join(f'"k{name}":0' for name in names)


def ask_line(dice: random.Random) -> tuple[bytes, str]:
    """Return a line for a server of questions, and what it is."""
    lines = {
        "NEXT_DOOR with 9,000 doors": "NEXT_DOOR " + "DOOR_1 " * 9000,
        "8,180 keys, the last one twice": "{" + _keys(8_180) + "}",
        "3,000 questions in each other": "BELIEVED " * 3000 + "DOORS" + " AT now" * 3000,
        "60,000 opening brackets": "[" * 60_000,
        "a JSON line of deep objects": '{"a":' * 12_000,
        "a number of 60,000 digits": "BEST_TIME " + "9" * 60_000,
        "a line of 100 MB": "x" * 100_000_000,
        "60,000 quotes": "NEXT_DOOR " + '"' * 60_000,
        "a moment far away": "STATE 1 AT 2261-01-01",
        "a moment long ago": "STATE 1 AT @1",
    }
    what = dice.choice(list(lines))
    return f"{lines[what]}\n".encode(), what
