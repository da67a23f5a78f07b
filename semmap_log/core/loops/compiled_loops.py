"""The signatures of the compiled loops; `native.pyx` states what each does."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]


class CompiledLoops(Protocol):
    """The functions of the compiled module."""

    INTERFACE: int
    DAMAGED: int
    TOO_MANY: int

    def scan(
        self,
        records: bytes | memoryview,
        starts: Integers,
        ends: Integers,
        first_event: int,
        kind_of: NDArray[np.uint8],
        bit_of: NDArray[np.uint32],
        length_of: Integers,
        is_about: NDArray[np.uint8],
        offset: Integers,
        place: Integers,
        number: Integers,
        kind: NDArray[np.uint8],
        happened: Integers,
        recorded: Integers,
        door: NDArray[np.uint32],
        messages_before: Integers,
        kinds: NDArray[np.uint32],
        least: Integers,
        greatest: Integers,
    ) -> tuple[int, int, bool]:
        """Walk the message records of chunks, and take their events apart into columns."""
        ...

    def gather(
        self,
        records: bytes | memoryview,
        offsets: Integers,
        ahead: int,
        places: Integers,
        size: int,
        into: NDArray[np.uint8],
    ) -> bool:
        """Copy structs at any offsets into one array."""
        ...

    def sort_places(self, kinds: NDArray[np.uint8], places: Integers, ends: Integers) -> None:
        """Sort places by their kinds."""
        ...

    def are_numbered(self, numbers: Integers, firsts: Integers, ends: Integers) -> bool:
        """Return whether numbers are those from each of `firsts` to before each of `ends`."""
        ...

    def keep_greatest(self, kept: Integers, rows: Integers, values: Integers) -> None:
        """Let each row keep the greatest value that was written to it."""
        ...

    def settle(
        self,
        positions: Integers,
        rows: Integers,
        happened: Integers,
        numbers: Integers,
        kept_ns: Integers,
        kept_number: Integers,
        scratch: Integers,
        won: Integers,
    ) -> int:
        """Let each row of a register keep the write with the greatest stamp."""
        ...
