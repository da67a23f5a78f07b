"""Texts that are deep, endless or expand: YAML, JSON lines, CSV, maps."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

from fault_injection.hostile.packed import gzip_of

DEPTHS = (1_000, 20_000, 300_000)
MANY = 200_000


def yaml_bomb(path: Path, dice: random.Random) -> str:
    """Write a YAML document that is deep, or expands."""
    ways: list[Callable[[random.Random], tuple[str, str]]] = [
        _deep_flow, _deep_block, _laughs, _long_number, _many_keys, _merges, _anchors_to_themselves,
    ]  # fmt: skip
    what, text = dice.choice(ways)(dice)
    path.write_text(text)
    return what


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


def gzip_bomb(path: Path, dice: random.Random) -> str:
    """Write packed lines: one without an end, or very many."""
    kind = "csv" if ".csv" in path.name else "jsonl"
    head = b"timestamp,door,state\n" if kind == "csv" else b""
    what, block, mib = dice.choice((
        ("zeros", bytes(2**20), 512),
        ("one line", b"x" * 2**20, 512),
        ("empty lines", b"\n" * 2**20, 64),
        ("bad lines", b"0\n" * 2**19, 15),
        ("commas", b"," * 2**20, 64),
    ))  # fmt: skip
    path.write_bytes(gzip_of(head, 1) + gzip_of(block, mib))
    return f"{mib} MiB of {what}, packed"


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


def csv_bomb(path: Path, dice: random.Random) -> str:
    """Write a CSV with a huge field, very many columns, or odd numbers."""
    fields = {
        "a field of 30 MB": "2026-03-01T12:00:00Z," + "x" * 30_000_000 + ",open",
        "a quote without an end": '2026-03-01T12:00:00Z,"' + "x\n" * 3_000_000,
        "a million columns": ",".join(["a"] * 10**6),
        "a time of a million digits": "9" * 10**6 + ",front,open",
        "a time far away": "99999999999999999999,front,open",
        "nulls": "\0" * 10**6,
    }
    what = dice.choice(list(fields))
    path.write_text(f"timestamp,door,state\n{fields[what]}\n")
    return f"a CSV with {what}"


def picture_bomb(path: Path, dice: random.Random) -> str:
    """Write a map for `--map` whose picture says that it is huge."""
    width = dice.choice((2**15, 2**20, 2**31 - 1))
    picture = path.with_suffix(".pgm")
    head = dice.choice(
        (f"P5\n{width} {width}\n255\n", f"P5 {width} 1 255\n", f"P2\n{width} 9\n1\n")
    )
    picture.write_bytes(head.encode() + bytes(1000))
    resolution = dice.choice(("0.05", "1e-300", "1e300", "0", "-1", ".nan"))
    path.write_text(
        f"image: {picture.name}\nresolution: {resolution}\norigin: [0, 0, 0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    return f"a picture that says {head.split(chr(10), 2)[:2]}, resolution {resolution}"


def _deep_flow(dice: random.Random) -> tuple[str, str]:
    depth = dice.choice(DEPTHS)
    return f"YAML with {depth} lists in each other", "a: " + "[" * depth + "]" * depth + "\n"


def _deep_block(dice: random.Random) -> tuple[str, str]:
    depth = dice.choice(DEPTHS[:1])
    return f"YAML {depth} levels deep", "".join(f"{' ' * i}a:\n" for i in range(depth)) + "\n"


def _laughs(dice: random.Random) -> tuple[str, str]:
    levels = dice.choice((5, 9, 30))
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, levels)]
    return f"YAML that expands tenfold {levels} times", "\n".join(
        [*lines, f"doors: *a{levels - 1}"]
    )


def _long_number(dice: random.Random) -> tuple[str, str]:
    digits = dice.choice((5_000, 3_000_000))
    return f"YAML with a number of {digits} digits", "door_0:\n  id: " + "9" * digits + "\n"


def _many_keys(_: random.Random) -> tuple[str, str]:
    return f"YAML with {MANY // 10} keys", "\n".join(f"door_{i}: {i}" for i in range(MANY // 10))


def _merges(dice: random.Random) -> tuple[str, str]:
    levels = dice.choice((10, 25))
    lines = ["m0: &m0 {a: 1}"]
    lines += [f"m{i}: &m{i}\n  <<: [*m{i - 1}, *m{i - 1}]" for i in range(1, levels)]
    return f"YAML that merges twofold {levels} times", "\n".join(lines) + "\n"


def _anchors_to_themselves(_: random.Random) -> tuple[str, str]:
    return "YAML that holds itself", "doors: &a [*a]\nlevels: &b {L1: *b}\n"
