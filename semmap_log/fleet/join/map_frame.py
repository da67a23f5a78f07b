"""Where a robot's map lies in the building, as the command line takes it."""

from __future__ import annotations

from semmap_log.core.model.rigid_transform import EXPECTED, RigidTransform
from semmap_log.errors import LogError


def frame_of(text: str) -> tuple[str, RigidTransform]:
    """Return a log's name, and the transform to the building's frame, of `log=dx,dy,theta`.

    Raises:
        LogError: It is none.
    """
    name, _, numbers = text.rpartition("=")
    try:
        if name:
            return name, RigidTransform.parse(numbers)
    except LogError:
        if _are_numbers(numbers):  # and one of them is not finite
            raise
    raise LogError(f"{text!r}: expected LOG={EXPECTED}, such as tug2=12.5,-3,1.5708.")


def _are_numbers(text: str) -> bool:
    try:
        return len([float(number) for number in text.split(",")]) == 3
    except ValueError:
        return False
