"""What a map's pixels mean as map values, by the rules of ROS's own servers, to the last bit.

A cell is 100 where the pixel is dark enough, 0 where it is light enough; what lies between is -1 in
mode `trinary` and graded in mode `scale`; in mode `raw` the pixel's byte is the cell. The servers
differ in every detail of this, so the rules go by name:

| | `noetic` | `nav2` | `nav2_humble` |
| --- | --- | --- | --- |
| of | map_server, ROS 1 | nav2_map_server since spring 2025 | nav2_map_server before |
| at a threshold | unknown, or graded | the threshold counts (free first) | unknown, or graded |
| numbers | float64 | one byte of grey, float32 | 16 bits of grey, float64 |
| colours | mean of the bytes | 0.299 R + 0.587 G + 0.114 B | mean |
| scale | 1 + 98 r, cut off: 1..99 | 100 r, rounded: 0..100 | 100 r, rounded half to even |
| raw | the byte as int8: 200 is -56 | the byte, -1 above 100 | the same |
| raw and negate | negated first | as it is | as it is |
| transparency | trinary: one more channel; scale: a graded pixel whose last byte is 0 is -1 | \
trinary, scale: not opaque is -1 | trinary: one more channel; scale: not opaque is -1 |
| 16 bits of grey | the high byte | divided by 257, cut off | all of them |

Sources: ros-planning/navigation map_server/src/image_loader.cpp (its pictures: SDL_image 1.2);
ros-navigation/navigation2 nav2_map_server/src/map_io.cpp (its pictures: GraphicsMagick with 16 bits
a channel), before and after its pull request 5071. `last byte`: noetic looks for alpha there in any
picture of more than one channel, so a graded pixel without blue is unknown; that is its rule, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from semmap_log.errors import CostmapError

RulesName = Literal["noetic", "nav2", "nav2_humble"]
Mode = Literal["trinary", "scale", "raw"]
RULES: tuple[RulesName, ...] = ("noetic", "nav2", "nav2_humble")
MODES: tuple[Mode, ...] = ("trinary", "scale", "raw")

Pixels = NDArray[np.uint8] | NDArray[np.uint16]
Cells = NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class MapRules:
    """How one map's pixels are to be read.

    Raises:
        CostmapError: The thresholds are not 0 <= free <= occupied <= 1; or they are equal in mode
            scale, where nothing lies between; or there is no such mode or server.
    """

    rules: RulesName
    mode: Mode = "trinary"
    negate: bool = False
    occupied_thresh: float = 0.65
    free_thresh: float = 0.196

    def __post_init__(self) -> None:
        if self.rules not in RULES:
            raise CostmapError(f"rules: expected one of {', '.join(RULES)}, got {self.rules!r}")
        if self.mode not in MODES:
            raise CostmapError(f"mode: expected one of {', '.join(MODES)}, got {self.mode!r}")
        if not 0 <= self.free_thresh <= self.occupied_thresh <= 1:
            raise CostmapError(
                "thresholds: expected 0 <= free_thresh <= occupied_thresh <= 1, "
                f"got {self.free_thresh} and {self.occupied_thresh}"
            )
        if self.mode == "scale" and self.free_thresh == self.occupied_thresh:
            raise CostmapError(
                "thresholds: expected free_thresh below occupied_thresh in mode scale, "
                f"got {self.free_thresh} for both"
            )

    def cells(self, pixels: Pixels, *, alpha: bool = False) -> Cells:
        """Return the map values of pixels, in the pixels' order.

        Args:
            pixels: (rows, columns) of grey, or (rows, columns, channels); uint8, or uint16 of grey.
            alpha: The last channel says how opaque a pixel is.

        Returns:
            int8, (rows, columns).
        """
        read = {"noetic": _noetic, "nav2": _nav2, "nav2_humble": _nav2_humble}[self.rules]
        return read(self, pixels, alpha=alpha)


def _noetic(rules: MapRules, pixels: Pixels, *, alpha: bool) -> Cells:
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    averaged = channels if rules.mode == "trinary" or not alpha else channels - 1
    average = np.arange(255 * averaged + 1) / averaged
    if rules.negate:
        average = 255 - average
    if rules.mode == "raw":
        return _looked_up(average.astype(np.uint8).view(np.int8), _sums(pixels, averaged))
    occupancy = (255 - average) / 255.0
    meaning, between = _strictly(rules, occupancy)
    if rules.mode == "scale":
        meaning[between] = (1 + 98 * _ratio(rules, occupancy[between])).astype(np.int8)
    sums = _sums(pixels, averaged)
    cells = _looked_up(meaning, sums)
    if rules.mode == "scale" and channels > 1:
        cells[(pixels[:, :, -1] == 0) & between[sums]] = -1
    return cells


def _nav2(rules: MapRules, pixels: Pixels, *, alpha: bool) -> Cells:
    if rules.mode == "raw":
        byte = np.arange(256)
        meaning = np.where(byte <= 100, byte, -1).astype(np.int8)
        return _looked_up(meaning, _grey_byte(pixels, alpha=alpha))
    shade = np.arange(256, dtype=np.float32) / np.float32(255)
    occupancy = shade if rules.negate else np.float32(1) - shade
    free, occupied = np.float32(rules.free_thresh), np.float32(rules.occupied_thresh)
    meaning = np.full(256, -1, np.int8)
    if rules.mode == "scale":
        between = (occupancy > free) & (occupancy < occupied)
        # The span is taken in float64, and only then made a float32.
        span = np.float32(rules.occupied_thresh - rules.free_thresh)
        graded = (occupancy[between] - free) / span * np.float32(100)
        meaning[between] = _half_away(graded).astype(np.int8)
    meaning[occupancy >= occupied] = 100
    meaning[occupancy <= free] = 0
    cells = _looked_up(meaning, _grey_byte(pixels, alpha=alpha))
    if alpha:
        cells[pixels[:, :, -1] < 255] = -1
    return cells


def _nav2_humble(rules: MapRules, pixels: Pixels, *, alpha: bool) -> Cells:
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    averaged = channels if rules.mode == "trinary" or not alpha else channels - 1
    if pixels.dtype == np.uint16:
        total = np.arange(65536) * 3.0
    else:
        total = np.arange(255 * averaged + 1) * 257.0 * (3 if averaged == 1 else 1)
    shade = total / (3 if averaged == 1 else averaged) / 65535.0
    sums = _sums(pixels, averaged)
    if rules.mode == "raw":
        byte = _half_away(shade * 255)
        return _looked_up(np.where(byte <= 100, byte, -1).astype(np.int8), sums)
    occupancy = shade if rules.negate else 1.0 - shade
    meaning, between = _strictly(rules, occupancy)
    if rules.mode == "scale":
        graded = _ratio(rules, occupancy[between]) * 100.0
        meaning[between] = np.rint(graded).astype(np.int8)
    cells = _looked_up(meaning, sums)
    if rules.mode == "scale" and alpha:
        cells[pixels[:, :, -1] < 255] = -1
    return cells


def _strictly(rules: MapRules, occupancy: NDArray[np.float64]) -> tuple[Cells, NDArray[np.bool_]]:
    """Return 100 above one threshold, 0 below the other, else -1; and where that is."""
    occupied = occupancy > rules.occupied_thresh
    free = ~occupied & (occupancy < rules.free_thresh)
    meaning = np.full(len(occupancy), -1, np.int8)
    meaning[occupied] = 100
    meaning[free] = 0
    return meaning, ~(occupied | free)


def _ratio(rules: MapRules, occupancy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far from the free to the occupied threshold."""
    return (occupancy - rules.free_thresh) / (rules.occupied_thresh - rules.free_thresh)


