"""What keeps a writer in its own folder: nobody else's file is written, replaced or believed."""

from __future__ import annotations

from mutation.mutant import Mutant, guard

FILES = (
    guard("no link is followed where it is written", "LogFolder.open",
          "flags | NO_LINK", "flags", "test_folder"),
    guard("no pipe is waited for", "PLAIN",
          'getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)',
          'getattr(os, "O_CLOEXEC", 0)', "test_folder"),
    guard("no pipe is read in a log's folder", "LogFolder.regular_file",
          "not stat.S_ISREG(os.fstat(fd).st_mode)", "False", "test_folder"),
    guard("a temporary file in a log's folder is new", "_NEW",
          "os.O_RDWR | os.O_CREAT | os.O_EXCL", "os.O_RDWR | os.O_CREAT",
          "test_folder"),
    guard("a new segment replaces nothing", "LogFolder.put_new",
          "os.link(self._at(temporary), self._at(name), **here, follow_symlinks=False)",
          "os.replace(self._at(temporary), self._at(name), **here)",
          "test_folder"),
    guard("a new segment replaces nothing without hard links", "LogFolder.put_new",
          "self.has(name)", "False", "test_folder"),
    guard("a new segment's name is safe before its other one goes", "LogFolder.put_new",
          "self.sync()\n"
          "self.remove(temporary)", "self.remove(temporary)\n"
          "self.sync()", "test_folder"),
    guard("sync of files of a log's folder altogether", "_synced",
          "os.fsync(fd)", "", "test_simulated_disk"),
    guard("sync of what is written whole", "LogFolder.write_whole",
          "os.fsync(fd)", "", "test_folder"),
    guard("paths are those of the moment of opening", "LogFolder.__init__",
          "Path(os.path.abspath(path))", "path", "test_folder"),
    guard("files are found in the folder that is held", "LogFolder._at",
          "name if self._fd is not None else str(self.absolute / name)",
          'str(self.absolute / name) if name != "." else name',
          "test_folder"),
    guard("the folder that is held is listed", "LogFolder.files",
          "self.absolute if self._fd is None else self._fd", "self.absolute",
          "test_folder"),
    guard("a name is that of the open file", "LogFolder.is_there",
          "os.path.samestat(ours, self.status(name))", "True",
          "test_folder"),
    guard("a file that was written over is another version", "folder.version_of",
          "status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns",
          "status.st_dev, status.st_ino, 0, 0", "test_folder"),
)  # fmt: skip

LOCK_FILES = (
    guard("a lock file with one name", "lock._checked",
          "status.st_nlink > 1", "False", "test_folder"),
    guard("a lock file that is a file", "lock._checked",
          "not stat.S_ISREG(status.st_mode)", "False", "test_folder"),
    guard("a lock file that is a link is explained", "lock._opened_there",
          "error.errno in {errno.ELOOP, errno.ENXIO}", "False",
          "test_folder"),
    guard("a free folder is looked at again under the lock", "create_log",
          "_check_is_free(path, folder)", "", "test_folder"),
)  # fmt: skip

WRITES = (
    guard("a copy takes the place of what it is a copy of", "SegmentWriter.install",
          "self.folder.identity(self.name) == replacing", "True",
          "test_folder"),
    guard("one thread writes at a time", "SegmentWriter.add",
          "with self._writing:\n"
          "    self._begin_write()\n"
          "    if hold_back:\n"
          "        self._hold_back(data)\n"
          "    else:\n"
          "        self._write(data)\n"
          "    self._is_broken = False", "if True:\n"
          "    self._begin_write()\n"
          "    if hold_back:\n"
          "        self._hold_back(data)\n"
          "    else:\n"
          "        self._write(data)\n"
          "    self._is_broken = False", "writing.test_threads"),
    guard("nothing is written behind a gap", "SegmentWriter._begin_write",
          "self._is_broken", "False", "writing.test_threads"),
    guard("a write that was interrupted leaves a gap", "SegmentWriter._begin_write",
          "self._is_broken = True", "", "writing.test_threads"),
    guard("a sync waits for who is writing", "SegmentWriter.sync",
          "with self._writing:\n"
          "    self._begin_write()\n"
          "    self._flush()\n"
          "    written = self.size\n"
          "    self._is_broken = False", "if True:\n"
          "    self._begin_write()\n"
          "    self._flush()\n"
          "    written = self.size\n"
          "    self._is_broken = False", "writing.test_threads"),
    guard("a segment that was removed while it was written", "SegmentWriter.sync",
          "not status.st_nlink", "False", "test_folder"),
    guard("a live segment that was cut is told at the next sync", "SegmentWriter.sync",
          "status.st_size < written", "False", "test_folder"),
    guard("a live segment that was cut is told at its end", "SegmentWriter._close",
          "os.fstat(self._fd).st_size != self.size", "False",
          "test_folder"),
    guard("a copy that was exchanged takes no place", "SegmentWriter.install",
          "self.folder.version(self.temporary) != self._version", "False",
          "test_folder"),
    guard("a live segment is still there at its end", "SegmentWriter._close",
          "self.temporary is None and not self.folder.is_there(self.name, self._fd)", "False",
          "test_folder"),
    guard("sync of all that a footer stands for", "SegmentWriter._close",
          "os.fsync(self._fd)\n"
          "self._write(mcap.MAGIC)", "self._write(mcap.MAGIC)",
          "test_simulated_disk"),
    guard("closed segments are still what was written", "SegmentChain._check_written",
          "not self.folder.has(name) or self.folder.version(name) != version", "False",
          "test_folder"),
    guard("closed segments that are gone are named", "SegmentChain._check_written",
          "not self.folder.has(name)", "False", "test_folder"),
    guard("what was closed is remembered", "SegmentChain._check_written",
          "self._written[closed] = self.folder.version(closed)", "",
          "test_folder"),
    guard("what was compacted is remembered", "SegmentChain._compacted",
          "self._written[closed.name] = self.folder.version(closed.name)", "",
          "test_segment_chain"),
    guard("sync of a segment that somebody else closed", "SegmentChain.take_up",
          "self.folder.sync_file(last.path.name)", "", "test_simulated_disk"),
    guard("a link in place of a kept tail", "keep_torn_tail",
          "folder.has(kept) and not _holds(folder, kept, segment)", "False",
          "test_folder"),
)  # fmt: skip

SWAPS = (
    guard("only what was recovered is exchanged", "take_place",
          "not old.is_at(log)", "False", "test_salvage"),
    guard("a path leads to the folder that is held", "LogFolder.is_at",
          'os.path.samestat(self.status("."), os.stat(path))', "path is not None",
          "test_salvage"),
    guard("kept files that are a link", "_last_kept",
          "not path.is_symlink()", "True", "test_salvage"),
    guard("an unfinished recovery that is a link", "new_folder_beside",
          "folder.is_symlink() or not (folder / RECOVERING_NAME).exists()",
          "not (folder / RECOVERING_NAME).exists()", "test_salvage"),
    guard("an unfinished folder that is somebody else's", "new_folder_beside",
          "not (folder / RECOVERING_NAME).exists()", "False",
          "test_salvage"),
)  # fmt: skip

FOLDERS: tuple[Mutant, ...] = (*FILES, *LOCK_FILES, *WRITES, *SWAPS)
