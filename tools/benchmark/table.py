"""What was measured, as a table for people: 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

from rich import box
from rich.console import Console, RenderableType
from rich.markup import escape
from rich.table import Table

from benchmark.case import Case, Measured
from benchmark.peers import OURS
from benchmark.promises import (
    Growth,
    Result,
    growths,
    is_kept,
    memory_kept,
    speed_kept,
    times_of,
)
from benchmark.report import NOTES, figure

WIDTH = 80
MIB = 2**20

Row = tuple[str, ...]


def show(results: Sequence[Result], machine: dict[str, Any]) -> None:
    """Print the table on stdout."""
    console = Console(width=WIDTH, highlight=False)
    console.print(_machine_line(machine))
    console.print(f"{machine['date']}   {machine['command']}", style="dim")
    console.print(_table(results))
    console.print(f"Temporary files: {machine['disk_bytes'] / MIB:,.0f} MiB at most.", style="dim")
    for note in NOTES:
        console.print(f"- {note}", style="dim")


def _machine_line(machine: dict[str, Any]) -> str:
    versions = [f"{name} {found}" for name, found in machine["versions"].items()]
    ahead = machine["read_ahead_kib"]
    disk = f"{machine['file_system']}, read-ahead {ahead} KiB" if ahead else machine["file_system"]
    parts = (f"{machine['cores']} cores", machine["cpu"], disk,
             f"Python {machine['python']}", f"SQLite {machine['sqlite']}", *versions)  # fmt: skip
    return " · ".join(part for part in parts if part)


def _table(results: Sequence[Result]) -> RenderableType:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, width=WIDTH)
    table.add_column("")
    for name in ("figure", "times", "promised", "peak MiB"):
        table.add_column(name, justify="right", no_wrap=True)
    for (_, events), group in groupby(
        results, key=lambda result: (result[0].group, result[0].events)
    ):
        if events is not None:
            table.add_row(f"[dim]{events:,} events[/]")
        for case, peers in group:
            for row in _case_rows(case, peers):
                table.add_row(*row)
        table.add_section()
    for (least, most), grown in groupby(
        growths(results), key=lambda growth: (growth.from_events, growth.to_events)
    ):
        table.add_row(f"[bold]Growth of a moment's time[/]\n[dim]{least:,} to {most:,} events[/]")
        for growth in grown:
            table.add_row(*_growth_row(growth))
    return table


def _case_rows(case: Case, peers: Sequence[Measured]) -> Iterator[Row]:
    turns = max(len(measured.seconds) for measured in peers)
    yield f"[bold]{case.title}[/]", f"[dim]{case.unit}[/]", f"[dim]n {turns}[/]"
    for measured in peers:
        yield from _peer_rows(case, measured, peers)


def _peer_rows(case: Case, measured: Measured, peers: Sequence[Measured]) -> Iterator[Row]:
    name = f"  {escape(measured.peer.name)}"
    if measured.problem:
        yield (f"{name}: {escape(measured.problem)}",)
        return
    said = figure(measured.median_s, case.unit) if measured.agrees else "[bold red]WRONG[/]"
    promise = _marked(measured.peer.promise, kept=speed_kept(measured, peers))
    yield name, said, _times(times_of(measured, peers)), promise, _memory(case, measured)
    if measured.note:
        yield (f"[dim]    {escape(measured.note)}[/]",)
    is_ours = measured.peer.name.startswith(OURS)
    if case.tail_promise is not None:
        tails = (("p99", measured.p99_s, case.tail_promise),
                 ("worst", measured.worst_s, case.worst_promise))  # fmt: skip
        for name, seconds, promise in tails:
            kept = is_kept(promise, seconds * 1e3) if is_ours else None
            promised = _marked(promise if is_ours else "", kept=kept)
            yield f"[dim]    {name}[/]", figure(seconds, case.unit), "", promised
    if (share := measured.share_read) is not None:
        kept = is_kept(case.share_promise, share * 100) if is_ours else None
        promised = case.share_promise if is_ours else ""
        yield "[dim]    read[/]", f"{share:.2%}", "", _marked(promised, kept=kept)


def _growth_row(growth: Growth) -> Row:
    how = growth.title.split(", ")[1]
    kept = is_kept(growth.promise, growth.times)
    return (f"  {escape(growth.peer)}, {how}", f"{growth.times:,.3g}x", "",
            _marked(growth.promise, kept=kept))  # fmt: skip


def _memory(case: Case, measured: Measured) -> str:
    if not case.has_memory:
        return ""
    kept = memory_kept(case, measured)
    mark = "[red]![/]" if kept is False else ""
    return f"{mark}{measured.peak_bytes / MIB:,.0f}"


def _marked(promise: str, *, kept: bool | None) -> str:
    if kept is None:
        return promise
    return f"{promise} [green]✓[/]" if kept else f"{promise} [red]✗[/]"


def _times(times: float | None) -> str:
    return "" if times is None else f"{times:,.{2 if times < 10 else 0}f}x"
