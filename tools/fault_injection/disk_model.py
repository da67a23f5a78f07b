"""A disk that keeps only what it was told to keep: from recorded calls to what a crash may leave.

The model, which is what POSIX promises and no more: a file's data and size are there for certain
once that file was synced; a name, a rename, a removal once its folder was. Until then any sector
of 512 bytes may be new, old or missing (zeros), the size ahead of the data or behind it, and any
subset of a folder's changes may have happened, in the order in which they were made.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from random import Random
from typing import TypeAlias

from fault_injection.fault import Tree
from fault_injection.shim import Call, Entry

SECTOR = 512
_O_TRUNC = 0o1000


@dataclass(slots=True)
class _File:
    durable: bytes = b""
    pending: list[tuple[int, bytes | None]] = field(default_factory=list)
    """Writes (offset, bytes) and truncations (new size, None) since the last sync."""


@dataclass(frozen=True, slots=True)
class _Change:
    """Of a folder: `source` loses its name (if it has one), `target` gets it."""

    node: _Node
    source: str | None = None
    target: str | None = None


@dataclass(slots=True)
class _Folder:
    durable: dict[str, _Node] = field(default_factory=dict)
    pending: list[_Change] = field(default_factory=list)
    now: dict[str, _Node] = field(default_factory=dict)
    """As the running system sees it."""


_Node: TypeAlias = _File | _Folder


class Disk:
    """What is on a disk, for certain and perhaps, while recorded calls go by."""

    def __init__(self, root: str, tree: Tree | None = None) -> None:
        """Begin with a folder whose content is durable."""
        self._root_path = root.rstrip("/")
        self._root = _folder_of(tree or {})
        self._open: dict[int, _Node] = {}

    def take(self, entry: Entry) -> None:
        """Take in the next call.

        Raises:
            ValueError: It does something that the model does not know.
        """
        match entry.call:
            case Call.OPEN | Call.LOOK:
                self._open[entry.fd] = self._opened(entry)
            case Call.WRITE:
                self._file(entry.fd).pending.append((entry.number, entry.data))
            case Call.TRUNCATE:
                self._file(entry.fd).pending.append((entry.number, None))
            case Call.FSYNC | Call.FDATASYNC:
                self._sync(self._open[entry.fd])
            case Call.RENAME:
                (folder, name), (other, target) = (
                    self._place(path) for path in (entry.path, entry.other)
                )
                if folder is not other:
                    raise ValueError(f"a rename from one folder to another: {entry.path}")
                node = folder.now.pop(name)
                folder.now[target] = node
                folder.pending.append(_Change(node, source=name, target=target))
            case Call.LINK:
                (folder, name), (other, target) = (
                    self._place(path) for path in (entry.path, entry.other)
                )
                self._add(other, target, folder.now[name])
            case Call.UNLINK:
                folder, name = self._place(entry.path)
                folder.pending.append(_Change(folder.now.pop(name), source=name))
            case Call.MKDIR:
                folder, name = self._place(entry.path)
                self._add(folder, name, _Folder())
            case Call.CLOSE:
                del self._open[entry.fd]
            case Call.NOTE:
                pass
            case _:
                raise ValueError(f"a call that the model does not know: {entry.path}")

    def now(self) -> Tree:
        """Return the content as the running system sees it."""
        return _seen(self._root)

    def end_process(self) -> None:
        """Close all files: nothing is lost by that, and nothing is synced."""
        self._open.clear()

    def crashed(self, random: Random) -> Tree:
        """Return a content that a crash now may leave."""
        files, folders = random.choice(_MOODS), random.choice(_MOODS)
        return _left(self._root, random, files, folders)

    def _opened(self, entry: Entry) -> _Node:
        if entry.path == self._root_path:
            return self._root
        folder, name = self._place(entry.path)
        if name not in folder.now:
            self._add(folder, name, _File())
        node = folder.now[name]
        if entry.number & _O_TRUNC and isinstance(node, _File):
            node.pending.append((0, None))
        return node

    @staticmethod
    def _add(folder: _Folder, name: str, node: _Node) -> None:
        folder.now[name] = node
        folder.pending.append(_Change(node, target=name))

    def _file(self, fd: int) -> _File:
        node = self._open[fd]
        assert isinstance(node, _File)
        return node

    def _place(self, path: str) -> tuple[_Folder, str]:
        """Return the folder that holds a path, and the name in it."""
        folder = self._root
        *between, name = path.removeprefix(self._root_path).strip("/").split("/")
        for part in between:
            inner = folder.now[part]
            assert isinstance(inner, _Folder)
            folder = inner
        return folder, name

    @staticmethod
    def _sync(node: _Node) -> None:
        if isinstance(node, _File):
            node.durable = _applied(node.durable, node.pending)
        else:
            node.durable = _changed(node.durable, node.pending)
        node.pending.clear()


_MOODS = ("none", "all", "first", "first", "some", "some", "some")
"""What a crash leaves of unsynced things: none, all, those up to some point, or just any."""


def _folder_of(tree: Tree) -> _Folder:
    durable = {
        name: _File(bytes(node)) if isinstance(node, (bytes, bytearray)) else _folder_of(node)
        for name, node in tree.items()
    }
    return _Folder(durable, now=dict(durable))


def _seen(folder: _Folder) -> Tree:
    return {
        name: _applied(node.durable, node.pending) if isinstance(node, _File) else _seen(node)
        for name, node in folder.now.items()
    }


def _left(folder: _Folder, random: Random, files: str, folders: str) -> Tree:
    """Return what a crash leaves of a folder."""
    kept = [c for c, is_kept in zip(folder.pending, _chosen(folder.pending, random, folders),
                                    strict=True) if is_kept]  # fmt: skip
    return {
        name: _left(node, random, files, folders)
        if isinstance(node, _Folder)
        else _torn(node, random, files)
        for name, node in _changed(folder.durable, kept).items()
    }


def _chosen(pending: list[_Change], random: Random, mood: str) -> list[bool]:
    count = len(pending)
    if mood == "some":
        return [random.random() < 0.5 for _ in range(count)]
    kept = {"none": 0, "all": count, "first": random.randint(0, count)}[mood]
    return [i < kept for i in range(count)]


def _changed(names: Mapping[str, _Node], changes: Iterable[_Change]) -> dict[str, _Node]:
    after = dict(names)
    for change in changes:
        if change.source is not None and after.get(change.source) is change.node:
            del after[change.source]
        if change.target is not None:
            after[change.target] = change.node
    return after


def _applied(data: bytes, effects: Iterable[tuple[int, bytes | None]]) -> bytes:
    after = bytearray(data)
    for at, piece in effects:
        if piece is None:
            del after[at:]
            after += bytes(at - len(after))
        else:
            after += bytes(at - len(after))
            after[at : at + len(piece)] = piece
    return bytes(after)


def _torn(file: _File, random: Random, mood: str) -> bytes:
    """Return what a crash leaves of a file: for each sector one of its contents, and some size."""
    pending = file.pending
    if not pending or mood == "none":
        return file.durable
    if mood == "all":
        return _applied(file.durable, pending)
    versions = [file.durable]
    for effect in pending:
        versions.append(_applied(versions[-1], [effect]))
    if mood == "first":
        last = random.randint(0, len(pending) - 1)
        before, after = versions[last], versions[last + 1]
        last_sector = -(-max(len(before), len(after)) // SECTOR)
        cut = random.randint(len(before) // SECTOR, last_sector) * SECTOR
        return after[:cut] + bytes(max(0, min(cut, len(before)) - len(after))) + before[cut:]
    size = len(random.choice(versions))
    newest = random.choice((0.1, 0.5, 0.9, 0.99))
    sectors = [
        _sector(versions, at, min(SECTOR, size - at), random, newest)
        for at in range(0, size, SECTOR)
    ]
    if sectors and random.random() < 0.3:  # the end is there, whatever is missing before it
        at = size - len(sectors[-1])
        sectors[-1] = _sector(versions[-1:], at, len(sectors[-1]), random, 1)
    return b"".join(sectors)


def _sector(versions: list[bytes], at: int, size: int, random: Random, newest: float) -> bytes:
    """Return one of the contents that a sector had; zeros where the file did not reach."""
    if random.random() < newest:
        version = versions[-1]
    else:
        version = random.choice((versions[0], random.choice(versions)))
    found = version[at : at + size]
    return found + bytes(size - len(found))
