"""One question to many logs, asked by an engine that others have built.

fleet_run       what a person uses: `sl.fleet([...]).map(at=...)`
log_places      which logs are meant: URLs, folders, prefixes, patterns, lists
job             what a job is; door_jobs, care_jobs, fold_job, month_export: those there are
log_answer      one log asked by one job, in a worker: a table, or why not
log_outcome     what became of a log
engine          where functions run; dask_engine, ray_engine: two of them
kept_answers    what is not queried again by the next run
"""

from importlib.util import find_spec

from semmap_log.errors import MissingExtraError

if find_spec("pyarrow") is None:
    raise MissingExtraError("pyarrow", "fleet")
