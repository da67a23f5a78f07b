"""The one place that imports pyarrow and pandas; without them, says how to get them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semmap_log.errors import MissingExtraError

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError:
    raise MissingExtraError("pyarrow", "arrow") from None

if TYPE_CHECKING:
    from pandas import DataFrame as DataFrame  # noqa: PLC0414 - for the hints of others

__all__ = ["frame_of", "pa", "pq"]


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
