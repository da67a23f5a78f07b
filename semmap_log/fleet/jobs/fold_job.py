"""The job of a projection that somebody has written: its state of each log."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, ClassVar

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.folds.projection import Dumping, Mergeable, Projection, name_of, version_of
from semmap_log.errors import EngineError
from semmap_log.fleet.jobs.job import Holds, Told
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.replay.plain_state import dump_plain, load_plain

PART_EVENTS = 500_000


@dataclass(frozen=True, slots=True)
class FoldJob:
    """A projection's state of each log: plain values and numpy arrays, or what it dumps itself."""

    projection: Projection[Any]

    name: ClassVar[str] = "fold"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (pa.field("state", pa.binary(), nullable=False),)

    def parameters(self) -> str:
        """Return whose it is, and its version: see `Projection`."""
        cls = type(self.projection)
        return f"{cls.__module__}:{name_of(self.projection)} {version_of(self.projection)}"

    def ask(self, log: DoorLog) -> Told:
        """Return one row."""
        return Told({"state": [self.dump(log.fold(self.projection))]})

    def parts(self, events: int) -> int:
        """Return how many ranges of events are folded apart: one, if it cannot merge them."""
        can_merge = isinstance(self.projection, Mergeable)
        return max(1, -(-events // PART_EVENTS)) if can_merge else 1

    def ask_part(self, log: DoorLog, part: int, parts: int, last_event: int) -> bytes:
        """Return the state of one range of events."""
        first, behind = ((last_event + 1) * n // parts for n in (part, part + 1))
        state = log.fold_part(self.projection, first, behind - 1, known_event=last_event)
        return self.dump(state)

    def joined(self, answers: Sequence[bytes]) -> Told:
        """Return the state of all ranges, merged in their order."""
        assert isinstance(self.projection, Mergeable)
        state, *later = (self.load(answer) for answer in answers)
        for each in later:
            state = self.projection.merge(state, each)
        return Told({"state": [self.dump(state)]})

    def dump(self, state: Any) -> bytes:
        """Return a state as bytes.

        Raises:
            CheckpointError: It is none that can be.
        """
        if isinstance(self.projection, Dumping):
            return self.projection.dump(state)
        return dump_plain(state)

    def load(self, data: bytes) -> Any:
        """Return the state of these bytes."""
        if isinstance(self.projection, Dumping):
            return self.projection.load(data)
        return load_plain(data)


def projection_of(target: str) -> Projection[Any]:
    """Return a projection of a name such as `openings:Openings`; modules of this folder, too.

    Raises:
        EngineError: There is none, or it is no projection.
    """
    module, colon, name = target.partition(":")
    if not (module and colon and name):
        raise EngineError(f"--fold {target}: expected module:Class, such as openings:Openings.")
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        found = getattr(import_module(module), name)
        projection: Projection[Any] = found() if isinstance(found, type) else found
    except (ImportError, AttributeError, TypeError) as error:
        raise EngineError(f"--fold {target}: cannot be had: {error}.") from None
    missing = [each for each in ("initial", "apply") if not callable(getattr(projection, each, 0))]
    if missing:
        raise EngineError(
            f"--fold {target}: expected a projection, which has initial() and apply(state, batch); "
            f"got a {type(projection).__name__} without {' and '.join(missing)}."
        )
    return projection
