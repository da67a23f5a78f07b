"""Events as Arrow tables, pandas frames and Parquet files: one wide, flat schema for all kinds.

The schema is `table.COLUMNS`. The package knows events and the plain nouns, never a log:
callers pass an `EventBatch`. Only `arrow_sdk` imports pyarrow and pandas.
"""
