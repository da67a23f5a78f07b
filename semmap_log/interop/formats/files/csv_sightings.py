"""The rows of a door CSV as columns: few in memory, many in a temporary file without a name."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.doors import DoorState
from semmap_log.errors import OutputError

MOST_IN_MEMORY_BYTES = 16 * 2**20
"""Some 800,000 rows; what is more waits in a temporary file, so that memory stays flat."""


class Sighting(NamedTuple):
    """What a door was at an instant."""

    happened_ns: int
    door: str
    """Its name, as in the file."""
    state: DoorState
    accuracy: float
    """NaN: an update, not a sighting."""


class Rows(NamedTuple):
    """Some rows, one after the other."""

    door: NDArray[np.uint32]
    """Which of the file's doors."""
    happened_ns: NDArray[np.int64]
    state: NDArray[np.uint8]
    accuracy: NDArray[np.float64] | None
    """NaN: an update, not a sighting; None: all are."""


class SightingColumns:
    """Rows that are added block by block, and can then be gone through again and again."""

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(MOST_IN_MEMORY_BYTES)  # noqa: SIM115 - lives long
        self._blocks: list[tuple[int, bool]] = []
        """How many rows each has, and whether accuracies."""
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def __del__(self) -> None:
        self._file.close()

    def add(
        self,
        door: NDArray[np.int64],
        happened_ns: NDArray[np.int64],
        state: NDArray[np.uint8],
        accuracy: NDArray[np.float64] | None,
    ) -> None:
        """Keep some more rows.

        Raises:
            OutputError: There is no room for them in the folder of temporary files.
        """
        columns: list[NDArray[Any]] = [door.astype(np.uint32), happened_ns, state]
        if accuracy is not None:
            columns.append(accuracy)
        try:
            for column in columns:
                self._file.write(column.tobytes())
        except OSError as error:
            raise OutputError(
                f"{tempfile.gettempdir()}: no room for the rows of the file while they are checked "
                f"({error.strerror}); set TMPDIR to a folder that has some."
            ) from error
        self._blocks.append((len(door), accuracy is not None))
        self._length += len(door)

    def parts(self) -> Iterator[Rows]:
        """Yield the rows, some at a time, in the order in which they were added."""
        at = 0
        for count, has_accuracy in self._blocks:
            self._file.seek(at)
            size = count * (21 if has_accuracy else 13)
            data = self._file.read(size)
            at += size
            yield Rows(
                np.frombuffer(data, np.uint32, count),
                np.frombuffer(data, np.int64, count, 4 * count),
                np.frombuffer(data, np.uint8, count, 12 * count),
                np.frombuffer(data, np.float64, count, 13 * count) if has_accuracy else None,
            )


@dataclass(frozen=True, slots=True)
class Sightings:
    """The rows of a file, with those that its windows add, each door's in order of time."""

    path: Path
    doors: tuple[str, ...]
    """Names, in order of their first rows."""
    columns: SightingColumns
    rows_in_file: int
    """The others say what windows do: UNKNOWN at an end, the last state at a start."""
    warnings: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    """What of the file is not read, in words."""

    def __len__(self) -> int:
        return len(self.columns)

    def __iter__(self) -> Iterator[Sighting]:
        """Yield the rows one by one."""
        for rows in self.columns.parts():
            doors, times, states = (column.tolist() for column in rows[:3])
            accuracies = accuracies_of(rows).tolist()
            for door, ns, state, accuracy in zip(doors, times, states, accuracies, strict=True):
                yield Sighting(ns, self.doors[door], DoorState(state), accuracy)

    @property
    def happened_ns(self) -> NDArray[np.int64]:
        """When each row happened, all in memory."""
        return np.concatenate([np.empty(0, np.int64), *(r[1] for r in self.columns.parts())])

    @property
    def state(self) -> NDArray[np.uint8]:
        """The state of each row, all in memory."""
        return np.concatenate([np.empty(0, np.uint8), *(r[2] for r in self.columns.parts())])

    @property
    def accuracy(self) -> NDArray[np.float64]:
        """The accuracy of each row, all in memory; NaN: an update, not a sighting."""
        return np.concatenate([np.empty(0), *map(accuracies_of, self.columns.parts())])

    def by_door(self) -> dict[str, tuple[NDArray[np.int64], NDArray[np.uint8]]]:
        """Return (times, states) of each door's rows, in order of time, all in memory."""
        parts = list(self.columns.parts())
        doors = np.concatenate([np.empty(0, np.uint32), *(part.door for part in parts)])
        times, states = self.happened_ns, self.state
        return {
            name: (times[doors == index], states[doors == index])
            for index, name in enumerate(self.doors)
        }


def accuracies_of(rows: Rows) -> NDArray[np.float64]:
    """Return the accuracy of each row, NaN where there is none."""
    return np.full(len(rows.door), np.nan) if rows.accuracy is None else rows.accuracy
