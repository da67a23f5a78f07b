"""A laser's log as NAME.npz, and its doors with their truth as NAME.doors.json."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.visit import DoorPlaces, PlacedScan
from semmap_log.errors import FormatError

Floats = NDArray[np.float64]
TRUTHS = ("OPEN", "CLOSED")
ARRAYS = ("stamp", "pose", "range_mm", "angle")
WALL = "wall"
"""A kind of our own in these files: a piece of wall that stands in for a shut door."""


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What is told of each pose, and of the laser."""

    max_range: float = 65.0
    sd_xy: float = 0.03
    sd_theta: float = radians(0.5)


@dataclass(frozen=True, slots=True, eq=False)
class PackedLog:
    """Scans of one laser with corrected poses, and doors whose state never changes."""

    name: str
    stamps_s: Floats
    """(t,)"""
    poses: Floats
    """(t, 3): x, y m, theta rad of the laser on the map."""
    ranges: Floats
    """(t, b) m; inf: no return."""
    angles: Floats
    """(b,) rad"""
    doors: DoorPlaces
    """Their ids count from 1."""
    names: tuple[str, ...]
    is_open: NDArray[np.bool_]
    """(doors,) the truth."""

    @classmethod
    def read(cls, path: Path) -> PackedLog:
        """Return the log NAME.npz with the NAME.doors.json beside it.

        Raises:
            FormatError: One of them cannot be read, or does not hold what it should.
        """
        arrays = _arrays(path)
        rows = _doors(path.with_suffix(".doors.json"))
        millimetres = arrays["range_mm"]
        return cls(
            path.stem,
            arrays["stamp"].astype(float),
            arrays["pose"].astype(float),
            np.where(millimetres == 0, np.inf, millimetres / 1000.0),
            arrays["angle"].astype(float),
            _places(rows),
            tuple(str(row.get("name", number)) for number, row in enumerate(rows, 1)),
            np.array([row["truth"] == "OPEN" for row in rows], bool),
        )

    def scans(self, told: Told, ranges: Floats | None = None) -> list[PlacedScan]:
        """Return the scans on the map; with other ranges, where they are given."""
        beams = len(self.angles)
        columns = zip(
            np.round(self.stamps_s * 1e9).astype(np.int64).tolist(),
            self.poses,
            self.ranges if ranges is None else ranges,
            strict=True,
        )
        return [
            PlacedScan(
                stamp_ns=stamp_ns,
                level=0,
                laser="laser",
                origins=np.broadcast_to(pose[:2], (beams, 2)),
                bearings=pose[2] + self.angles,
                ranges=row,
                max_range=told.max_range,
                sd_xy=told.sd_xy,
                sd_theta=told.sd_theta,
            )
            for stamp_ns, pose, row in columns
        ]


def packed_logs(folders: Sequence[Path]) -> list[Path]:
    """Return every NAME.npz in these folders that has a NAME.doors.json beside it.

    Raises:
        FormatError: A folder has none, or two logs have one name.
    """
    found: list[Path] = []
    for folder in folders:
        here = [p for p in sorted(folder.glob("*.npz")) if p.with_suffix(".doors.json").exists()]
        if not here:
            raise FormatError(folder, "expected a folder with NAME.npz and NAME.doors.json")
        found += here
    names = [path.stem for path in found]
    if len(set(names)) < len(names):
        raise FormatError("FOLDER", f"expected different names, got {', '.join(sorted(names))}")
    return found


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    try:
        with np.load(path) as file:
            arrays = {name: file[name] for name in ARRAYS}
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise FormatError(path, f"expected arrays {', '.join(ARRAYS)}: {error}") from error
    count, beams = len(arrays["stamp"]), len(arrays["angle"])
    if arrays["pose"].shape != (count, 3) or arrays["range_mm"].shape != (count, beams):
        raise FormatError(path, "expected stamp (t,), pose (t, 3), range_mm (t, b), angle (b,)")
    return arrays


def _doors(path: Path) -> list[dict[str, Any]]:
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        for row in rows:
            _ = [float(row[key]) for key in ("x", "y", "theta", "width")]
            if row["truth"] not in TRUTHS:
                raise FormatError(path, f"expected a truth of {TRUTHS}, got {row['truth']!r}")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(
            path, f"expected doors with x, y, theta, width, truth: {error}"
        ) from error
    return list(rows)


def _places(rows: Sequence[dict[str, Any]]) -> DoorPlaces:
    lines = [[float(row[key]) for key in ("x", "y", "theta", "width")] for row in rows]
    kinds = tuple(str(row.get("kind", "")) for row in rows)
    return DoorPlaces(
        ids=np.arange(1, len(rows) + 1),
        levels=np.zeros(len(rows), np.int64),
        lines=np.array(lines, float).reshape(-1, 4),
        kinds=tuple("" if kind in {"door", WALL} else kind for kind in kinds),
        glass=np.array([bool(row.get("glass", False)) for row in rows], bool),
    )
