"""Evaluations for people: a row an estimator, the best figures marked; then a row a door."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.evaluation import Evaluation
from semmap_log.analysis.probabilities.scores import Scores
from semmap_log.core.model.doors import DoorId
from semmap_log.core.texts import counted, percent
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn, TextPicture
from semmap_log.views.event_words import printable
from semmap_log.views.timeline_table import duration

Names = Mapping[DoorId, str]

MOST_DOORS = 40
"""So many are shown one by one."""
MOST_ESTIMATORS = 5
"""Of doors one by one: so many columns fit; those that are best on the mean."""
BEST = "*"
FIGURES = ("brier", "log_loss", "ece", "bias")
HEADS = ("Brier", "log-loss", "ECE", "bias")
NAME_WIDTH = 14


def evaluation_table(
    evaluation: Evaluation, *, names: Names = MappingProxyType({})
) -> RenderableType:
    """Return the figures of an evaluation, in 80 columns.

    Args:
        evaluation: What came of it.
        names: What the doors are called.
    """
    parts: list[RenderableType] = [_means(evaluation)]
    if len(evaluation.doors) > 1:
        parts += [Text(), _doors(evaluation, names)]
        more = len(evaluation.doors) - MOST_DOORS
        if more > 0:
            parts.append(Text(f"and {counted(more, 'door')} more: --json has all", style="dim"))
    parts += [Text(), Text(_said(evaluation), style="dim")]
    return Group(*parts)


def _means(evaluation: Evaluation) -> ColumnTable:
    mean = evaluation.mean
    best = {figure: _best(mean, figure) for figure in FIGURES}
    heads = zip(FIGURES, HEADS, range(len(FIGURES)), strict=True)
    table = ColumnTable([
        TableColumn("estimator", "estimator", least=NAME_WIDTH),
        *(TableColumn(name, head, right=True, yields=place) for name, head, place in heads),
    ])  # fmt: skip
    for name, scores in mean.items():
        cells = [_cell(scores, figure, is_best=best[figure] == name) for figure in FIGURES]
        table.add(printable(name), *cells)
    return table


def _doors(evaluation: Evaluation, names: Names) -> RenderableType:
    """Return the Brier scores of each door; of many, and of many estimators, a part is drawn."""
    mean = evaluation.mean
    ranked = sorted(mean, key=lambda name: mean[name].brier or 0.0)[:MOST_ESTIMATORS]
    drawn = _brier_scores(evaluation, names, [name for name in mean if name in ranked], MOST_DOORS)
    return TextPicture(lambda _: drawn, _brier_scores(evaluation, names, list(mean), None))


def _brier_scores(
    evaluation: Evaluation, names: Names, estimators: list[str], most: int | None
) -> ColumnTable:
    mean = evaluation.mean
    worst_first = sorted(estimators, key=lambda name: -(mean[name].brier or 0.0))
    table = ColumnTable([
        TableColumn("door", "door (Brier)", least=NAME_WIDTH),
        *(TableColumn(f"brier_{name}", printable(name), right=True, least=7,
                 yields=max(0, len(worst_first) - 1 - worst_first.index(name)))
          for name in estimators),
    ])  # fmt: skip
    for door in evaluation.doors[:most]:
        best = _best(door.scores, "brier")
        cells = [_cell(door.scores[name], "brier", is_best=name == best) for name in estimators]
        table.add(printable(names.get(door.door_id, str(door.door_id))), *cells)
    return table


def _best(scores: Mapping[str, Scores], figure: str) -> str | None:
    """Return whose figure is nearest to 0; of a single one there is no best."""
    if len(scores) < 2:
        return None
    return min(scores, key=lambda name: abs(getattr(scores[name], figure)))


def _cell(scores: Scores, figure: str, *, is_best: bool) -> Cell:
    value = getattr(scores, figure)
    said = f"{value:+.4f}" if figure == "bias" else f"{value:.4f}"
    return CellValue(
        Text(f"{said}{BEST if is_best else ' '}", style="bold" if is_best else ""), said
    )


def _said(evaluation: Evaluation) -> str:
    """Return in words what was forecast, and from what."""
    tests = sum(door.tests for door in evaluation.doors)
    unit = "sample" if evaluation.is_truth else "reading"
    after = f"{counted(tests, unit)} after the first {evaluation.protocol.split:.0%}"
    lines = [
        f"{counted(len(evaluation.doors), 'door')}, {after}; mean over doors, {BEST} best",
        known_in_words(evaluation),
    ]
    if evaluation.left_out:
        lines.append(
            f"left out, with too little known time: {counted(len(evaluation.left_out), 'door')}"
        )
    return "\n".join(lines)


def known_in_words(evaluation: Evaluation) -> str:
    """Return what each forecast knows: `known at each forecast: all up to 1 h before it`."""
    protocol = evaluation.protocol
    what = "all"
    if (patrol := protocol.patrol) is not None:
        what = (
            f"what a visit each {duration(patrol.interval_ns)} read, right "
            f"{percent(patrol.accuracy)} of the time (seed {patrol.seed}),"
        )
    return f"known at each forecast: {what} up to {_until_in_words(evaluation)}"


def _until_in_words(evaluation: Evaluation) -> str:
    protocol = evaluation.protocol
    earlier = f"{duration(protocol.horizon_ns)} before it" if protocol.horizon_ns else ""
    if protocol.prequential:
        return f"the midnight before {f'what was {earlier}' if earlier else 'it'}"
    if earlier:
        return earlier
    if protocol.patrol is not None or not evaluation.is_truth or protocol.horizon_ns is not None:
        return "its moment"
    return "the split"
