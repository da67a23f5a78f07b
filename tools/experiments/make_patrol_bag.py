"""Make a bag of a robot with a laser that patrols a building, and the truth beside it.

    python tools/experiments/make_patrol_bag.py patrol.bag  office, 3 minutes, ROS 1
    python tools/experiments/make_patrol_bag.py patrol --format sqlite3           a rosbag2 folder
    python tools/experiments/make_patrol_bag.py week --building clinic --level 2 --minutes 30
    python tools/experiments/make_patrol_bag.py lost.bag --pose-error 0.2,4 --not-told --jumps 0.5
    python tools/experiments/make_patrol_bag.py patrol.bag --picture patrol.png

Beside OUT it writes OUT's name with `.truth.json` (each door's state over time, when the robot
drove through) and `.doors.jsonl` (the doors, for `semmap-log import`). The same options give the
same bytes. Some doors and walls are of glass, leaves are recessed, doors are drawn a little beside
where they are, people walk by and stand in doorways: `World` in patrol_sim/laser_world.py.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from patrol_sim.laser_bag import FORMATS, Told
from patrol_sim.laser_picture import drawn, whole
from patrol_sim.laser_pose import PoseError
from patrol_sim.laser_recording import Recipe, make_bag, words_of
from patrol_sim.laser_sensor import Laser
from patrol_sim.laser_world import World

from semmap_log.errors import SemmapError
from semmap_log.interop.formats.bags.bag_reading import bytes_of

ROOT = Path(__file__).resolve().parents[2]
USUAL = World()


def main() -> int:
    """Make what the command line asks for; 0 good, 1 our error."""
    args = _options()
    try:
        make(args)
    except (SemmapError, OSError) as error:
        print(f"make_patrol_bag: {error}", file=sys.stderr)
        return 1
    return 0


def make(args: argparse.Namespace) -> None:
    """Simulate, and write the bag, its truth and its doors.

    Raises:
        SemmapError: The plan cannot be read, or the bag not be written.
    """
    began = time.monotonic()
    laser = Laser(
        beams=args.beams, field_deg=args.field, hz=args.hz, range_max=args.range_max,
        step_m=args.step, upside_down=args.upside_down,
    )  # fmt: skip
    world = World(
        mixed_kinds=not args.plan_kinds, glass_doors=args.glass_doors, glass_walls=args.glass_walls,
        changes_per_hour=args.changes, walkers_per_min=args.people,
    )  # fmt: skip
    recipe = Recipe(
        level=args.level, seed=args.seed, minutes=args.minutes, laser=laser, world=world,
        error=PoseError(*args.pose_error, jumps_per_min=args.jumps),
        told=Told(*(args.says or args.pose_error)) if args.told else None,
        form=args.format or ("ros1" if args.out.suffix == ".bag" else "mcap"), odom_hz=args.odom_hz,
    )  # fmt: skip
    patrol, where = make_bag(args.out, _plan_path(args), recipe, tell=_bar)
    if args.picture:
        at_s = patrol.length_s / 2
        drawn(patrol, whole(patrol), at_s=at_s, believed=where.believed).save(args.picture)
    print(f"\r{args.out}: {words_of(patrol)}, {bytes_of(args.out):,} bytes, "
          f"{time.monotonic() - began:.1f} s", file=sys.stderr)  # fmt: skip


def _plan_path(args: argparse.Namespace) -> Path:
    """Return where the plan of a building is.

    Raises:
        FileNotFoundError: It is not there.
    """
    named = args.maps / f"rmf_{args.building}" / f"{args.building}.building.yaml"
    path = Path(args.building) if args.building.endswith(".yaml") else named
    if not path.is_file():
        raise FileNotFoundError(
            f"{path}: expected an Open-RMF plan, found nothing; say with --maps where the plans "
            "are (open-rmf/rmf_demos, rmf_demos_maps/maps), or name one with --building"
        )
    return path


def _bar(what: str, share: float) -> None:
    """Show how far it is, on a terminal."""
    if sys.stderr.isatty():
        print(f"\r{what} {share:.0%}   ", end="", file=sys.stderr, flush=True)


def _pair(text: str) -> tuple[float, float]:
    first, second = map(float, text.split(","))
    return first, second


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("out", type=Path, metavar="OUT", help="NAME.bag, NAME.mcap, or the name of a new folder")
    add("--format", choices=FORMATS, help="default: ros1 for NAME.bag, else mcap")
    add("--building", default="office", help="office, clinic, hotel or a *.building.yaml; "
        "default: %(default)s")  # fmt: skip
    add("--level", type=int, default=1, help="counted from the lowest; default: %(default)s")
    add("--seed", type=int, default=1, help="of all chance; default: %(default)s")
    add("--minutes", type=float, default=3, help="default: %(default)s")
    add("--pose-error", type=_pair, default=(0.05, 1.0), metavar="M,DEG",
        help="standard deviations of the localisation; default: 0.05,1")  # fmt: skip
    add("--jumps", type=float, default=0.0,
        help="a minute, at which it localises anew, somewhere else within its error: with that of "
        "0.05,1 most are too small to be told; default: 0")  # fmt: skip
    tells = parser.add_mutually_exclusive_group()
    tells.add_argument(
        "--told", action="store_true", default=True, help="/amcl_pose has the covariance; default"
    )
    tells.add_argument("--not-told", dest="told", action="store_false", help="no /amcl_pose")
    add("--says", type=_pair, metavar="M,DEG", help="what it tells; default: the truth")
    add("--beams", type=int, default=360)
    add("--field", type=float, default=270.0, help="of view, degrees; default: %(default)s")
    add("--hz", type=float, default=10.0, help="scans a second; default: %(default)s")
    add("--range-max", type=float, default=20.0, help="m; default: %(default)s")
    add("--step", type=float, default=0.001, help="ranges are multiples, m; default: %(default)s")
    add("--upside-down", action="store_true", help="the laser hangs from its mount")
    add("--odom-hz", type=float, default=50.0, help="default: %(default)s")
    add("--plan-kinds", action="store_true", help="kinds of doors as in the plan, not by chance")
    add("--changes", type=float, default=USUAL.changes_per_hour, help="of a door, an hour")
    add("--people", type=float, default=USUAL.walkers_per_min, help="who walk by, a minute")
    add("--glass-doors", type=float, default=USUAL.glass_doors, help="their share")
    add("--glass-walls", type=float, default=USUAL.glass_walls, help="their share")
    add("--picture", type=Path, help="a .png of the building, the way and the doors, too")
    add("--maps", type=Path, default=ROOT.parent / "shared/data/maps",
        help="folder with the Open-RMF plans; default: %(default)s")  # fmt: skip
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
