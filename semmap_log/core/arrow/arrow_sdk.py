"""The one place that imports pyarrow, pandas and polars; without them, says how to get them."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from semmap_log.errors import MissingExtraError

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError:
    raise MissingExtraError("pyarrow", "arrow") from None

if TYPE_CHECKING:
    from pandas import DataFrame as DataFrame  # noqa: PLC0414 - for the hints of others
    from polars import DataFrame as _Polars

    PolarsFrame: TypeAlias = _Polars

__all__ = ["frame_of", "pa", "polars_frame_of", "pq"]


def frame_of(table: pa.Table) -> DataFrame:
    """Return a table as a pandas.DataFrame.

    Raises:
        MissingExtraError: pandas is not installed.
    """
    try:
        import pandas  # noqa: F401, ICN001 - pyarrow's own message names no way out
    except ImportError:
        raise MissingExtraError("pandas", "arrow") from None
    return table.to_pandas()


def polars_frame_of(table: pa.Table) -> PolarsFrame:
    """Return a table as a polars.DataFrame.

    Raises:
        MissingExtraError: polars is not installed.
    """
    try:
        import polars as pl
    except ImportError:
        raise MissingExtraError("polars", "polars") from None
    frame: PolarsFrame = pl.from_arrow(table)
    return frame
