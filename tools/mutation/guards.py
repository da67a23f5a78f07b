"""Every sync, lock, checksum, hash and refusal that a log's safety rests on, one by one.

What its answers and its pictures rest on is in the files beside this one.
"""

from __future__ import annotations

from mutation.asking_guards import ASKING
from mutation.belief_guards import BELIEFS
from mutation.checkpoint_guards import CHECKPOINTS
from mutation.closed_guards import CLOSED_PARTS
from mutation.command_guards import COMMAND_INDEXES
from mutation.costmap_guards import COSTMAPS
from mutation.folder_guards import FOLDERS
from mutation.foreign_guards import FOREIGN
from mutation.habit_guards import HABITS
from mutation.level_guards import LEVELS
from mutation.line_guards import LINES
from mutation.live_guards import LIVE_ROOMS
from mutation.moment_guards import MOMENTS
from mutation.mutant import Mutant
from mutation.newer_guards import NEWER
from mutation.picture_guards import PICTURES
from mutation.ros_mapping_guards import ROS_MAPPING
from mutation.seen_guards import SEEN
from mutation.serving_guards import SERVING

LOG = "semmap_log/log/"
DISK = "tests/faults/test_simulated_disk.py"
ERRORS = "tests/faults/test_syscalls.py"
DURABILITY = "tests/log/writing/test_durability.py"
RIVALS = "tests/faults/test_rivals.py"
FLIPS = "tests/faults/test_flips.py"
SEGMENTS = "tests/faults/test_segments.py"
INSIDE = "tests/faults/test_memory.py"
INTERRUPTED = "tests/faults/test_interrupted.py"
CLOCKS = "tests/faults/test_clocks.py"
RECOVERY = "tests/log/writing/test_recovery.py"
WRITER = "tests/log/writing/test_writer.py"
SCAN = "tests/log/reading/test_scan.py"
SET = "tests/log/reading/test_segment_set.py"
COMPACTION = "tests/log/compaction/test_compaction.py"
MERGE = "tests/log/compaction/test_compaction_merge.py"
WHOLE_FILES = "tests/log/test_whole_files.py"
GUARDED = "tests/log/test_guards.py"
INDEX = "tests/log/test_index.py"


def _without(name: str, file: str, snippet: str, *tests: str, put: str = "pass") -> Mutant:
    return Mutant(name, LOG + file, snippet, put, tests)


SYNCS = (
    _without("sync of a commit", "segment.py", "os.fdatasync(self._fd)", WRITER, DISK),
    _without("sync of a segment before it gets its name", "segment.py",
             "            os.fsync(self._fd)\n            self._version = version_of",
             DISK, put="            self._version = version_of"),
    _without("sync of the folder after a new segment got its name", "folder.py",
             "        self.sync()  # before the other name goes: a power cut must leave one of the "
             "two\n", WRITER, DISK, put=""),
    _without("sync of the folder after a copy took a segment's place", "folder.py",
             "dst_dir_fd=self._fd)\n        self.sync()", DISK, put="dst_dir_fd=self._fd)"),
    _without("sync of a file before it gets its name", "disk.py",
             "        sync_file(temporary)\n", DISK, put=""),
    _without("a temporary file of nobody else's", "disk.py",
             "os.O_CREAT | os.O_EXCL | NO_LINK", WHOLE_FILES, put="os.O_CREAT"),
    _without("no link in place of a temporary file", "disk.py",
             "os.open(path, os.O_WRONLY | NO_LINK | PLAIN)", WHOLE_FILES,
             put="os.open(path, os.O_WRONLY | PLAIN | os.O_CREAT)"),
    _without("no pipe or device is read back", "disk.py",
             "        raise NotOursError(mode)\n    fd =", WHOLE_FILES,
             put="        pass\n    fd ="),
    _without("no pipe or device is replaced", "disk.py",
             "    refuse_special(path)\n", WHOLE_FILES, put=""),
    _without("sync of the folder after a file got its name", "disk.py",
             "sync_folder(path.parent)", DISK),
    _without("sync of folders altogether", "disk.py",
             "FOLDER)\n    try:\n        os.fsync(fd)", WRITER, DISK,
             put="FOLDER)\n    try:\n        pass"),
    _without("sync of whole files altogether", "disk.py",
             "os.O_RDONLY | PLAIN)\n    try:\n        os.fsync(fd)", DISK,
             put="os.O_RDONLY | PLAIN)\n    try:\n        pass"),
    _without("sync of the folder in which a log is made", "writing/opening.py",
             "            sync_folder(path.parent)\n            return writer", DISK,
             put="            return writer"),
    _without("sync of the folder in which half a log was made", "writing/opening.py",
             "if _may_be_half_made(reader):", DISK, put="if False:"),
)  # fmt: skip

