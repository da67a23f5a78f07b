"""The histograms as files, for who wants them elsewhere."""

from __future__ import annotations

from pathlib import Path

from navigation.page.drawing import png_of
from navigation.page.histograms import histogram
from navigation.tables.grouped import GroupedRuns
from semmap_log.core.io.disk import output_errors, replace_file


def write_histograms(runs: GroupedRuns, folder: Path) -> list[Path]:
    """Write a .png for each building, series and setup in which a goal was reached."""
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    written = []
    for building in runs.buildings:
        for series in runs.series(building):
            for setup, found in runs.by_setup(building, series).items():
                if (figure := histogram(setup, found)) is not None:
                    path = folder / f"times_{building}_{series}_{setup}.png"
                    with output_errors(path):
                        replace_file(path, png_of(figure))
                    written.append(path)
    return written
