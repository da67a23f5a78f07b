"""The head of a closed segment: the hash of its last commit, to which the next segment is chained.

Closing writes it into `semmap_index`, so that two neighbours are compared without a look at their
chunks. Older logs do not have it there: then it is read from the last commit.
"""

from __future__ import annotations

from semmap_log.core.model.commits import Commit
from semmap_log.errors import CorruptLogError
from semmap_log.store.byte_layout import INDEX_METADATA
from semmap_log.store.header import SegmentHeader, head_in_index
from semmap_log.store.pages import COMMIT_BIT
from semmap_log.store.reading.chunk_table import ChunkTable
from semmap_log.store.reading.closed_summary import ClosedSummary, index_of
from semmap_log.store.reading.page_reading import read_page

HASH_BYTES = 32


def stored_head(summary: ClosedSummary) -> bytes | None:
    """Return the head that closing a segment wrote; None: an older log's, without one.

    Raises:
        CorruptLogError: The index is missing or damaged.
    """
    at, index = index_of(summary)
    try:
        head = head_in_index(index)
    except ValueError as error:
        raise CorruptLogError(summary.path, at, f"its {INDEX_METADATA}: {error}") from None
    if head is not None and len(head) != HASH_BYTES:
        problem = f"expected a head of {HASH_BYTES} bytes, got {len(head)}"
        raise CorruptLogError(summary.path, at, f"its {INDEX_METADATA}: {problem}")
    return head


def last_commit_in(chunks: ChunkTable, header: SegmentHeader) -> Commit | None:
    """Return the last commit of a segment; None: it has none.

    Args:
        chunks: All of its chunks.
        header: Its own.

    Raises:
        CorruptLogError: The chunk that holds it is not what was written.
    """
    for place in reversed(chunks.having(COMMIT_BIT).tolist()):
        return read_page(chunks[place : place + 1], header.first_event).last_commit()
    return None