LOCKS = (
    _without("lock of the folder", "lock.py", "self._lock_folder(folder)", RIVALS),
    _without("lock of the lock file", "lock.py",
             "_no_lock_file(folder)\n        fcntl.flock(self._fds[-1], fcntl.LOCK_EX | "
             "fcntl.LOCK_NB)", RIVALS, put="_no_lock_file(folder)"),
    _without("unlocking in the process that locked alone", "lock.py",
             "if os.getpid() == self._pid:", RIVALS, put="if True:"),
    _without("unlocking though a child has the file open", "lock.py",
             "fcntl.flock(fd, fcntl.LOCK_UN)", RIVALS),
    _without("refusal of a forked child's append", "writing/writer.py",
             "if os.getpid() != self._pid:", RIVALS, put="if False:"),
    _without("leaving the segment to the parent when a child closes", "writing/writer.py",
             "if os.getpid() == self._pid:", RIVALS, put="if True:"),
    _without("lock before leftovers are removed", "writing/opening.py",
             '    with _told_as_access_error(path, "cannot be opened"), _held(path) as (folder, '
             "lock):\n        folder.remove_leftovers()", RIVALS,
             put="    LogFolder(path).remove_leftovers()\n"
             '    with _told_as_access_error(path, "cannot be opened"), '
             "_held(path) as (folder, lock):"),
    Mutant("one thread at a time", "semmap_log/appendable_log.py", "threading.RLock()",
           '__import__("contextlib").nullcontext()', (RIVALS, DURABILITY)),
)  # fmt: skip

CHECKSUMS = (
    _without("CRC of a chunk", "chunks.py", "    if zlib.crc32(records) != crc:", SCAN, FLIPS,
             put="    if False:"),
    _without("CRC of a summary", "reading/closed_summary.py",
             "if zlib.crc32(data[DATA_END_BYTES : len(data) - len(mcap.MAGIC) - 4]) != crc:",
             SCAN, FLIPS,
             put="if False:"),
    _without("digest of a segment's head", "header.py",
             'if entries.pop(DIGEST_KEY, "") != _digest(entries):', GUARDED, SEGMENTS, FLIPS,
             put="if entries.pop(DIGEST_KEY, None) is None:"),
    _without("hash of the commit before, between commits", "reading/reader.py",
             "if commit.previous_hash != previous:", GUARDED, SCAN,
             put="if False:"),
    _without("hash of the commit before, in a live segment", "reading/grammar.py",
             'unchained = (commits["previous_hash"] != hashes).any(axis=1)', GUARDED,
             SCAN, put="unchained = np.zeros(len(hashes), np.bool_)"),
    _without("hash of the commit before, between segments", "reading/segment_set.py",
             "if segment.header.hash_so_far != head:", SET, put="if False:"),
    _without("records of a commit in its hash", "commits.py",
             '        whole.update(channel.to_bytes(2, "little") + digest)', GUARDED,
             put="        pass"),
)  # fmt: skip

COMPUTED_ONCE = (
    Mutant("values that are computed without a lock", "semmap_log/computed_once.py",
           "self.lock = nullcontext()", "pass", ("tests/test_computed_once.py",)),
)  # fmt: skip

