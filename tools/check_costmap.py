"""Compare costmaps with what ROS's own costmap_2d made of the same doors, cell by cell.

    python tools/check_costmap.py tests/analysis/costmap_2d/cases
    python tools/check_costmap.py FOLDER --json

FOLDER holds cases.json (the inputs) and cases.npz (the grids that are expected); its README tells
the form. Every frame is drawn anew and by incremental update. Exit code 0: no cell differs; 1: some
do; 2: not such a folder.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    LETHAL,
    NO_INFORMATION,
    DoorLayer,
    DoorLine,
    static_costs,
)
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.costmap_2d.layered import (
    CostmapLayer,
    InflationLayer,
    LayeredCostmap,
    StaticLayer,
)

COSTS = {"CLOSED": LETHAL, "OPEN": FREE_SPACE}
MOST_NAMED = 20


def main() -> int:
    options = _options()
    try:
        checked = check(options.folder)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        print(f"{options.folder}: not a pack of cases: {error!r}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps({**asdict(checked), "differing": checked.differing}))
    else:
        _print(checked)
    return 1 if checked.differing else 0


@dataclass
class Checked:
    """What was compared, and what differed."""

    cases: int = 0
    frames: int = 0
    cells: int = 0
    """Of the grids that were expected; each was made in two ways."""
    differences: list[dict[str, Any]] = field(default_factory=list)
    noetic_cells: int = 0
    """Cells in which noetic's own incremental update differs from its own redraw."""

    @property
    def differing(self) -> int:
        """How many cells differ."""
        return sum(difference["cells"] for difference in self.differences)


def check(folder: Path) -> Checked:
    """Return what a comparison of all cases in a folder gives."""
    cases = json.loads((folder / "cases.json").read_text(encoding="utf-8"))
    checked = Checked()
    with np.load(folder / "cases.npz") as grids:
        for case in cases:
            _check_case(case, grids, checked)
    return checked


def _check_case(
    case: Mapping[str, Any], grids: Mapping[str, NDArray[Any]], checked: Checked
) -> None:
    key = case["key"]
    if case.get("policy") != "clip":
        raise ValueError(f"case {key}: expected policy 'clip', got {case.get('policy')!r}")
    static = grids[f"{key}_static"] if case["has_static"] else None
    expected = {name: grids[f"{key}_{name}"] for name in ("door", "master")}
    updated = _Costmap(case, static)
    for number, frame in enumerate(case["frames"]):
        lines = {int(door): _line(said) for door, said in frame.items()}
        anew = _Costmap(case, static)
        for way, costmap in (("incremental", updated), ("redraw", anew)):
            for name, grid in costmap.drawn(lines):
                wrong = int((grid != expected[name][number]).sum())
                if wrong:
                    checked.differences.append({
                        "case": key, "name": case["name"], "frame": number,
                        "grid": name, "way": way, "cells": wrong,
                    })  # fmt: skip
        checked.cells += sum(grid[number].size for grid in expected.values())
    checked.cases += 1
    checked.frames += len(case["frames"])
    if f"{key}_incr" in grids:
        checked.noetic_cells += int((grids[f"{key}_incr"] != expected["master"]).sum())


class _Costmap:
    """The layers that a case asks for."""

    def __init__(self, case: Mapping[str, Any], static: NDArray[np.int8] | None) -> None:
        made = case["map"]
        shape, origin = (made["height"], made["width"]), made["origin"]
        geometry = (
            GridGeometry(shape[1], shape[0], made["resolution"], *origin)
            if static is None
            else GridGeometry.of_map(shape, made["resolution"], origin)
        )
        self._doors = DoorLayer(geometry)
        layers: list[CostmapLayer] = [self._doors]
        if static is not None:
            layers.insert(0, StaticLayer(geometry, static_costs(static.reshape(shape))))
        if asked := case.get("inflation"):
            layers.append(
                InflationLayer(
                    geometry,
                    asked["radius"],
                    scaling=asked["scaling"],
                    inscribed=asked["inscribed"],
                    inflate_unknown=asked.get("inflate_unknown", False),
                )
            )
        self._master = LayeredCostmap(
            geometry, layers, track_unknown=bool(made.get("track_unknown"))
        )

    def drawn(self, lines: Mapping[int, DoorLine]) -> Iterator[tuple[str, NDArray[np.uint8]]]:
        self._doors.draw(lines)
        self._master.update()
        yield "door", self._doors.costs
        yield "master", self._master.costs


def _line(said: Mapping[str, Any]) -> DoorLine:
    """Return what a door of the thesis's table draws."""
    at = said["position"]
    cost = COSTS.get(said["status"], NO_INFORMATION)
    return DoorLine(at["x"], at["y"], at["theta"], said["width"], cost)


def _print(checked: Checked) -> None:
    for difference in checked.differences[:MOST_NAMED]:
        print("{case} {name}: frame {frame}, {grid} by {way}: {cells} cells differ"
              .format(**difference))  # fmt: skip
    if len(checked.differences) > MOST_NAMED:
        print(f"… and {len(checked.differences) - MOST_NAMED} grids more")
    print(
        f"{checked.cases} cases, {checked.frames} frames, {checked.cells:,} cells, "
        f"each by redraw and by incremental update: {checked.differing:,} cells differ"
    )
    if checked.noetic_cells:
        print(f"(noetic's own incremental update: {checked.noetic_cells:,} cells)")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="the folder of cases.json and cases.npz")
    parser.add_argument("--json", action="store_true", help="one document instead of lines")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
