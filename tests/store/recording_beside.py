"""A program that writes to a log as a robot does, only faster: rolls, closes, compacts and merges.

Run as `python recording_beside.py LOG SEED`. It prints the number of each event once that is
acknowledged, and ends at the end of its input.
"""

from __future__ import annotations

import random
import sys
import threading
import time
from pathlib import Path

import semmap_log as sl
from semmap_log.store.compaction import compact
from semmap_log.store.writing import segment_chain

COMMITS = 25
"""After so many a segment is full."""
PAUSE_S = 0.0005


def main(log: Path, seed: int) -> None:
    """Write until somebody says that it is enough."""
    segment_chain.ROLL_COMMITS = COMMITS
    dice, is_enough = random.Random(seed), threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), is_enough.set()), daemon=True).start()
    with sl.create(log, tz="UTC", durability="flush") as writer:
        writer.add_door()
    event = 0
    while not is_enough.is_set():
        with sl.append(log, durability="flush") as writer:
            for _ in range(dice.choice((1, 3, 40, 120))):
                writer.observe(1, dice.choice(("open", "closed")), accuracy=dice.random() / 2 + 0.5)
                event += 1
                told(event)
                time.sleep(PAUSE_S)
        if dice.random() < 0.3:
            compact(log)


def told(event: int) -> None:
    """Acknowledge an event."""
    sys.stdout.write(f"{event}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