SIZES = (
    _without("size of a chunk's records", "chunks.py", "if len(plain) != self.size:",
             GUARDED, FLIPS, put="if False:"),
    _without("stored size of a chunk in its record", "chunks.py",
             "if at + 8 + stored_size != offset - base + length:", GUARDED, FLIPS,
             put="if False:"),
    _without("limit of a chunk's size", "chunks.py", "if size > most_unpacked(stored_size):",
             GUARDED, put="if False:"),
    _without("limit of a chunk's size in a summary", "reading/chunk_table.py",
             'if ((rows["size"] < 0) | (rows["size"] > most)).any():', GUARDED, put="if False:"),
    _without("limit of an lz4 chunk", "chunks.py", "bytes(stored), max_length=size + 1)", GUARDED,
             put="bytes(stored))"),
    _without("limit of an event's record", "commits.py", "if len(record) > MOST_EVENT_BYTES:",
             WRITER, put="if False:"),
    _without("limit of a note's texts", "commits.py", "if said > MOST_NOTE_CHARACTERS:",
             WRITER, put="if False:"),
    _without("limit of a packed index", "header.py",
             "unpacker.decompress(data, most + 1)", INDEX,
             put="unpacker.decompress(data)"),
    _without("columns of an index of one length", "reading/happened_spans.py",
             "if len({len(column) for column in columns}) > 1:", INDEX, put="if False:"),
    _without("messages that tile a chunk", "walking.py",
             "if opcode != Opcode.MESSAGE or length < least:", GUARDED,
             put="if False:"),
    _without("times in a chunk's head", "reading/page_reading.py",
             'place = first_misfit(page.heads["log_time"], ends, rows)', GUARDED,
             put="place = None"),
    _without("heads of chunks against the summary", "reading/chunk_table.py",
             "if _head_of(chunk) != row.item()[:-2]:", GUARDED, put="if False:"),
    _without("event numbers without gaps in a live segment", "reading/grammar.py",
             "self._sequence != ((numbers - 1) & _SEQUENCE_MASK).astype(np.uint32)", GUARDED,
             SCAN, put="np.zeros(len(numbers), np.bool_)"),
    _without("log times that grow in a live segment", "reading/grammar.py",
             "step < (self._channel != KEYFRAME_CHANNEL)", GUARDED,
             SCAN, put="np.zeros(len(self._log_time), np.bool_)"),
    _without("commits that count their events", "reading/grammar.py",
             '(commits["count"] != reached - first)', GUARDED, SCAN,
             put='(commits["count"] == 0)'),
)  # fmt: skip

CUT = "tests/log/test_shortened_files.py"
BAD = "tests/log/test_bad_sectors.py"
MAPPED = "tests/log/reading/test_mapping.py"

BYTES = (
    _without("a file that ends before it should", "reading/mapping.py", "            if not got:\n",
             CUT, put="            if not got:\n                break\n            if not got:\n"),
    _without("another file of the same name", "reading/mapping.py",
             "if (status.st_dev, status.st_ino) == self.identity:", MAPPED, put="if True:"),
    _without("a copy that ends before it should", "reading/mapping.py",
             "        if copied < len(target):", MAPPED, put="        if False:"),
    _without("a page alone, where reading many failed", "reading/mapping.py",
             "return read_page_into(fd, target, at)", MAPPED, put="raise"),
    _without("pages asked for before they are looked at", "reading/mapped_memory.py",
             "    while not _are_there(source, size):", CUT, put="    while False:"),
    _without("CRCs of chunks whose file has lost its name", "reading/segment_reading.py",
             "wanted.are_small and segment.source.is_guarded", MAPPED, put="wanted.are_small"),
    _without("message indexes between their chunks", "reading/chunk_table.py",
             "if (behind[:-1] > offset[1:]).any():", GUARDED, put="if False:"),
    _without("an end that cannot be read, of a closed segment", "verification/files.py",
             " or status.st_size in [end for _, end in data.unreadable]", BAD, put=""),
    _without("a head that cannot be read", "verification/files.py",
             "if not (_is_ours(head) or is_named_like_ours):", BAD, put="if not _is_ours(head):"),
    _without("pages that the disk refuses, told", "verification/run.py",
             'self._damage("unreadable", start', BAD, put='print("unreadable", start'),
)  # fmt: skip

SEGMENTS_OF_A_LOG = (
    _without("segments of one log", "reading/segment_set.py", "if len(ids) < 2:", SET, SEGMENTS,
             put="if True:"),
    _without("segments without a gap", "reading/segment_set.py",
             "if segment.header.number > expected:", SET, SEGMENTS, put="if False:"),
    _without("first events that fit", "reading/segment_set.py",
             "if segment.header.first_event != next_event:", GUARDED, put="if False:"),
    _without("a segment that was cut and is not the last", "reading/segment_set.py",
             "if not segment.closed:", SET, SEGMENTS, put="if False:"),
    _without("a segment that is there twice", "reading/segment_set.py",
             "_check_leftover(segment, segments)", SEGMENTS, SET),
    _without("commits that prove what was durable", "reading/live_scan.py",
             "behind.durable_before > scan.place.committed", SCAN, FLIPS, put="False"),
    _without("a head that was on the disk", "reading/live_scan.py",
             "or not scan.whole  # the head", GUARDED, SCAN,
             put="or False  # the head"),
)  # fmt: skip

