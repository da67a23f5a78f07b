"""The one frame of an Open-RMF building: how the drawings of its levels lie over each other.

As in Open-RMF (`rmf_building_map_tools`, `Building.calculate_level_offsets_and_scales`): the
measurements of the reference level alone give the metres of its pixels, and the fiducials that
another level has in common with it give how that one is turned, scaled and shifted. So doors lie
where Open-RMF's nav graphs and its robots' poses have them.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterator, Sequence
from itertools import combinations

from semmap_log.interop.formats.files.building_level import LevelFrame, StoreyReader
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.strict_yaml import Mapping
from semmap_log.interop.formats.parsing.yaml_values import text_of


def align_levels(
    levels: Sequence[StoreyReader], reference: StoreyReader, problems: Problems
) -> dict[int, str]:
    """Give each level its frame; return warnings about some, by their numbers.

    Args:
        levels: All levels of a building that is drawn in pixels.
        reference: The level over which the others are laid.
        problems: Notes levels whose pixels have no metres.
    """
    warnings = {}
    reference.frame = _own_frame(reference, problems)
    for level in levels:
        if level is reference:
            continue
        common = [name for name in reference.fiducials if name in level.fiducials]
        if reference.frame is not None:
            level.frame = _aligned(
                [reference.fiducials[name] for name in common],
                [level.fiducials[name] for name in common],
                scale=abs(reference.frame.turn),
            )
        if level.frame is None:
            level.frame = _own_frame(level, problems)
            if level.frame is not None and level.has_places:
                warnings[level.number] = (
                    f"level {level.storey.name}: expected two fiducials that level "
                    f"{reference.storey.name} has, too, got {len(common)}: its drawing is taken to "
                    "lie over that one with the same zero point"
                )
    return warnings


def reference_level(
    root: Mapping, readers: Sequence[StoreyReader], problems: Problems
) -> StoreyReader | None:
    """Return the level over which the others are laid: the first in the file by default."""
    by_name = {reader.storey.name: reader for reader in readers}
    node = root.entries.get("reference_level_name")
    if node is None:
        levels = root.entries["levels"]
        assert isinstance(levels, Mapping)
        return by_name[next(iter(levels.entries))]
    name = text_of(node, "reference_level_name", problems)
    if name is not None and name not in by_name:
        problems.add(
            node.line,
            f"reference_level_name: expected one of the levels {', '.join(by_name)}; "
            f"got {shown(name)}",
        )
    return by_name.get(name or "")


def _own_frame(level: StoreyReader, problems: Problems) -> LevelFrame | None:
    """Return the frame of a level by its own measurements."""
    scale = level.metres_a_pixel
    if scale is not None:
        return LevelFrame(complex(scale))
    if level.has_places and not level.has_measurements:
        problems.add(
            level.storey.node.line,
            f"level {shown(level.storey.name)}: expected a measurement, which gives the metres of "
            "a pixel, or two fiducials of the reference level, got neither; add one in "
            "traffic_editor",
        )
    return None


def _aligned(
    reference: Sequence[complex], level: Sequence[complex], *, scale: float
) -> LevelFrame | None:
    """Return how a level's drawing lies over the reference level's; None: it has too few points.

    The mean turn and the mean scale of all pairs of points, as Open-RMF takes them: not the least
    squares, which differ where points were not clicked exactly.

    Args:
        reference: Points of the reference level's drawing.
        level: The same points in the other's.
        scale: Metres of a pixel of the reference level.
    """
    pairs = [*_steps(reference, level)]
    turns = sum((one / other) / abs(one / other) for one, other in pairs)
    if not turns:
        return None
    mean_scale = sum(abs(other / one) for one, other in pairs) / len(pairs)
    turn = cmath.rect(1 / mean_scale, cmath.phase(turns))
    shift = sum(one - turn * other for one, other in zip(reference, level, strict=True))
    return LevelFrame(scale * turn, scale * shift / len(reference))


def _steps(one: Sequence[complex], other: Sequence[complex]) -> Iterator[tuple[complex, complex]]:
    """Yield from each point to each later one in both drawings, where they are two in both."""
    for (a, b), (c, d) in zip(combinations(one, 2), combinations(other, 2), strict=True):
        if a != b and c != d:
            yield b - a, d - c
