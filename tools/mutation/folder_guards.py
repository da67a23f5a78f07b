"""What keeps a writer in its own folder: nobody else's file is written, replaced or believed."""

from __future__ import annotations

from mutation.mutant import Mutant

LOG = "semmap_log/log/"
FOLDER = "tests/log/test_folder.py"
THREADS = "tests/log/writing/test_threads.py"
CHAIN = "tests/log/writing/test_segment_chain.py"
DISK = "tests/faults/test_simulated_disk.py"
SALVAGE = "tests/log/salvage/test_salvage.py"


def _without(name: str, file: str, snippet: str, *tests: str, put: str = "pass") -> Mutant:
    return Mutant(name, LOG + file, snippet, put, tests)


FILES = (
    _without("no link is followed where it is written", "folder.py",
             "flags | NO_LINK | PLAIN", FOLDER, put="flags | PLAIN"),
    _without("no pipe is waited for", "file_calls.py",
             'PLAIN = getattr(os, "O_NONBLOCK", 0) |', FOLDER, put="PLAIN ="),
    _without("no pipe is read in a log's folder", "folder.py",
             "if not stat.S_ISREG(os.fstat(fd).st_mode):", FOLDER, put="if False:"),
    _without("a temporary file in a log's folder is new", "folder.py",
             "os.O_RDWR | os.O_CREAT | os.O_EXCL", FOLDER, put="os.O_RDWR | os.O_CREAT"),
    _without("a new segment replaces nothing", "folder.py",
             "os.link(self._at(temporary), self._at(name), **here, follow_symlinks=False)", FOLDER,
             put="os.replace(self._at(temporary), self._at(name), **here)"),
    _without("a new segment replaces nothing without hard links", "folder.py",
             "            if self.has(name):", FOLDER, put="            if False:"),
    _without("a new segment's name is safe before its other one goes", "folder.py",
             "        self.sync()  # before the other name goes: a power cut must leave one of the "
             "two\n        self.remove(temporary)\n", FOLDER,
             put="        self.remove(temporary)\n        self.sync()\n"),
    _without("sync of files of a log's folder altogether", "folder.py",
             "    try:\n        os.fsync(fd)\n    finally:", DISK,
             put="    try:\n        pass\n    finally:"),
    _without("sync of what is written whole", "folder.py",
             "                os.fsync(fd)\n            self.put(", FOLDER,
             put="            self.put("),
    _without("paths are those of the moment of opening", "folder.py",
             "Path(os.path.abspath(path))", FOLDER, put="path"),
    _without("files are found in the folder that is held", "folder.py",
             "return name if self._fd is not None else str(self.absolute / name)", FOLDER,
             put='return str(self.absolute / name) if name != "." else name'),
    _without("the folder that is held is listed", "folder.py",
             "at = self.absolute if self._fd is None else self._fd", FOLDER,
             put="at = self.absolute"),
    _without("a name is that of the open file", "folder.py",
             "return os.path.samestat(ours, self.status(name))", FOLDER, put="return True"),
    _without("a file that was written over is another version", "folder.py",
             "return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns", FOLDER,
             put="return status.st_dev, status.st_ino, 0, 0"),
)  # fmt: skip

LOCK_FILES = (
    _without("a lock file with one name", "lock.py", " or status.st_nlink > 1", FOLDER, put=""),
    _without("a lock file that is a file", "lock.py",
             "not stat.S_ISREG(status.st_mode) or ", FOLDER, put=""),
    _without("a lock file that is a link is explained", "lock.py",
             "if error.errno in {errno.ELOOP, errno.ENXIO}:", FOLDER, put="if False:"),
    _without("a free folder is looked at again under the lock", "writing/opening.py",
             "            _check_is_free(path, folder)  # again: somebody may have been quicker\n",
             FOLDER, put=""),
)  # fmt: skip

WRITES = (
    _without("a copy takes the place of what it is a copy of", "segment.py",
             "elif self.folder.identity(self.name) == replacing:", FOLDER, put="elif True:"),
    _without("one thread writes at a time", "segment.py",
             "        with self._writing:\n            self._begin_write()\n            if hold",
             THREADS, put="        if True:\n            self._begin_write()\n            if hold"),
    _without("nothing is written behind a gap", "segment.py",
             "        if self._is_broken:\n", THREADS, put="        if False:\n"),
    _without("a write that was interrupted leaves a gap", "segment.py",
             "        self._is_broken = True\n", THREADS, put=""),
    _without("a sync waits for who is writing", "segment.py",
             "        with self._writing:  # and whoever", THREADS,
             put="        if True:  # and whoever"),
    _without("a segment that was removed while it was written", "segment.py",
             "        if not status.st_nlink:", FOLDER, put="        if False:"),
    _without("a live segment that was cut is told at the next sync", "segment.py",
             "        if status.st_size < written:", FOLDER, put="        if False:"),
    _without("a live segment that was cut is told at its end", "segment.py",
             "        if os.fstat(self._fd).st_size != self.size:", FOLDER,
             put="        if False:"),
    _without("a copy that was exchanged takes no place", "segment.py",
             "        if self.folder.version(self.temporary) != self._version or", FOLDER,
             put="        if"),
    _without("a live segment is still there at its end", "segment.py",
             "if self.temporary is None and not self.folder.is_there(self.name, self._fd):",
             FOLDER, put="if False:"),
    _without("sync of all that a footer stands for", "segment.py",
             "        self._write(self._summary())\n        os.fsync(self._fd)\n", DISK,
             put="        self._write(self._summary())\n"),
    _without("closed segments are still what was written", "writing/segment_chain.py",
             "if not self.folder.has(name) or self.folder.version(name) != version:", FOLDER,
             put="if False:"),
    _without("closed segments that are gone are named", "writing/segment_chain.py",
             "not self.folder.has(name) or ", FOLDER, put=""),
    _without("what was closed is remembered", "writing/segment_chain.py",
             "            self._written[closed] = self.folder.version(closed)\n", FOLDER, put=""),
    _without("what was compacted is remembered", "writing/segment_chain.py",
             "            self._written[closed.name] = self.folder.version(closed.name)\n", CHAIN,
             put=""),
    _without("sync of a segment that somebody else closed", "writing/segment_chain.py",
             "            self.folder.sync_file(last.path.name)", DISK, put="            pass"),
    _without("a link in place of a kept tail", "writing/recovery.py",
             "while folder.has(kept) and not _holds(folder, kept, segment):", FOLDER,
             put="while False:"),
)  # fmt: skip

SWAPS = (
    _without("only what was recovered is exchanged", "salvage/swap.py",
             "    if not old.is_at(log):", SALVAGE, put="    if False:"),
    _without("a path leads to the folder that is held", "folder.py",
             'return os.path.samestat(self.status("."), os.stat(path))', SALVAGE,
             put="return path is not None"),
    _without("kept files that are a link", "salvage/swap.py",
             " and not path.is_symlink()", SALVAGE, put=""),
    _without("an unfinished recovery that is a link", "salvage/swap.py",
             "if folder.is_symlink() or not (folder / RECOVERING_NAME).exists():", SALVAGE,
             put="if not (folder / RECOVERING_NAME).exists():"),
    _without("an unfinished folder that is somebody else's", "salvage/swap.py",
             "if folder.is_symlink() or not (folder / RECOVERING_NAME).exists():", SALVAGE,
             put="if folder.is_symlink():"),
)  # fmt: skip

FOLDERS: tuple[Mutant, ...] = (*FILES, *LOCK_FILES, *WRITES, *SWAPS)
