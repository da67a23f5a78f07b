"""A map's picture as the pixels that a server sees: each has its own library to read it with.

noetic's map_server sees what SDL_image 1.2 makes of a file: eight bits a channel, and of a picture
with a palette the numbers of the colours instead of the colours, which is rarely what was meant.
Nav2 sees what GraphicsMagick makes of it: colours, and up to 16 bits of grey.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.map_rules import Pixels, RulesName

if TYPE_CHECKING:
    from PIL.Image import Image

PICTURE_FORMATS = ("PPM", "PNG", "BMP", "JPEG", "TIFF", "GIF")
"""Pillow knows more, some of which start other programs."""
NOETIC_FORMATS = ("PPM", "PNG", "JPEG")
"""Of the others SDL makes surfaces that depend on how they were packed."""
MOST_PIXELS = 100_000_000
PIXELS_A_STRIP = 2_000_000
"""So that what is made on the way stays small beside a large picture."""


@dataclass(frozen=True, slots=True)
class DecodedPicture:
    """A decoded picture, handed out as its rows of pixels, the top row first."""

    width: int
    height: int
    alpha: bool
    """The last channel says how opaque a pixel is."""
    _rows: Callable[[int, int], Pixels]

    def strips(self) -> Iterator[tuple[int, Pixels]]:
        """Yield (first row, pixels of some rows): see `MapRules.cells`."""
        rows = max(1, PIXELS_A_STRIP // self.width)
        for top in range(0, self.height, rows):
            yield top, self._rows(top, min(self.height, top + rows))


def read_picture(file: BinaryIO, rules: RulesName) -> DecodedPicture:
    """Return the picture in a file as a server with those rules sees it.

    Raises:
        ValueError: It is no picture, too large, or of a kind that the server cannot read or that
            means something else to each; the message says which.
        Exception: Whatever Pillow raises of a broken file.
    """
    picture = _decoded(file)
    return (_as_sdl if rules == "noetic" else _as_magick)(picture, rules)


def _decoded(file: BinaryIO) -> Image:
    from PIL import Image, UnidentifiedImageError

    with warnings.catch_warnings():
        # Pillow warns a little below our limit and raises far above it.
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            picture = Image.open(file, formats=PICTURE_FORMATS)
        except UnidentifiedImageError as error:
            known = ", ".join(PICTURE_FORMATS)
            raise ValueError(f"expected a {known} of at least one pixel, got none") from error
        if picture.width * picture.height > MOST_PIXELS:
            raise ValueError(
                f"expected at most {MOST_PIXELS:,} pixels, "
                f"got {picture.width:,} x {picture.height:,}"
            )
        _refuse_other_scales(picture)
        picture.load()
    return picture


def _refuse_other_scales(picture: Image) -> None:
    """Raise for a PGM that does not count to 255 or 65535: no two servers take it for the same."""
    from PIL.ImageFile import ImageFile

    assert isinstance(picture, ImageFile)
    for _decoder, _box, _offset, args in picture.tile:
        most = args[-1] if picture.format == "PPM" and isinstance(args, tuple) else 255
        if isinstance(most, int) and most not in (255, 65535):
            raise ValueError(
                f"expected a greatest value of 255 or 65535 in its head, got {most}; "
                "the servers differ in how they spread it: save the picture with 255"
            )


def _as_sdl(picture: Image, _rules: RulesName) -> DecodedPicture:
    if picture.format not in NOETIC_FORMATS:
        raise ValueError(
            f"expected PGM, PNG or JPEG for the rules of noetic, got {picture.format}; "
            "save it as PGM"
        )
    if _is_deep(picture):
        if picture.format == "PPM":
            raise ValueError(
                "map_server of noetic reads no PGM of 16 bits; save it with 8, or as PNG"
            )
        return _of(picture, lambda rows: (_deep(rows) >> 8).astype(np.uint8))
    transparency = picture.info.get("transparency")
    if picture.format == "JPEG":
        return _of(picture, _as("RGB"))
    if picture.mode == "1":
        # A PBM's 1 is black, and SDL hands out the bit; a PNG's single bit is spread to 0 and 255.
        bit = picture.format == "PPM"
        return _of(picture, _pbm_bits if bit else _as("L"))
    if picture.mode == "P" and not isinstance(transparency, bytes):
        return _of(picture, np.asarray)
    if picture.mode == "L":
        return _of(picture, _as("L" if transparency is None else "LA"))
    if picture.mode == "RGB":
        return _of(picture, np.asarray)
    return _of(picture, _as("RGBA"), alpha=True)


def _as_magick(picture: Image, rules: RulesName) -> DecodedPicture:
    if _is_deep(picture):
        return _of(picture, _deep)
    if picture.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "CMYK", "YCbCr"):
        raise ValueError(f"expected 8 or 16 bits a channel, got Pillow's mode {picture.mode}")
    transparent = "A" in picture.getbands() or "transparency" in picture.info
    if not transparent:
        return _of(picture, _as("L" if picture.mode in ("1", "L") else "RGB"))
    if rules == "nav2_humble" and picture.mode == "LA":
        # It asks single pixels for their colour, and those of grey do not know how opaque they are.
        return _of(picture, _opaque, alpha=True)
    return _of(picture, _as("RGBA"), alpha=True)


def _of(
    picture: Image, converted: Callable[[Image], NDArray[Any]], *, alpha: bool = False
) -> DecodedPicture:
    def rows(top: int, bottom: int) -> Pixels:
        strip: Pixels = converted(picture.crop((0, top, picture.width, bottom)))
        return strip

    return DecodedPicture(picture.width, picture.height, alpha, rows)


def _as(mode: str) -> Callable[[Image], NDArray[np.uint8]]:
    return lambda strip: np.asarray(strip.convert(mode))


def _opaque(strip: Image) -> NDArray[np.uint8]:
    pixels = np.array(strip.convert("RGBA"))
    pixels[:, :, 3] = 255
    return pixels


def _pbm_bits(strip: Image) -> NDArray[np.uint8]:
    black: NDArray[np.bool_] = np.asarray(strip.convert("L")) == 0
    return black.astype(np.uint8)


def _is_deep(picture: Image) -> bool:
    """Tell whether it has 16 bits of grey."""
    return picture.mode.startswith("I;16") or (
        picture.mode == "I" and picture.format in ("PPM", "PNG")
    )


def _deep(strip: Image) -> NDArray[np.uint16]:
    return np.asarray(strip).astype(np.uint16)
