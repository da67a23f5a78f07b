"""The scores as tables in Markdown: of each mode the figures, and how surely one is ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from door_eval.day_losses import LOSSES
from door_eval.mode_scores import ModeScores
from door_eval.paired import INTERVAL, LEAST_DAYS, Difference

SetScores = Mapping[str, ModeScores]
"""Mode -> its scores."""


def print_tables(
    found: Mapping[str, SetScores], methods: Sequence[str], figure: str, ours: str
) -> None:
    """Print the tables of each mode; the best figure of each set is bold.

    Args:
        found: Set -> its scores.
        methods: The columns.
        figure: Which.
        ours: The estimator that is held against each other one.
    """
    others = [name for name in methods if name != ours]
    for mode in next(iter(found.values()), {}):
        _print_head(mode, methods)
        for name, modes in found.items():
            print(f"| {name} | {' | '.join(_cells(modes[mode], methods, figure))} |")
        print()
        if figure in LOSSES and others:
            _print_head(f"{mode}: {ours} minus", others)
            for name, modes in found.items():
                pairs = [modes[mode].difference(ours, other, figure) for other in others]
                days = max((pair.days for pair in pairs if pair), default=0)
                print(f"| {name} ({days} days) | {' | '.join(map(_pair, pairs))} |")
            print()


def legend(figure: str, seeds: Sequence[int]) -> str:
    """Return what the tables show, in a sentence."""
    said = f"{figure}; patrols: mean ± standard error of seeds {', '.join(map(str, seeds))}"
    if figure not in LOSSES:
        return said
    percent = f"{INTERVAL:.0%}".replace("%", " %")
    return (
        f"{said}. Differences, paired: ± standard error over the seeds, or over resampled days "
        f"where nothing is random; [{percent} of resamples of the days], bold where 0 is outside "
        f"and there are {LEAST_DAYS} days"
    )


def _print_head(mode: str, columns: Sequence[str]) -> None:
    print(f"| {mode} | {' | '.join(columns)} |")
    print(f"|---|{'---|' * len(columns)}")


def _cells(scores: ModeScores, methods: Sequence[str], figure: str) -> list[str]:
    values = {name: scores.figures[name][figure] for name in methods}
    best = min((abs(value) for value in values.values() if value is not None), default=None)
    return [
        "-" if value is None else _value(value, scores.standard_error(name, figure), best)
        for name, value in values.items()
    ]


def _value(value: float, error: float | None, best: float | None) -> str:
    text = f"**{value:.4f}**" if abs(value) == best else f"{value:.4f}"
    return text if error is None else f"{text} ± {error:.4f}"


def _pair(pair: Difference | None) -> str:
    if pair is None:
        return "-"
    mean = f"{pair.mean:+.4f}"
    said = f"**{mean}**" if pair.is_clear else mean
    return f"{said} ± {pair.standard_error:.4f} [{pair.low:+.4f}, {pair.high:+.4f}]"
