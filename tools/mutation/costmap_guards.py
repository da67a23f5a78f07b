"""Every rule that makes a costmap equal to ROS's, and an updated one to one drawn anew."""

from __future__ import annotations

from mutation.mutant import Mutant, mutants_in

COSTMAP = "semmap_log/costmap/"
CASES = "tests/costmap/test_cases.py"
LINES = "tests/costmap/test_lines.py"
LAYERED = "tests/costmap/test_layered.py"
INFLATION = "tests/costmap/test_inflation.py"
FRAMES = "semmap_log/costmaps/over_time.py"
OVER_TIME = "tests/costmaps/test_over_time.py"


_put = mutants_in(COSTMAP)


COSTMAPS = (
    _put("halves of a line's steps go down", "lines.py", "(major - 1)[line]", "major[line]", LINES),
    _put("lines only on the map", "lines.py", "np.minimum(last, major)", "major", LINES),
    _put("cells left out beside the map", "lines.py", "(x >= 0) & ", "", LINES),
    _put("a door's cell is the floor", "door_layer.py",
         "np.floor((ends - origin) / geometry.resolution)",
         "np.trunc((ends - origin) / geometry.resolution)", CASES),
    _put("doors too far away", "door_layer.py", "(np.abs(cells) <= FARTHEST_CELL).all(axis=1)",
         "np.isfinite(cells).all(axis=1)", LAYERED),
    _put("doors ascend when drawn at once", "door_layer.py", "for door in sorted(doors)}",
         "for door in doors}", CASES, LAYERED),
    _put("the greater id has the cell, door by door", "door_layer.py", "doors[-1]", "doors[0]",
         LAYERED),
    _put("where a door was has changed, too", "door_layer.py",
         "[*self._bounds(before), *self._bounds(after)]", "self._bounds(after)", LAYERED),
    _put("only information reaches the master", "combining.py",
         "np.copyto(master, layer, where=layer != NO_INFORMATION)", "master[:] = layer", LAYERED),
    _put("a map's resolution is single precision", "grid.py", "float(np.float32(resolution))",
         "resolution", CASES, "tests/costmap/test_grid.py"),
    _put("who burns first at one distance", "brushfire.py", "np.unique(squares).tolist()",
         "np.unique(squares).tolist()[:1]", INFLATION),
    _put("the first to reach a cell has it", "brushfire.py",
         "self._numbers[cells[::-1]] = order[::-1]", "self._numbers[cells] = order", INFLATION),
    _put("fire spreads in noetic's order", "brushfire.py", "((-1, 0), (0, -1), (1, 0), (0, 1))",
         "((0, 1), (1, 0), (0, -1), (-1, 0))", INFLATION),
    _put("claims around a window are as before", "inflation.py", "if differs.any():", "if False:",
         INFLATION),
    _put("costs reach as far as the radius", "inflation.py",
         "math.ceil(radius / geometry.resolution)", "int(radius / geometry.resolution)", INFLATION),
    _put("the master is reset first", "layered.py",
         "self._master[window.slices] = self._default", "pass", LAYERED),
    Mutant("frames in the order of happening", FRAMES,
           "yield from _in_order([batch for batch in half if len(batch)])",
           "yield from [(int(b.folds_ns[0]), [b]) for b in half if len(b)]", (OVER_TIME,)),
    Mutant("live, a retraction takes back", FRAMES, "if Retracted in batch:", "if False:",
           (OVER_TIME,)),
)  # fmt: skip
