"""A log copied while it is written: whole, verified, and only what is new the next time.

copy_plan     what the copy holds already, and what it lacks
staged_file   a segment's copy, verified before it has its name
copying       all of it
"""

from semmap_log.store.copying.copying import Copied, copy_log

__all__ = ["Copied", "copy_log"]
