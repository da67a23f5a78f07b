"""The bytes of an object in a store: fetches only what is requested, near ranges as one."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache

from semmap_log.core.io.bounded_requests import check_not_forked
from semmap_log.core.io.byte_source import Identity
from semmap_log.core.io.object_cache import ObjectCache
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError

BLOCK_BYTES = 2**16
"""The least that is fetched."""
SMALL_BYTES = 2**20
"""A smaller object comes whole: a request costs more than its bytes."""
GAP_BLOCKS = 4
"""So many unwanted blocks are fetched along, rather than making two requests."""
MOST_AT_ONCE = 2**23
"""Bytes of one request."""
MOST_READ_BYTES = 2**27
"""No read returns more: what claims to be longer, such as a chunk, is not fetched."""
KEPT_BYTES = 2**25
"""So much is kept of all objects together, what was used last."""
_THREADS = 8


class _Kept:
    """Blocks that were fetched; the least recently used ones go first."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._blocks: OrderedDict[tuple[Hashable, int], bytes] = OrderedDict()
        self._bytes = 0
        self._lock = threading.Lock()

    def get(self, of: Hashable, block: int) -> bytes | None:
        with self._lock:
            found = self._blocks.get((of, block))
            if found is not None:
                self._blocks.move_to_end((of, block))
            return found

    def put(self, of: Hashable, block: int, data: bytes) -> None:
        with self._lock:
            before = self._blocks.pop((of, block), b"")
            self._blocks[of, block] = data
            self._bytes += len(data) - len(before)
            while self._bytes > self._most and len(self._blocks) > 1:
                self._bytes -= len(self._blocks.popitem(last=False)[1])

    def bound(self, most: int) -> None:
        with self._lock:
            self._most = most

    def clear(self) -> None:
        with self._lock:
            self._blocks.clear()
            self._bytes = 0

    def drop(self, of: Hashable, blocks: range) -> None:
        with self._lock:
            for block in blocks:
                self._bytes -= len(self._blocks.pop((of, block), b""))


_kept = _Kept(KEPT_BYTES)


def keep_at_most(most: int) -> None:
    """Keep at most so many bytes of all objects together: for one of many processes."""
    _kept.bound(most)


