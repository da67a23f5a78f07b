"""Proposed doors for people: a row each, numbered as in their picture."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import Any

from semmap_log.analysis.scans.proposing.proposals import Proposal
from semmap_log.views.column_table import ColumnTable, TableColumn

UNKNOWN_KIND = "unknown"


def proposal_table(proposals: Sequence[Proposal], *, show_level: bool = False) -> ColumnTable:
    """Return the table, best first; angles in degrees for people."""
    numbers = ("x", "y", "degrees", "width", "score")
    columns = [
        TableColumn("number", "no", right=True),
        *([TableColumn("level", "level", right=True)] if show_level else []),
        *(TableColumn(name, name, right=True) for name in numbers),
        TableColumn("kind", "kind"),
        TableColumn("evidence", "evidence", least=24),
    ]
    table = ColumnTable(columns)
    for number, each in enumerate(proposals, start=1):
        level = [str(each.level)] if show_level else []
        table.add(
            str(number), *level, f"{each.x:.2f}", f"{each.y:.2f}", f"{degrees(each.theta):.0f}",
            f"{each.width:.2f}", f"{each.score:.2f}", each.kind or UNKNOWN_KIND, evidence_of(each),
        )  # fmt: skip
    return table


def evidence_of(proposal: Proposal) -> str:
    """Return what speaks for a proposal, in words."""
    seen = [
        f"{count} {word}"
        for count, word in (
            (proposal.seen_open, "open"),
            (proposal.seen_closed, "shut"),
            (proposal.seen_ajar, "ajar"),
        )
        if count
    ]
    leaf = ["leaf seen at (x, y)"] if proposal.kind else []
    parts = [f"visits: {proposal.visits}" + (f" ({', '.join(seen)})" if seen else "")]
    if proposal.passed:
        parts.insert(0, f"driven through: {proposal.passed}")
    parts.append(f"wall on {proposal.along:.0%} of 3 m beside it")
    return ", ".join([*parts, *leaf])


def proposal_to_json(number: int, proposal: Proposal, name: str) -> dict[str, Any]:
    """Return a proposal for machines; lengths m, angles rad; a hinged one hangs at x, y."""
    return {
        "number": number, "name": name, "level": proposal.level, "x": proposal.x,
        "y": proposal.y, "theta": proposal.theta, "width": proposal.width,
        "kind": proposal.kind or UNKNOWN_KIND, "score": proposal.score,
        "evidence": {
            "scans": proposal.scans, "visits": proposal.visits, "open": proposal.seen_open,
            "closed": proposal.seen_closed, "ajar": proposal.seen_ajar,
            "passed": proposal.passed, "walls": proposal.walls, "along": proposal.along,
            "free": proposal.free, "opens": proposal.opens,
        },
    }  # fmt: skip
