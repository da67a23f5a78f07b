r"""Does a map of doors help a robot to reach its goals? The thesis's experiment, with many seeds.

    python tools/experiments/navigation_experiment.py run --building clinic.building.yaml --out runs
    python tools/experiments/navigation_experiment.py run --building hotel.building.yaml --level 2 \
        --setup map map_star --near-m 1 3 8 --out runs

A robot is sent to random places of a building in which doors open and close, until it has reached a
hundred. What it knows of the doors, is the setup (`navigation/setups.py`); what it meets, follows
from the seed. Each run leaves two logs, below OUT/BUILDING/SETUP/SERIES-SEED: `world` and `belief`.
A run that is there is not made again: what was stopped goes on where it was. Needs pyastar2d.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from navigation import reading_verbs, run_verb
from navigation.options import OptionError
from navigation.records import RunError
from navigation.ways import MissingPlannerError

from semmap_log.errors import SemmapError

VERBS = {"run": run_verb.RUN, **reading_verbs.VERBS}
HELP = {"run": "make runs", **reading_verbs.HELP}
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the command line asks for; 0 good, 1 our error, 130 stopped by Ctrl-C."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    for name, (add_arguments, _) in VERBS.items():
        add_arguments(verbs.add_parser(name, help=HELP[name]))
    args = parser.parse_args(arguments)
    try:
        return VERBS[args.verb][1](args)
    except (SemmapError, OSError, OptionError, RunError, MissingPlannerError) as error:
        print(f"navigation_experiment: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("navigation_experiment: stopped; the same command goes on", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