REFUSALS = (
    _without("poison after a failed write", "writing/writer.py",
             "            raise self._poisoned(error.strerror, command_id) from error",
             DURABILITY, WRITER, ERRORS,
             put="            self._in_commit = False\n            raise"),
    _without("poison after a sync that did not end",
             "writing/durability.py", "self.is_broken = True",
             DURABILITY),
    _without("no second try of a sync", "writing/durability.py", "            if self.is_broken:",
             GUARDED, put="            if False:"),
    _without("poison after an interrupt in a commit", "writing/writer.py",
             '            self._poisoned("interrupted in the middle of a commit")',
             INSIDE, WRITER, put="            self._in_commit = False"),
    _without("a poisoned writer's segment left as it is", "writing/writer.py",
             "if self._poison or self._in_commit or self._syncs.is_broken:", WRITER, INSIDE, ERRORS,
             put="if False:"),
    _without("no append in an append", "writing/writer.py", "        if self._busy:",
             "tests/test_misuse.py", put="        if False:"),
    _without("no append after close",
             "writing/writer.py", "        if not self._open:\n            raise",
             "tests/test_misuse.py", WRITER, put="        if False:\n            raise"),
    Mutant("what an interrupt left behind", "semmap_log/appendable_log.py",
           "if self._taken_in != self._writer.next_event:", "if False:", (INTERRUPTED,)),
    _without("recorded times that grow",
             "writing/writer.py", "max(wall_ns, self.last_ns + 1),", CLOCKS,
             WRITER, put="wall_ns,"),
    _without("clocks before 1970", "clock.py", "min(max(clock.wall_ns(), 0), _LATEST_NS)", CLOCKS,
             put="min(clock.wall_ns(), _LATEST_NS)"),
    _without("clocks at the end of time", "clock.py", "min(max(clock.wall_ns(), 0), _LATEST_NS)",
             CLOCKS, put="max(clock.wall_ns(), 0)"),
    _without("whole writes", "disk.py",
             "    while view:\n        view = view[os.write(fd, view) :]", ERRORS, DURABILITY,
             put="    pass"),
    _without("a torn tail that is kept",
             "writing/recovery.py", "        keep_torn_tail(folder, segment)", RECOVERY,
             put="        pass"),
    _without("a compacted copy that is compared",
             "compaction/rechunk.py", "if whole.digest() != digest:",
             COMPACTION, MERGE, put="if False:"),
)  # fmt: skip

APPENDED = "tests/test_appending_batches.py"
COMMANDS = "semmap_log/commands.py"

COLUMNS = (
    Mutant("values of columns", COMMANDS, "        batch.check()\n", "", (APPENDED,)),
    Mutant("doors of columns that are not in the map", COMMANDS,
           "harmless &= ~np.isin(ids, list(doors - self.roster.placed.keys()))", "pass",
           (APPENDED,)),
    Mutant("early events of columns", COMMANDS, "            self._note_early_rows(part)\n", "",
           ("tests/test_backdating.py",)),
    Mutant("early events one by one", COMMANDS,
           "        self._note_early(event)\n        return event\n",
           "        return event\n", ("tests/test_backdating.py",)),
    Mutant("an id is told again in the commit that retracts it only", COMMANDS,
           "        if door_id in self._taken_back:\n", "        if False:\n",
           ("tests/test_backdating.py",)),
    Mutant("a correction of an adding moves it back only", COMMANDS,
           "if event.happened_ns is None or event.happened_ns > before_ns:", "if False:",
           ("tests/test_backdating.py",)),
    Mutant("what is told of the very moment counts", "semmap_log/backdating.py",
           "since_ns - (door_id in told_of)", "since_ns", ("tests/test_backdating.py",)),
    Mutant("unknown keywords", "semmap_log/keywords.py",
           "if kwargs and not kwargs.keys() <= known.keys():", "if False:",
           ("tests/test_keywords.py",)),
    Mutant("truth values are no numbers", "semmap_log/events.py",
           "if type(value) is not float and not is_number(value):", "if False:",
           ("tests/test_keywords.py",)),
    Mutant("seconds are no nanoseconds", "semmap_log/door_log.py",
           "        if not is_whole_number(time):\n", "        if False:\n",
           ("tests/test_keywords.py",)),
    Mutant("doors that columns take out of the map", COMMANDS,
           'harmless &= ~np.isin(ids, batch[DoorRemoved]["door_id"])', "pass", (APPENDED,)),
    Mutant("texts of a CSV compared behind their keys", "semmap_log/formats/text_column.py",
           "return codes if same.all() else None", "return codes",
           ("tests/formats/test_csv_columns.py",)),
)  # fmt: skip

