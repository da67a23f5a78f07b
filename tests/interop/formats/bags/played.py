"""A bag read back by another program's reader, and applied as RViz applies it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from semmap_log.interop.formats.ros.door_messages import GRIDS, UPDATES


@dataclass
class Played:
    """A message as a player publishes it."""

    at_ns: int
    topic: str
    message: Any

    @property
    def cells(self) -> NDArray[np.int8]:
        """Of a whole grid or of a patch, (height, width)."""
        size = self.message.info if self.topic == GRIDS.name else self.message
        return np.asarray(self.message.data).reshape(size.height, size.width)


def played(bag: Path) -> list[Played]:
    """Return all messages of a bag, in the order in which they are played."""
    with AnyReader([bag]) as reader:
        return [
            Played(at_ns, connection.topic, reader.deserialize(data, connection.msgtype))
            for connection, at_ns, data in reader.messages()
        ]


def seen_by_rviz(messages: list[Played]) -> Iterator[tuple[int, NDArray[np.int8]]]:
    """Yield (time, cells) after each message: a grid replaces all, an update a part."""
    cells = np.empty((0, 0), np.int8)
    for each in messages:
        if each.topic == GRIDS.name:
            cells = each.cells.copy()
        elif each.topic == UPDATES.name:
            height, width = each.cells.shape
            x, y = each.message.x, each.message.y
            cells[y : y + height, x : x + width] = each.cells
        yield each.at_ns, cells
