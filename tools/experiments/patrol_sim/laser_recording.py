"""A bag of a simulated patrol with its truth and its doors beside it, as files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from patrol_sim.laser_bag import Told, write_bag, write_doors, write_truth
from patrol_sim.laser_plan import LevelPlan, read_plan
from patrol_sim.laser_pose import Localisation, PoseError, localised
from patrol_sim.laser_sensor import Laser
from patrol_sim.laser_world import Patrol, World, simulated

Telling = Callable[[str, float], None]
"""Told what is being done, and the share that is."""
FINE_CELL_M, FINE_M2 = 0.1, 600.0
"""A small building has a finer grid of ways."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """What a bag is made of."""

    level: int = 1
    seed: int = 1
    minutes: float = 3.0
    laser: Laser = field(default_factory=Laser)
    world: World = field(default_factory=World)
    error: PoseError = field(default_factory=PoseError)
    told: Told | None = field(default_factory=lambda: Told(0.05, 1.0))
    form: str = "mcap"
    odom_hz: float = 50.0


OFFICE_SCANS = Recipe(
    seed=2, minutes=4, laser=Laser(beams=180, hz=5, step_m=0.005), odom_hz=20,
    world=World(changes_per_hour=20),
)  # fmt: skip
"""The bag that ships in `recordings/`: small."""


def make_bag(
    out: Path, plan_path: Path, recipe: Recipe, *, tell: Telling = lambda _what, _share: None
) -> tuple[Patrol, Localisation]:
    """Write OUT, and beside it its name with `.truth.json` and `.doors.jsonl`.

    Returns:
        What took place, and where the robot believed to be.

    Raises:
        FormatError: The plan cannot be read.
        OutputError: The bag cannot be written.
    """
    plan = read_plan(plan_path, recipe.level)
    world = recipe.world
    if _free_m2(plan) < FINE_M2:
        world = replace(world, cell_m=FINE_CELL_M)
    patrol = simulated(plan, world, recipe.laser, seed=recipe.seed, minutes=recipe.minutes,
                       progress=lambda share: tell("driving", share))  # fmt: skip
    where = localised(patrol.track, recipe.error, seed=recipe.seed)
    write_bag(out, patrol, where, form=recipe.form, told=recipe.told, odom_hz=recipe.odom_hz,
              progress=lambda share: tell("scanning", share))  # fmt: skip
    beside = out.with_suffix("").name
    write_truth(out.with_name(f"{beside}.truth.json"), patrol, where, recipe.error)
    write_doors(out.with_name(f"{beside}.doors.jsonl"), patrol)
    return patrol, where


def words_of(patrol: Patrol) -> str:
    """Return what is in a patrol, for people."""
    changes = sum(
        sum(row["state"] == "MOVING" for row in life.told(0.0, patrol.length_s))
        for life in patrol.lives.values()
    )
    through = sum(map(len, patrol.passages.values()))
    return (
        f"{len(patrol.scan_times_s()):,} scans, {len(patrol.lives)} doors that move {changes} "
        f"times, driven through {through} times"
    )


def _free_m2(plan: LevelPlan) -> float:
    return float((plan.floor.cells == 0).sum()) * plan.floor.resolution**2
