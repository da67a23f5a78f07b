"""Makes a log small: closed segments in large compressed chunks, small segments merged.

Records keep their bytes and their order; every copy is compared with what it replaces.
"""

from semmap_log.store.compaction.compacting import (
    Compacted,
    compact,
    compact_segment,
    plan_compaction,
)

__all__ = ["Compacted", "compact", "compact_segment", "plan_compaction"]