class ObjectSource:
    """A `ByteSource`: an object as it was when the log was opened.

    Each request names the exact object, so an object that was replaced is reported, never mixed in.
    Fetched bytes are kept for a while; `let_go` releases them.
    """

    is_guarded = True

    def __init__(
        self,
        store: ObjectStore,
        status: ObjectStatus,
        *,
        cache: ObjectCache | None = None,
        sha256: str = "",
    ) -> None:
        """Take an object; nothing is fetched yet.

        Args:
            store: Where it lies.
            status: The object.
            cache: Keeps what is fetched on a disk.
            sha256: Of all its bytes, where that is known.
        """
        self._store = store
        self._status = status
        self._sha256 = sha256
        self._content = sha256 or (f"{store.place} {status}" if status.e_tag else "")
        """What is kept on a disk is known by this; of an object without either nothing is."""
        self._cache = cache if self._content else None
        self.size = status.size
        self.identity: Identity = (store.place, status.name, status.e_tag, status.size)
        self._coming: dict[int, Future[None]] = {}

    def read(self, start: int, end: int) -> memoryview:
        """Return a range; as `ByteSource.read`.

        Raises:
            LogAccessError: The store does not give it; `FileNotFoundError` is its cause where the
                object has gone. Or it is longer than `MOST_READ_BYTES`.
        """
        return self.read_ranges([(start, end)])

    def read_ranges(self, ranges: Sequence[tuple[int, int]]) -> memoryview:
        """Return ranges, concatenated; as `ByteSource.read_ranges`."""
        clipped = [(max(0, start), min(end, self.size)) for start, end in ranges]
        wanted = [(start, end) for start, end in clipped if start < end]
        self._check_piece(sum(end - start for start, end in wanted))
        needed = sorted({block for start, end in wanted for block in _blocks(start, end)})
        blocks = self._fetched(needed)
        parts = [part for start, end in wanted for part in _cut(blocks, start, end)]
        return memoryview(b"".join(parts))

    def _check_piece(self, length: int) -> None:
        """Check that one read takes no more than the memory has room for.

        Raises:
            LogAccessError: It takes more.
        """
        if length > MOST_READ_BYTES:
            where = self._store.url / self._status.name
            line = command_line("fetch", self._store.url, "DIR")
            raise LogAccessError(
                f"{where}: expected at most {MOST_READ_BYTES:,} bytes in one piece, got a piece of "
                f"{length:,}. It is not read there; to read it on a disk: {line}"
            )

    def will_need(self, start: int, end: int) -> None:
        """Begin to fetch a range; as `ByteSource.will_need`."""
        end = min(end, self.size, max(0, start) + KEPT_BYTES // 4)
        blocks = self._with_neighbours(list(_blocks(max(0, start), end)))
        for run in _runs([block for block in blocks if self._is_missing(block)]):
            self._begin(run)

    def let_go(self, start: int, end: int) -> None:
        """Give up what was fetched of a range."""
        _kept.drop(self.identity, range(-(-start // BLOCK_BYTES), end // BLOCK_BYTES))

    def _fetched(self, needed: list[int]) -> dict[int, bytes]:
        """Return blocks, from memory or from the store."""
        found = {block: data for block in needed if (data := _kept.get(self.identity, block))}
        missing = [block for block in needed if block not in found]
        if not missing:
            return found
        check_not_forked(self._store.url)
        runs = list(_runs([b for b in self._with_neighbours(missing) if b not in found]))
        waiting = {id(one): one for block in missing if (one := self._coming.get(block))}
        if waiting:
            for one in waiting.values():
                one.result()
            runs = list(_runs([b for b in missing if _kept.get(self.identity, b) is None]))
        if len(runs) == 1:
            found |= self._fetch(runs[0])
        elif runs:
            for blocks in _pool().map(self._fetch, runs):
                found |= blocks
        for block in missing:
            if block not in found:
                data = _kept.get(self.identity, block)
                found[block] = data if data is not None else self._fetch([block])[block]
        return found

    def _with_neighbours(self, blocks: list[int]) -> list[int]:
        """Return all blocks of a small object, else those."""
        if blocks and self.size <= SMALL_BYTES:
            return list(_blocks(0, self.size))
        return blocks

    def _is_missing(self, block: int) -> bool:
        return block not in self._coming and _kept.get(self.identity, block) is None

    def _begin(self, run: list[int]) -> None:
        check_not_forked(self._store.url)
        future: Future[None] = _pool().submit(lambda: (self._fetch(run), None)[1])
        for block in run:
            self._coming[block] = future

        def ended(_: Future[None]) -> None:
            for block in run:
                self._coming.pop(block, None)

        future.add_done_callback(ended)

    def _fetch(self, run: list[int]) -> dict[int, bytes]:
        """Fetch blocks that follow each other.

        Raises:
            LogAccessError: The store does not give them.
        """
        blocks = self._cached(run)
        if blocks is None:
            blocks = self._from_store(run)
            self._keep(blocks)
        for block, part in blocks.items():
            _kept.put(self.identity, block, part)
        return blocks

    def _from_store(self, run: list[int]) -> dict[int, bytes]:
        start, end = run[0] * BLOCK_BYTES, min((run[-1] + 1) * BLOCK_BYTES, self.size)
        try:
            data = self._store.part(self._status, start, end)
        except FileNotFoundError as error:
            where = self._store.url / self._status.name
            raise LogAccessError(f"{where}: cannot be read: it is gone.") from error
        return {
            block: data[at : at + BLOCK_BYTES]
            for block, at in zip(run, range(0, len(data), BLOCK_BYTES), strict=True)
        }

    def _cached(self, run: list[int]) -> dict[int, bytes] | None:
        """Return blocks from the disk; None: some are not there."""
        if self._cache is None:
            return None
        found: dict[int, bytes] = {}
        for block in run:
            data = self._cache.get(self._content, block)
            if data is None or len(data) != min(BLOCK_BYTES, self.size - block * BLOCK_BYTES):
                return None
            found[block] = data
        return found

    def _keep(self, blocks: dict[int, bytes]) -> None:
        """Keep blocks on the disk; not those of an object that is seen not to be what it was."""
        if self._cache is None:
            return
        if self._sha256 and len(blocks) == len(_blocks(0, self.size)):
            whole = b"".join(blocks[block] for block in sorted(blocks))
            if hashlib.sha256(whole).hexdigest() != self._sha256:
                return
        for block, data in blocks.items():
            self._cache.put(self._content, block, data)


def _blocks(start: int, end: int) -> range:
    return range(start // BLOCK_BYTES, -(-end // BLOCK_BYTES)) if start < end else range(0)


def _cut(blocks: dict[int, bytes], start: int, end: int) -> Iterator[memoryview]:
    for block in _blocks(start, end):
        at = block * BLOCK_BYTES
        yield memoryview(blocks[block])[max(0, start - at) : end - at]


def _runs(blocks: list[int]) -> Iterator[list[int]]:
    """Yield requests: blocks that lie near each other, with what lies between them."""
    most = MOST_AT_ONCE // BLOCK_BYTES
    run: list[int] = []
    for block in blocks:
        if run and (block - run[-1] > GAP_BLOCKS + 1 or block - run[0] >= most):
            yield list(range(run[0], run[-1] + 1))
            run = []
        run.append(block)
    if run:
        yield list(range(run[0], run[-1] + 1))


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_THREADS, thread_name_prefix="semmap-log-fetching")
