"""Events as Arrow tables, pandas frames and Parquet files: one wide, flat schema for all kinds.

The schema is `columns.COLUMNS`. The room knows events and the plain nouns, never a log: an
`EventBatch` is handed in, and stands below nothing here. Only `arrow_sdk` imports pyarrow and
pandas.
"""