def _half_away(numbers: NDArray[Any]) -> NDArray[np.float64]:
    """Return what C's round() makes of numbers that are not negative: 0.5 is 1."""
    # In float64 the sum is exact for every float32; below 0.5 no float64 here comes near it.
    return np.floor(numbers.astype(np.float64) + 0.5)


def _sums(pixels: Pixels, channels: int) -> Pixels:
    if pixels.ndim == 2:
        return pixels
    sums: NDArray[np.uint16] = pixels[:, :, :channels].sum(axis=2, dtype=np.uint16)
    return sums


def _grey_byte(pixels: Pixels, *, alpha: bool) -> Pixels:
    """Return the grey of pixels, 0..255, as GraphicsMagick's GrayscaleType has it."""
    if pixels.dtype == np.uint16:
        return (pixels // 257).astype(np.uint8)
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] - alpha == 1:
        grey: Pixels = pixels[:, :, 0]
        return grey
    red, green, blue = (pixels[:, :, channel] * 257.0 for channel in range(3))
    luma = np.floor(0.299 * red + 0.587 * green + 0.114 * blue + 0.5)
    byte: Pixels = (luma // 257).astype(np.uint8)
    return byte


def _looked_up(meaning: Cells, index: Pixels) -> Cells:
    cells: Cells = meaning[index]
    return cells
