"""Judge doors that are proposed from scans, beside doorways that are there.

    python tools/experiments/eval_proposals.py ../shared/data/scans
    python tools/experiments/eval_proposals.py FOLDER... --json > scores.json
    python tools/experiments/eval_proposals.py --seeds 1..8  simulated buildings: some minutes

A FOLDER is one of `eval_scans.py`: its doors whose truth is OPEN are the doorways. Of a simulated
building all doors are doorways; `seen` are those through which beams went: recall is the share of
them that is proposed. Each is proposed once by the walls of the floor plan, and once by walls that
the scans draw. `others` are proposals that are no doorway; of real logs some of them are doorways
that nobody marked. Errors are proposal minus truth; standard errors are over seeds.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scan_eval.packed_logs import PackedLog, Told, packed_logs
from scan_eval.proposal_scores import Doorway, Drive, figures
from scan_eval.simulated_drives import NO_DOORS, simulated_drives

from semmap_log.analysis.scans.proposing.proposals import proposals_of
from semmap_log.analysis.scans.proposing.swept_cells import KeptScans
from semmap_log.errors import SemmapError

ROOT = Path(__file__).resolve().parents[2]
Scores = dict[str, dict[str, Any]]


def main() -> int:
    args = _options()
    try:
        found = {path.stem: of_log(PackedLog.read(path)) for path in _logs(args.folders)}
        if args.seeds:
            found |= of_simulation(args)
    except (SemmapError, OSError) as error:
        print(f"eval_proposals: {error}", file=sys.stderr)
        return 1
    print(json.dumps(_finite(found), indent=2) if args.json else table(found))
    return 0


def of_log(log: PackedLog) -> dict[str, Any]:
    """Return the figures of a real log: there is no floor plan."""
    kept = KeptScans()
    kept.take(log.scans(Told()))
    doorways = [Doorway(*line) for line in log.doors.lines[log.is_open].tolist()]
    return figures([Drive(doorways, proposals_of(kept.scans, NO_DOORS))])


def of_simulation(args: argparse.Namespace) -> Scores:
    """Return the figures over all seeds, with a floor plan and without.

    Raises:
        FormatError: A plan cannot be read.
    """
    drives = [
        *simulated_drives(args.maps, args.seeds, minutes=args.minutes, hz=args.hz,
                          tell=lambda words: print(words, file=sys.stderr))
    ]  # fmt: skip
    return {
        "simulated, floor plan": figures([each.with_plan for each in drives]),
        "simulated, no floor plan": figures([each.without for each in drives]),
    }


def table(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the figures for people."""
    return "\n\n".join(_of(name, each) for name, each in found.items())


def _of(name: str, each: Mapping[str, Any]) -> str:
    return (
        f"{name}: found {each['seen_found']} of {each['seen']} doorways that beams went through "
        f"({each['doorways']} in all), {each['others']} others\n"
        f"  recall {_share(each['recall'])}, precision {_share(each['precision'])}\n"
        f"  width {_with_error(each['width_m'])} m (median {each['width_median_m']:+.3f}), "
        f"off by {_with_error(each['width_off_m'])} m; "
        f"centre {_with_error(each['centre_m'])} m; angle {_with_error(each['angle_deg'])} deg\n"
        f"  said to be hinged {each['said_hinged']}: {each['hinged']} are, {each['hinge_right']} "
        "of them where it is said"
    )


def _share(estimate: tuple[float, float]) -> str:
    share, error = estimate
    return f"{share:.1%}" + ("" if math.isnan(error) else f" +- {error:.1%}")


def _with_error(estimate: tuple[float, float]) -> str:
    value, error = estimate
    return f"{value:+.3f}" + ("" if math.isnan(error) else f" +- {error:.3f}")


def _finite(value: Any) -> Any:
    """Return the same with null for what is not a number."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _logs(folders: list[Path]) -> list[Path]:
    return packed_logs(folders) if folders else []


def _seeds(text: str) -> list[int]:
    first, _, last = text.partition("..")
    return list(range(int(first), int(last or first) + 1))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("folders", metavar="FOLDER", type=Path, nargs="*", help="packed logs")
    add("--seeds", metavar="N..M", type=_seeds, help="of simulated buildings, too")
    add("--minutes", type=float, default=10, help="of each simulated drive; default: 10")
    add("--hz", type=float, default=5, help="simulated scans a second; default: 5")
    add("--json", action="store_true", help="one document instead of tables")
    add("--maps", type=Path, default=ROOT.parent / "shared/data/maps",
        help="folder with the Open-RMF plans; default: %(default)s")  # fmt: skip
    args = parser.parse_args()
    if not args.folders and not args.seeds:
        parser.error("expected a FOLDER, or --seeds")
    return args


if __name__ == "__main__":
    sys.exit(main())
