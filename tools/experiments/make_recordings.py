"""Make the recordings that ship in `recordings/`: the same seed gives the same bytes.

    python tools/experiments/make_recordings.py                  all, about a minute
    python tools/experiments/make_recordings.py --only office    a second

What is in them, and what their doors and the robot go through, is told in recordings/README.md.
"""

from __future__ import annotations

import argparse
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from patrol_sim import clinic, library, office
from patrol_sim.expected import Moment, expected_json
from patrol_sim.journal import Entry, Journal, write
from patrol_sim.laser_plan import plan_events
from patrol_sim.laser_recording import OFFICE_SCANS, make_bag, words_of

from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import parse_instant
from semmap_log.errors import SemmapError
from semmap_log.log import compact

ROOT = Path(__file__).resolve().parents[2]
MONDAY = "2026-03-02"


@dataclass(frozen=True, slots=True)
class Recording:
    """What to make, and from which plan."""

    name: str
    plan: str
    """Below the folder of maps."""
    building: str
    tz: str
    robot: str
    tell: Callable[[Sequence[Event], int, random.Random], Journal]
    moments: Callable[[Journal, int], list[Moment]]
    compacted: bool


RECORDINGS = (
    Recording("office", "rmf_office/office.building.yaml", "rmf_office", office.TZ, office.ROBOT,
              office.tell, office.moments, compacted=False),
    Recording("clinic_week", "rmf_clinic/clinic.building.yaml", "rmf_clinic", clinic.TZ,
              clinic.ROBOT, clinic.tell, clinic.moments, compacted=True),
)  # fmt: skip
LIBRARY = "library"
SCANS, SCANS_PLAN = "office_scans", "rmf_office/office.building.yaml"


def main() -> int:
    """Make what the command line asks for; 0 good, 1 our error."""
    names = [*(recording.name for recording in RECORDINGS), SCANS, LIBRARY]
    parser = argparse.ArgumentParser(description="Make the recordings that ship with the project.")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "recordings", help="default: %(default)s"
    )
    parser.add_argument("--only", choices=names, help="default: all")
    parser.add_argument("--seed", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--maps", type=Path, default=ROOT.parent / "shared/data/maps",
                        help="folder with the Open-RMF plans; default: %(default)s")  # fmt: skip
    args = parser.parse_args()
    chosen = [recording for recording in RECORDINGS if args.only in (None, recording.name)]
    try:
        for recording in chosen:
            make(recording, maps=args.maps, out=args.out, seed=args.seed)
        if args.only in (None, SCANS):
            make_scans(maps=args.maps, out=args.out)
        if args.only in (None, LIBRARY):
            library.write_files(args.out / LIBRARY, seed=args.seed)
    except (SemmapError, OSError) as error:
        print(f"make_recordings: {error}", file=sys.stderr)
        return 1
    return 0


def make(recording: Recording, *, maps: Path, out: Path, seed: int) -> None:
    """Make a recording, its expected states and its licence in `out`, replacing what is there."""
    plan_path = _existing(maps / recording.plan)
    began = time.monotonic()
    say(f"{recording.name}: letting doors live and the robot drive …")
    rng = random.Random(f"{recording.name} {seed}")
    monday_ns = parse_instant(MONDAY, tz=recording.tz)
    journal = recording.tell(plan_events(plan_path), monday_ns, rng)

    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix=".making_") as folder:
        log = Path(folder) / recording.name
        write(log, journal, tz=recording.tz, robot=recording.robot, building=recording.building,
              rng=rng, progress=shown(f"{recording.name}: writing"))  # fmt: skip
        if recording.compacted:
            compact(log, merge=False)
        shutil.rmtree(out / recording.name, ignore_errors=True)
        log.rename(out / recording.name)
    expected = expected_json(journal, recording.moments(journal, monday_ns))
    (out / f"{recording.name}.expected.json").write_text(expected)
    shutil.copyfile(plan_path.parent / "LICENSE", out / "LICENSE.rmf_demos")

    events = sum(len(entry.events) for entry in journal)
    size = sum(path.stat().st_size for path in (out / recording.name).iterdir())
    say(f"{recording.name}: {events:,} events in {len(journal):,} commits, {size:,} bytes, "
        f"{time.monotonic() - began:.1f} s")  # fmt: skip


def make_scans(*, maps: Path, out: Path) -> None:
    """Make the bag of scans, its truth and its doors in `out`, replacing what is there."""
    out.mkdir(parents=True, exist_ok=True)
    bag = out / f"{SCANS}.mcap"
    patrol, _ = make_bag(bag, _existing(maps / SCANS_PLAN), OFFICE_SCANS)
    say(f"{SCANS}: {words_of(patrol)}, {bag.stat().st_size:,} bytes")


def _existing(plan_path: Path) -> Path:
    """Return the path of a plan.

    Raises:
        FileNotFoundError: There is none.
    """
    if not plan_path.is_file():
        raise FileNotFoundError(
            f"{plan_path}: expected the Open-RMF plan {plan_path.parent.name}/{plan_path.name}, "
            "found nothing; say with --maps where the plans are (open-rmf/rmf_demos, "
            "rmf_demos_maps/maps)"
        )
    return plan_path


def shown(what: str) -> Callable[[Sequence[Entry]], Iterable[Entry]]:
    """Return a progress bar for a terminal; elsewhere it is silent."""

    def walk(entries: Sequence[Entry]) -> Iterator[Entry]:
        for done, entry in enumerate(entries, start=1):
            yield entry
            if sys.stderr.isatty() and (done % 500 == 0 or done == len(entries)):
                end = "\n" if done == len(entries) else ""
                print(f"\r{what} {done * 100 // len(entries)} %", end=end, file=sys.stderr)

    return walk


def say(text: str) -> None:
    """Tell whoever runs this how far it is."""
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
