"""A corridor with three rooms, small enough to reckon by hand."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from patrol_sim.laser_doors import DoorBody
from patrol_sim.laser_plan import LevelPlan, PlanDoor, read_plan
from patrol_sim.laser_sensor import Laser
from patrol_sim.laser_surfaces import Surface
from patrol_sim.laser_world import Patrol, World, simulated
from semmap_log.core.model.doors import DoorId

BUILDING = """\
coordinate_system: cartesian_meters
name: corridor
levels:
  L1:
    elevation: 0
    vertices:
      - [0, 0, 0, ""]
      - [15, 0, 0, ""]
      - [15, 2.4, 0, ""]
      - [15, 7, 0, ""]
      - [0, 7, 0, ""]
      - [0, 2.4, 0, ""]
      - [5, 2.4, 0, ""]
      - [5, 7, 0, ""]
      - [10, 2.4, 0, ""]
      - [10, 7, 0, ""]
      - [1.5, 2.4, 0, ""]
      - [2.5, 2.4, 0, ""]
      - [6.5, 2.4, 0, ""]
      - [7.5, 2.4, 0, ""]
      - [11.5, 2.4, 0, ""]
      - [13.3, 2.4, 0, ""]
    walls:
      - [0, 1, {}]
      - [1, 3, {}]
      - [3, 4, {}]
      - [4, 0, {}]
      - [5, 2, {}]
      - [6, 7, {}]
      - [8, 9, {}]
    doors:
      - [10, 11, {name: [1, left], type: [1, hinged]}]
      - [12, 13, {name: [1, middle], type: [1, sliding]}]
      - [14, 15, {name: [1, right], type: [1, double_hinged]}]
    floors:
      - vertices: [0, 1, 3, 4]
        parameters: {}
"""

PLAIN = World(
    mixed_kinds=False, glass_doors=0, glass_walls=0, furniture_per_100_m2=5, walkers_per_min=1,
    changes_per_hour=60, cell_m=0.1,
)  # fmt: skip


def building(folder: Path) -> Path:
    path = folder / "corridor.building.yaml"
    path.write_text(BUILDING)
    return path


@cache
def plan() -> LevelPlan:
    with TemporaryDirectory() as folder:
        return read_plan(building(Path(folder)), 1)


@cache
def patrol(*, seed: int = 3, minutes: float = 1.5, upside_down: bool = False) -> Patrol:
    laser = Laser(beams=180, upside_down=upside_down)
    return simulated(plan(), PLAIN, laser, seed=seed, minutes=minutes)


def body(kind: str = "hinged", **values: object) -> DoorBody:
    """Return a door of 1 m from (0, 0) along x; its hinge is at the start, it swings to y > 0."""
    door = PlanDoor(DoorId(1), "door", kind, 0.0, 0.0, 0.0, 1.0)
    usual: dict[str, object] = {
        "drawn": door, "kind": kind, "glass": False, "shifted": (0.0, 0.0), "hinge_at_end": False,
        "side": 1, "recess_m": 0.0, "surface": Surface.PAINT,
    }  # fmt: skip
    return DoorBody(**{**usual, **values})  # type: ignore[arg-type]
