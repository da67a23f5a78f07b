"""What came out, as a table or one JSON document."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from fault_injection.fault import Outcome


@dataclass(slots=True)
class Tally:
    """What came out for one kind."""

    kind: str
    faults: int = 0
    checked: int = 0
    lost: int = 0
    invented: int = 0
    seconds: float = 0
    skipped: str = ""
    """Why nothing could be tried."""
    bad: list[Outcome] = field(default_factory=list)
    """The outcomes that should not be."""

    def count(self, outcome: Outcome) -> None:
        """Take in what became of one fault."""
        self.faults += 1
        self.checked += outcome.checked
        self.lost += outcome.lost
        self.invented += outcome.invented
        if not outcome.is_good:
            self.bad.append(outcome)

    def line(self) -> str:
        """Return where it stands, for people who wait."""
        skipped = f", not tried: {self.skipped}" if self.skipped else ""
        return (f"{self.kind}: {self.faults:,} faults, {self.checked:,} commits looked for, "
                f"{len(self.bad):,} bad, {self.seconds:.0f} s{skipped}")  # fmt: skip


LINE_EVERY_S = 5.0
"""Where stderr is no terminal; on one the line is drawn anew each time."""


class Line:
    """Where a kind stands, on stderr."""

    def __init__(self, tally: Tally, now: float) -> None:
        """Start; `now` is of the same clock as all that follows."""
        self._tally = tally
        self._shown = now

    def show(self, now: float) -> None:
        """Show it in place of what was; where nobody looks, a line every few seconds."""
        if sys.stderr.isatty():
            print(f"\r\x1b[K{self._tally.line()}", end="", file=sys.stderr, flush=True)
        elif now - self._shown >= LINE_EVERY_S:
            self._shown = now
            print(f"{self._tally.line()} …", file=sys.stderr, flush=True)

    def end(self) -> None:
        """Show how it ended, to stay."""
        again = "\r\x1b[K" if sys.stderr.isatty() else ""
        print(f"{again}{self._tally.line()}", file=sys.stderr, flush=True)


MOST_SHOWN = 20
"""Bad outcomes of a kind that the table lists."""


def show(tallies: Sequence[Tally], seed: int) -> None:
    """Print the table on stdout, for people: 80 columns."""
    console = Console(width=80, highlight=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, width=80)
    table.add_column(f"seed {seed}")
    for name in ("faults", "checked", "lost", "invented", "other", "seconds"):
        table.add_column(name, justify="right", no_wrap=True)
    for tally in tallies:
        others = sum(not (bad.lost or bad.invented) for bad in tally.bad)
        figures = (tally.faults, tally.checked, tally.lost, tally.invented, others)
        table.add_row(tally.kind, *(f"{figure:,}" for figure in figures), f"{tally.seconds:.0f}")
    table.add_section()
    table.add_row("all", f"{sum(tally.faults for tally in tallies):,}",
                  *(f"{sum(getattr(t, name) for t in tallies):,}"
                    for name in ("checked", "lost", "invented")), "",
                  f"{sum(tally.seconds for tally in tallies):.0f}")  # fmt: skip
    console.print(table)
    console.print("checked: acknowledged commits that were looked for after a fault.", style="dim")
    for tally in tallies:
        if tally.skipped:
            console.print(f"NOT TRIED: {tally.kind}: {tally.skipped}", style="bold")
        for bad in tally.bad[:MOST_SHOWN]:
            console.print(f"{tally.kind}: {bad.fault}: lost {bad.lost}, invented {bad.invented}. "
                          f"{_last_line(bad.problem)}{f' Kept: {bad.kept}' if bad.kept else ''}",
                          style="red", soft_wrap=True, markup=False)  # fmt: skip
        if len(tally.bad) > MOST_SHOWN:
            console.print(f"{tally.kind}: … and {len(tally.bad) - MOST_SHOWN} more", style="red")


def _last_line(problem: str) -> str:
    """Return what a traceback ends with; all of it is in the JSON."""
    return problem.strip().rpartition("\n")[2]


def to_json(tallies: Sequence[Tally], seed: int) -> dict[str, Any]:
    """Return the same as one document."""
    return {
        "seed": seed,
        "kinds": [
            {
                "kind": tally.kind,
                "faults": tally.faults,
                "checked": tally.checked,
                "lost": tally.lost,
                "invented": tally.invented,
                "seconds": round(tally.seconds, 1),
                "skipped": tally.skipped or None,
                "bad": [
                    {
                        "fault": bad.fault,
                        "lost": bad.lost,
                        "invented": bad.invented,
                        "problem": bad.problem,
                        "kept": str(bad.kept) if bad.kept else None,
                    }
                    for bad in tally.bad
                ],
            }
            for tally in tallies
        ],
    }
