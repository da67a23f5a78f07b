"""Copies a log while it is written: whole, verified, and the next time only what is new.

copy_plan     what the copy already contains, and what it lacks; a segment's verified copy
copying       all of it
"""

from semmap_log.store.copying.copying import Copied, copy_log

__all__ = ["Copied", "copy_log"]
