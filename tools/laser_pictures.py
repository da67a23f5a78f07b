"""Make the pictures of the guide "Doors from a laser", from the simulated bag that is shipped.

    python tools/laser_pictures.py                    into docs/images
    python tools/laser_pictures.py FOLDER --no-view   the plots alone: they need no viewer

They are what the commands of the guide draw, with fewer colours, so that they stay small.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
BAG = ROOT / "recordings" / "office_scans.mcap"
DOORS = ROOT / "recordings" / "office_scans.doors.jsonl"
DRAWN, SHOWN, SEEN = "hardware_door", "coe_door", "2026-03-02T10:01:15"
"""The doors of two pictures, and a moment at which the second one has just been seen."""
COLOURS = 128
MIDDLE = (0.19, 0.0, 0.81, 0.8)
"""The part of the viewer's picture that is about the door: left, top, right, bottom."""


def main() -> int:
    """Make the pictures; 0 good, 1 a command failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, nargs="?", default=ROOT / "docs" / "images")
    parser.add_argument("--no-view", action="store_true", help="leave out the rerun viewer's")
    args = parser.parse_args()
    try:
        make(args.folder, with_view=not args.no_view)
    except subprocess.CalledProcessError as error:
        print(f"laser_pictures: {error}", file=sys.stderr)
        return 1
    return 0


def make(folder: Path, *, with_view: bool) -> None:
    """Make them.

    Args:
        folder: That they come into.
        with_view: The rerun viewer's, too.

    Raises:
        subprocess.CalledProcessError: A command failed; it has said why.
    """
    visits, proposed = folder / "laser_visits.png", folder / "laser_proposed.png"
    with tempfile.TemporaryDirectory() as name:
        office, empty = f"{name}/office", f"{name}/empty"
        for log in (office, empty):
            _semmap_log("init", log, "--tz", "Europe/Vienna", "--robot", "tug1")
        _semmap_log("import", office, DOORS)
        _semmap_log("import", office, BAG, "--scan", "--keep-scans")
        _semmap_log("scan-report", office, "--door", DRAWN, "--plot", visits)
        _semmap_log("import", empty, BAG)  # the floor plan
        _semmap_log("import", empty, BAG, "--scan", "--propose-doors", "--plot", proposed)
        if with_view:
            shown = ("--view", f"{SHOWN} by laser", "--at", SEEN)
            _semmap_log("view", office, "--screenshot", folder / "laser_view.png", *shown)
            _shrink(folder / "laser_view.png", MIDDLE)
    for path in (visits, proposed):
        _shrink(path)


def _semmap_log(*words: str | Path) -> None:
    subprocess.run([sys.executable, "-m", "semmap_log", *map(str, words)], check=True)


def _shrink(path: Path, part: tuple[float, float, float, float] = (0, 0, 1, 1)) -> None:
    """Have a picture, or a part of it, with few colours: also of those that hardly come in it."""
    with Image.open(path) as picture:
        whole = picture.convert("RGB")
    left, top, right, bottom = part
    width, height = whole.size
    shown = whole.crop((
        round(left * width), round(top * height), round(right * width), round(bottom * height)
    ))  # fmt: skip
    few = shown.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(path, optimize=True)
    print(f"{path}: {path.stat().st_size:,} bytes", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