ZERO = "tests/test_door_zero.py"
REPLAYED = "tests/test_replay.py"
BATCH = "semmap_log/event_batch.py"
DOOR_MAP = "semmap_log/projections/door_map.py"

DOOR_0 = (
    Mutant("door 0: its events in the map", DOOR_MAP, "            rows[about_0] = self._row(0)\n",
           "            pass\n", (REPLAYED,)),
    Mutant("door 0: no row of what is about none", DOOR_MAP,
           "            state._row_by_id[0] = NOBODY\n", "", (ZERO, REPLAYED)),
    Mutant("door 0: found among what is about none", BATCH,
           "if zeros == sum(np.count_nonzero(self.kind == kind) for kind in others):", "if True:",
           (REPLAYED,)),
    Mutant("door 0: its events alone", BATCH, "found & self.about_doors() if 0 in doors else found",
           "found", (ZERO,)),
    Mutant("door 0: what is about none in an excerpt", "semmap_log/views/excerpt/excerpt.py",
           "batch.of_doors(self.doors) | ~batch.about_doors()", "batch.of_doors(self.doors)",
           (ZERO,)),
    Mutant("door 0: taken back", "semmap_log/views/rerun/taken_back.py",
           "batch.door_ids()[batch.about_doors()]", "batch.door_ids()", (ZERO,)),
    Mutant("door 0: drawn", "semmap_log/projections/door_layer.py",
           "batch.door_ids()[batch.about_doors()]",
           "batch.door_ids()[batch.door_ids() > 0]", ("tests/costmaps/test_over_time.py",)),
)  # fmt: skip

RETRACTING = "tests/test_retracting.py"
PLANNED = "tests/formats/test_importing.py"

BROUGHT_BACK = (
    Mutant("brought back: in the map within the commit", COMMANDS,
           "self.placed[door_id], self.level_of[door_id] = removal.was_placed, removal.level",
           "pass", (RETRACTING,)),
    Mutant("brought back: without a place as before", COMMANDS,
           "= removal.was_placed, removal.level", "= True, removal.level",
           (RETRACTING,)),
    Mutant("brought back: not where its adding may be gone", COMMANDS,
           "if removal.event == event.first_event)",
           "if event.first_event <= removal.event <= event.last_event)", (RETRACTING,)),
    Mutant("brought back: how, in words", COMMANDS, "if removal is None:", "if removal:",
           (RETRACTING,)),
    Mutant("brought back: what differs is written", "semmap_log/formats/importing.py",
           "yield from self.update_of(door, removed.door, names)", "pass", (PLANNED,)),
    Mutant("brought back: a new id where one is asked for", "semmap_log/formats/importing.py",
           "not self.update or self.renumber:", "not self.update:", (PLANNED,)),
    Mutant("brought back: not where the adding was taken back",
           "semmap_log/live/serving/yaml_start.py", "    if gone:\n", "    if False:\n",
           ("tests/live/serving/test_yaml_start.py",)),
    Mutant("a door that was removed, named by its id", "semmap_log/appendable_log.py",
           "                if removed:\n", "                if False:\n",
           (RETRACTING,)),
)  # fmt: skip

GUARDS: tuple[Mutant, ...] = (
    *SYNCS, *LOCKS, *CHECKSUMS, *SIZES, *COMPUTED_ONCE, *BYTES, *SEGMENTS_OF_A_LOG, *REFUSALS,
    *COLUMNS, *FOLDERS, *CLOSED_PARTS, *COMMAND_INDEXES,
    *CHECKPOINTS, *MOMENTS, *COSTMAPS, *BELIEFS, *PICTURES, *SEEN, *SERVING, *ROS_MAPPING,
    *FOREIGN, *LIVE_ROOMS, *DOOR_0, *BROUGHT_BACK, *LEVELS, *NEWER, *LINES, *HABITS, *ASKING,
)  # fmt: skip
