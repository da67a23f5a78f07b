"""One question to many logs, answered by an engine that others have built.

fleet_run       what a person uses: `sl.fleet([...]).map(at=...)`
log_places      which logs are meant: URLs, folders, prefixes, patterns, lists; the export job
job             what a job is, what one log answers, in a worker, and what became of each log
door_jobs       the jobs on doors and on the state of logs; answers kept for the next run
engine          where functions run; dask_engine: one of them
lake_folder     a folder of exported Parquet files: its columns, and its files
"""

from importlib.util import find_spec

from semmap_log.errors import MissingExtraError

if find_spec("pyarrow") is None:
    raise MissingExtraError("pyarrow", "fleet")
