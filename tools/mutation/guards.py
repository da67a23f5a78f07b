"""Every sync, lock, checksum, hash and refusal that a log's safety rests on, one by one.

What its answers and its pictures rest on is in the files beside this one.
"""

from __future__ import annotations

from mutation.appending_guards import APPENDING
from mutation.asking_guards import ASKING
from mutation.belief_guards import BELIEFS
from mutation.checkpoint_guards import CHECKPOINTS
from mutation.closed_guards import CLOSED_PARTS
from mutation.command_guards import COMMAND_INDEXES
from mutation.costmap_guards import COSTMAPS
from mutation.experiment_guards import EXPERIMENT
from mutation.experiment_table_guards import EXPERIMENT_TABLES
from mutation.fleet_guards import FLEETS
from mutation.folder_guards import FOLDERS
from mutation.foreign_guards import FOREIGN
from mutation.habit_guards import HABITS
from mutation.index_guards import INDEX
from mutation.join_guards import JOINS
from mutation.keeping_guards import KEEPING
from mutation.kernel_guards import KERNELS
from mutation.laser_input_guards import LASER_INPUT
from mutation.level_guards import LEVELS
from mutation.line_guards import LINES
from mutation.live_guards import LIVE_ROOMS
from mutation.moment_guards import MOMENTS
from mutation.mutant import Mutant, guard
from mutation.newer_guards import NEWER
from mutation.object_guards import OBJECTS
from mutation.oprs_guards import OPRS
from mutation.picture_guards import PICTURES
from mutation.planner_file_guards import PLANNER_FILES
from mutation.planner_guards import PLANNERS
from mutation.planning_guards import PLANNING
from mutation.proposal_guards import PROPOSALS
from mutation.query_guards import QUERIES
from mutation.rebase_guards import REBASES
from mutation.room_guards import ROOMS
from mutation.ros_mapping_guards import ROS_MAPPING
from mutation.scan_guards import SCANS
from mutation.seen_guards import SEEN
from mutation.serving_guards import SERVING
from mutation.sighting_guards import SIGHTINGS
from mutation.signing_guards import SIGNING
from mutation.store_guards import STORES
from mutation.table_guards import TABLES
from mutation.trimming_guards import TRIMMING

SYNCS = (
    guard("sync of a commit", "SegmentWriter.sync",
          "os.fdatasync(self._fd)", "", "test_writer", "test_simulated_disk"),
    guard("sync of a segment before it gets its name", "SegmentWriter.install",
          "os.fsync(self._fd)", "", "test_simulated_disk"),
    guard("sync of the folder after a new segment got its name", "LogFolder.put_new",
          "self.sync()", "", "test_writer", "test_simulated_disk"),
    guard("sync of the folder after a copy took a segment's place", "LogFolder.put",
          "self.sync()", "", "test_simulated_disk"),
    guard("sync of a file before it gets its name", "whole_file",
          "sync_file(temporary)", "", "test_simulated_disk"),
    guard("a temporary file of nobody else's", "_make_file",
          "os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_LINK", "os.O_WRONLY | os.O_CREAT",
          "test_whole_files"),
    guard("no link in place of a temporary file", "_new_file",
          "os.O_WRONLY | NO_LINK | PLAIN", "os.O_WRONLY | PLAIN | os.O_CREAT",
          "test_whole_files"),
    guard("no pipe or device is read back", "read_own",
          "if not stat.S_ISREG(mode := path.lstat().st_mode): raise NotOursError(mode)",
          "if not stat.S_ISREG(mode := path.lstat().st_mode): pass",
          "test_whole_files"),
    guard("no pipe or device is replaced", "whole_file",
          "refuse_special(path)", "", "test_whole_files"),
    guard("sync of the folder after a file got its name", "_give_name",
          "sync_folder(path.parent)", "", "test_simulated_disk"),
    guard("sync of folders altogether", "sync_folder",
          "os.fsync(fd)", "", "test_writer", "test_simulated_disk"),
    guard("sync of whole files altogether", "disk.sync_file",
          "os.fsync(fd)", "", "test_simulated_disk"),
    guard("sync of the folder in which a log is made", "create_log",
          "sync_folder(path.parent)", "", "test_simulated_disk"),
    guard("sync of the folder in which half a log was made", "_taken_up",
          "_may_be_half_made(reader)", "False", "test_simulated_disk"),
)  # fmt: skip

LOCKS = (
    guard("lock of the folder", "WriterLock.__init__",
          "self._lock_folder(folder, is_new=is_new)", "", "test_rivals"),
    guard("lock of the lock file", "WriterLock._lock_file",
          "not is_ours and not (is_public and self._is_strangers(fd, folder))", "False",
          "test_rivals"),
    guard("a lock file that strangers cannot read", "lock._PRIVATE", "0o600", "0o644", "test_lock"),
    guard("one that they can read is replaced", "WriterLock._lock_file",
          "is_public and not self._make_private(folder, fd, status) and not is_ours",
          "is_public and not is_ours", "test_lock"),
    guard("a lock of who may write is no stranger's", "WriterLock._lock_file",
          "is_public and self._is_strangers(fd, folder)", "is_public", "test_lock"),
    guard("a lock file that was exchanged is not locked", "WriterLock._lock_file",
          "not folder.is_there(LOCK_NAME, fd)", "False", "test_lock"),
    guard("one replaces a lock file at a time", "WriterLock._make_private",
          "not _try_lock(new) or not folder.is_there(NEW_LOCK_NAME, new)", "False", "test_lock"),
    guard("a stranger's lock of the folder keeps nobody out", "WriterLock._lock_folder",
          "is_strangers or (is_strangers is None and not is_new)", "False", "test_lock"),
    guard("the folder's lock counts where there was no lock file", "WriterLock._lock_folder",
          "is_strangers is None and not is_new", "is_strangers is None", "test_lock"),
    guard("a replaced lock file keeps its owner", "_takes_after",
          "os.fchown(fd, old.st_uid, gid)", "", "test_lock"),
    guard("unlocking in the process that locked alone", "WriterLock.release",
          "os.getpid() == self._pid", "True", "test_rivals"),
    guard("unlocking though a child has the file open", "WriterLock.release",
          "fcntl.flock(fd, fcntl.LOCK_UN)", "", "test_rivals"),
    guard("refusal of a forked child's append", "LogWriter._check_process",
          "os.getpid() != self._pid", "False", "test_rivals"),
    guard("leaving the segment to the parent when a child closes", "LogWriter.close",
          "os.getpid() == self._pid", "True", "test_rivals"),
    guard("lock before leftovers are removed", "open_for_append",
          'with _told_as_access_error(path, "cannot be opened"), _held(path) as (folder, lock):\n'
          "    folder.remove_leftovers()\n"
          "    return _taken_up(folder, lock, new_keyframes, environment)",
          "LogFolder(path).remove_leftovers()\n"
          'with _told_as_access_error(path, "cannot be opened"), _held(path) as (folder, lock):\n'
          "    return _taken_up(folder, lock, new_keyframes, environment)",
          "test_rivals"),
    guard("a writer that nobody gets is closed", "_closed_on_error",
          "writer.close()", "", "test_writer_opening"),
    guard("a log that was made whole is read as it is then", "_taken_up",
          "reader.refresh()", "", "test_writer_opening"),
    guard("one thread at a time", "Appender.__init__",
          "threading.RLock", '__import__("contextlib").nullcontext',
          "test_rivals", "test_durability"),
)  # fmt: skip

CHECKSUMS = (
    guard("CRC of a chunk", "check_crc",
          "crc32(records) != crc", "False", "reading.test_scan", "test_flips"),
    guard("CRC of a summary", "closed_summary.read_summary",
          "crc32(data[DATA_END_BYTES : len(data) - len(mcap.MAGIC) - 4]) != crc", "False",
          "reading.test_scan", "test_flips"),
    guard("digest of a segment's head", "header._checked",
          'entries.pop(DIGEST_KEY, "") != _digest(entries)',
          "entries.pop(DIGEST_KEY, None) is None", "test_guards", "test_segments", "test_flips"),
    guard("hash of the commit before, between commits", "LogReader.commits",
          "commit.previous_hash != previous", "False", "test_guards", "reading.test_scan"),
    guard("hash of the commit before, in a live segment", "Reading._misfits_of_commits",
          '(commits["previous_hash"] != hashes).any(axis=1)', "np.zeros(len(hashes), np.bool_)",
          "test_guards", "reading.test_scan"),
    guard("hash of the commit before, between segments", "_check_begins",
          "segment.header.hash_so_far != head", "False", "test_segment_set"),
    guard("records of a commit in its hash", "commit_records.commit_hash",
          'whole.update(channel.to_bytes(2, "little") + digest)', "",
          "test_guards"),
)  # fmt: skip

COMPUTED_ONCE = (
    guard("values that are computed without a lock", "computed_once.__init__",
          "self.lock = nullcontext()", "", "test_computed_once"),
    guard("a late dataclass's slots are shadowed by no default", "_Recipe.__init__",
          "name not in fields", "name not in slots", "test_lazily"),
    guard("what was made, and wrapped, is not made again", "_Recipe.follow",
          "isinstance(held, _Late)", "(name in _FIRST or isinstance(held, _Late))",
          "test_keywords"),
    guard("numbers of a column, each once", "distinct.distinct",
          "ascending[:-1]", "ascending[1:]", "test_distinct"),
    guard("what is counted of a segment", "Statistics.read",
          "counts[channel] = stream.read8()", "counts[channel] = stream.count",
          "test_opening_records"),
)  # fmt: skip

SIZES = (
    guard("size of a chunk's records", "unpack_records",
          "len(plain) != size", "False", "test_guards", "test_flips"),
    guard("records that are packed very small", "_records_in_zstd",
          "size > CLOSE_RATIO * len(stored)", "False", "test_chunk_unpacking"),
    guard("records of one time", "_check_messages",
          "not_after > MOST_AT_ONCE", "False", "test_chunk_unpacking"),
    guard("sizes of all chunks in a summary", "chunk_table._check_rows",
          'check_sizes(int(rows["size"].sum()), int(rows["stored_size"].sum()))', "",
          "test_chunk_unpacking"),
    guard("stored size of a chunk in its record", "read_chunk_head",
          "at + 8 + stored_size != offset - base + length", "False",
          "test_guards", "test_flips"),
    guard("limit of a chunk's size", "read_chunk_head",
          "size > most_unpacked(stored_size)", "False", "test_guards"),
    guard("limit of a chunk's size in a summary", "chunk_table._check_rows",
          '((rows["size"] < 0) | (rows["size"] > most)).any()', "False",
          "test_guards"),
    guard("limit of an lz4 chunk", "_records_in_lz4", "max_length=size + 1", "", "test_guards"),
    guard("limit of an event's record", "CommitBuilder._object",
          "len(record) > MOST_EVENT_BYTES", "False", "test_writer"),
    guard("limit of a note's texts", "Note.check_length",
          "length > MOST_NOTE_CHARACTERS", "False", "test_writer"),
    guard("limit of a packed index", "inflated",
          "unpacker.decompress(data, most + 1)", "unpacker.decompress(data)",
          "test_index"),
    guard("columns of an index of one length", "spans_of_summary",
          "len({len(column) for column in columns}) > 1", "False",
          "test_index"),
    guard("messages that tile a chunk", "record_scan.walk",
          "opcode != Opcode.MESSAGE or length < least", "False",
          "test_guards"),
    guard("times in a chunk's head", "_violation",
          "first_violation(chunks.least_ns, chunks.greatest_ns, rows)", "None",
          "test_guards"),
    guard("compiled loops of another interface", "loops.compiled",
          'getattr(found, "INTERFACE", None) != INTERFACE', "False", "test_turning_off"),
    guard("messages of a wrong length, found by a compiled loop", "compiled_scan.compiled_scan",
          "None if has_wrong_length else fields.chosen(slice(events))",
          "fields.chosen(slice(events))", "test_compiled_scan"),
    guard("numbers that a compiled loop would overflow", "compiled_scan.compiled_scan",
          "0 <= first_event < _MOST_FIRST_EVENT", "True", "test_compiled_scan"),
    guard("messages of a wrong length", "Page._check_lengths",
          "len(wrong)", "False", "reading.test_scan", "test_compiled_scan"),
    guard("heads of chunks against the summary", "_chunk_in",
          "_head_of(chunk) != row.item()[:-2]", "False", "test_guards"),
    guard("event numbers without gaps in a live segment", "Reading._violations",
          "self._sequence != ((numbers - 1) & _SEQUENCE_MASK).astype(np.uint32)",
          "np.zeros(len(numbers), np.bool_)", "test_guards", "reading.test_scan"),
    guard("log times that grow in a live segment", "Reading._is_too_early",
          "step < (self._channel != KEYFRAME_CHANNEL)", "np.zeros(len(self._log_time), np.bool_)",
          "test_guards", "reading.test_scan"),
    guard("commits that count their events", "Reading._misfits_of_commits",
          'commits["count"] != reached - first', 'commits["count"] == 0',
          "test_guards", "reading.test_scan"),
)  # fmt: skip

BYTES = (
    guard("a file that ends before it should", "MappedFile._read",
          "try:\n"
          "    got = _read_some(fd, target[done:], start + done)\n"
          "except OSError as error:\n"
          '    raise self._unreadable(start + done, f"{error.strerror}; {self._to_do}") from '
          "error", "try:\n"
          "    got = _read_some(fd, target[done:], start + done)\n"
          "except OSError as error:\n"
          '    raise self._unreadable(start + done, f"{error.strerror}; {self._to_do}") from '
          "error\n"
          "if not got: break", "test_shortened_files"),
    guard("another file of the same name", "MappedFile._reopened",
          "(status.st_dev, status.st_ino) == self.identity", "True",
          "test_mapping"),
    guard("a copy that ends before it should", "MappedFile._copy",
          "copied < len(target)", "False", "test_mapping"),
    guard("a page alone, where reading many failed", "mapped_file._read_some",
          "return read_page_into(fd, target, at)", "raise", "test_mapping"),
    guard("pages asked for before they are looked at", "_asked_copy",
          "not _are_there(source, size)", "False", "test_shortened_files"),
    guard("CRCs of chunks whose file has lost its name", "segment_reading._is_sound",
          "segment.source.is_guarded", "True", "test_mapping"),
    guard("message indexes between their chunks", "chunk_table._check_rows",
          "(behind[:-1] > offset[1:]).any()", "False", "test_guards"),
    guard("an end that cannot be read, of a closed segment", "file_heads.look_at",
          "file.size in [end for _, end in data.unreadable]", "False",
          "test_bad_sectors"),
    guard("a file that was exchanged while it is verified", "file_heads.bytes_of",
          "now.identity != file.identity or now.size < file.size", "False", "test_file_place"),
    guard("a head that cannot be read", "file_heads.look_at",
          "_is_ours(head) or is_named_like_ours", "_is_ours(head)",
          "test_bad_sectors"),
    guard("pages that the disk refuses, told", "Verifier._segment",
          "self._damage", "print", "test_bad_sectors"),
)  # fmt: skip

SEGMENTS_OF_A_LOG = (
    guard("segments of one log", "_check_one_log",
          "len(ids) < 2", "True", "test_segment_set", "test_segments"),
    guard("segments without a gap", "segment_set.arrange",
          "segment.header.number > expected", "False", "test_segment_set", "test_segments"),
    guard("first events that fit", "_check_begins",
          "segment.header.first_event != next_event", "False",
          "test_guards"),
    guard("a segment that was cut and is not the last", "_check_before",
          "not segment.closed", "False", "test_segment_set", "test_segments"),
    guard("a damaged file that the log needs", "SegmentFolder._open",
          "not _is_in_another(one[0], found.values())", "False",
          "test_damaged_leftovers", "test_segment_set"),
    guard("a segment that is there twice", "segment_set.arrange",
          "_check_leftover(segment, segments)", "", "test_segments", "test_segment_set"),
    guard("commits that prove what was durable", "_judged",
          "behind.durable_before > scan.place.committed", "False",
          "reading.test_scan", "test_flips"),
    guard("a head that was on the disk", "_judged",
          "not scan.whole", "False", "test_guards", "reading.test_scan"),
)  # fmt: skip

REFUSALS = (
    guard("poison after a failed write", "LogWriter.append",
          "raise self._poisoned(error.strerror, command_id) from error", "self._in_commit = False\n"
          "raise", "test_durability", "test_writer", "test_syscalls"),
    guard("poison after a sync that did not end", "SharedSync.make_durable",
          "self.is_broken = True", "", "test_durability"),
    guard("no second try of a sync", "SharedSync.make_durable",
          "self.is_broken", "False", "test_guards"),
    guard("poison after an interrupt in a commit", "LogWriter.check_usable",
          'self._poisoned("interrupted in the middle of a commit")', "self._in_commit = False",
          "faults.test_memory", "test_writer"),
    guard("a poisoned writer's segment left as it is", "LogWriter._close_or_abandon",
          "self._poison or self._in_commit or self._syncs.is_broken", "False",
          "test_writer", "faults.test_memory", "test_syscalls"),
    guard("no append in an append", "LogWriter.check_usable", "self._busy", "False", "test_misuse"),
    guard("no append after close", "LogWriter.check_usable",
          "not self._open", "False", "test_misuse", "test_writer"),
    guard("what an interrupt left behind", "CurrentMap.take_in",
          "self.next_event != self._writer.next_event", "False",
          "faults.test_interrupted"),
    guard("recorded times that grow", "LogWriter._append",
          "max(wall_ns, self.last_ns + 1)", "wall_ns", "test_clocks", "test_writer"),
    guard("clocks before 1970", "believable_ns",
          "max(clock.wall_ns(), 0)", "clock.wall_ns()", "test_clocks"),
    guard("clocks at the end of time", "believable_ns",
          "min(max(clock.wall_ns(), 0), _LATEST_NS)", "max(clock.wall_ns(), 0)",
          "test_clocks"),
    guard("whole writes", "write_all",
          "while view: view = view[os.write(fd, view) :]", "",
          "test_syscalls", "test_durability"),
    guard("a torn tail that is kept", "reopened",
          "keep_torn_tail(folder, segment)", "", "test_recovery"),
    guard("a compacted copy that is compared", "rechunk._compare",
          "whole.digest() != digest", "False", "test_compaction", "test_compaction_merge"),
)  # fmt: skip

COLUMNS = (
    guard("values of columns", "Validator.check_batch",
          "batch.check()", "", "test_appending_batches"),
    guard("doors of columns that are not in the map", "rows_to_check",
          "harmless &= ~np.isin(ids, list(doors - index.placed.keys()))", "",
          "test_appending_batches"),
    guard("early events of columns", "Validator._check_rows",
          "self._early().note_rows(part, self.index.added_ns)", "", "test_backdating"),
    guard("early events one by one", "Validator.check",
          "self._early().note(event, self.index.added_ns)", "", "test_backdating"),
    guard("an id is told again in the commit that retracts it only", "Validator._check_new",
          "door_id in self._taken_back", "False", "test_backdating"),
    guard("a correction of an adding moves it back only", "Validator._check_correction",
          "event.happened_ns is None or event.happened_ns > before_ns", "False",
          "test_backdating"),
    guard("what is told of the very moment counts", "backdating.backdated",
          "since_ns - (door_id in told_of)", "since_ns", "test_backdating"),
    guard("unknown keywords", "knows_keywords.checked",
          "kwargs and not kwargs.keys() <= known.keys()", "False",
          "test_keywords"),
    guard("truth values are no numbers", "rules.is_number",
          "is_whole_number(value) or isinstance(value, (float, np.floating))",
          "isinstance(value, (int, float, np.floating))", "test_keywords"),
    guard("values of one event", "Event.__post_init__",
          "not allows(getattr(self, name))", "False", "test_event_rules"),
    guard("values of one event to each other", "Event.__post_init__",
          "broken(*values(self))", "False", "test_event_rules"),
    guard("ranges of columns", "_Checks.pass_all",
          "all(rule.allows_all(columns[name]) for name, rule in self.alone)", "True",
          "test_event_rules"),
    guard("columns that fit each other", "_Checks.pass_all",
          "any(misfits.any() for misfits in self.misfits(columns))", "False",
          "test_event_rules"),
    guard("blocks of columns", "event_columns.check_rows",
          "start + checks.first_wrong(columns)", "checks.first_wrong(columns)",
          "test_event_rules"),
    guard("what is not set may be anything", "KindRules.of",
          "isinstance(rule, Number) and rule.if_set and kind.effect.says_what", "False",
          "test_event_rules"),
    guard("levels that columns do not give", "Whole.refused",
          "outside & (column != self.absent)", "outside", "test_event_rules"),
    guard("seconds are no nanoseconds", "moment_of",
          "not is_whole_number(time)", "False", "test_keywords"),
    guard("doors that columns take out of the map", "rows_to_check",
          'harmless &= ~np.isin(ids, batch[DoorRemoved]["door_id"])', "",
          "test_appending_batches"),
    guard("doors whose adding columns take back", "rows_to_check",
          "harmless &= ~np.isin(ids, index.added_by(first, last))", "",
          "test_a_batch_that_takes_an_adding_back_is_asked_about_that_door"),
    guard("all that says something of a door may come early", "MAY_BE_EARLY",
          "kind.effect.presence is Presence.STAYS", "False", "test_backdating"),
    guard("annotations may come early", "MAY_BE_EARLY",
          "(*(kind for kind in SETTING_KINDS if kind.effect.presence is Presence.STAYS), "
          "DoorAnnotated)",
          "tuple(kind for kind in SETTING_KINDS if kind.effect.presence is Presence.STAYS)",
          "test_backdating"),
    guard("texts of a CSV compared behind their keys", "TextCodes.codes_of",
          "codes if same.all() else None", "codes", "test_csv_columns"),
)  # fmt: skip

REGISTERS = (
    guard("an earlier event that comes later, one by one", "DoorColumns.write_one",
          "stamp > (self._happened_ns[place, row], self._event[place, row])", "True",
          "test_events_one_by_one_in_any_order_make_the_state_of_their_batch"),
    guard("of one time the last number, one by one", "DoorColumns.write_one",
          "stamp > (self._happened_ns[place, row], self._event[place, row])",
          "stamp[0] > self._happened_ns[place, row]",
          "test_events_one_by_one_in_any_order_make_the_state_of_their_batch"),
    guard("a door's last event, one by one", "DoorColumns.write_one",
          'max(self._named["last_event"][row], stamp[1])', "stamp[1]",
          "test_events_one_by_one_in_any_order_make_the_state_of_their_batch"),
    guard("an adding and a removal, one by one", "DoorColumns.write_one",
          "registers += [name for what, name in _BY_PRESENCE.items() "
          "if what is event.effect.presence]", "",
          "test_events_one_by_one_in_any_order_make_the_state_of_their_batch"),
)  # fmt: skip

DOOR_0 = (
    guard("door 0: its events in the map", "DoorMapState._rows",
          "rows[about_0] = self._row(0)", "", "test_replay"),
    guard("door 0: no row of what is about none", "DoorMapState.from_arrays",
          "state._row_by_id[0] = NOBODY", "", "test_door_zero", "test_replay"),
    guard("door 0: found among what is about none", "EventBatch.of_door_0",
          "zeros == sum(np.count_nonzero(self.kind == kind) for kind in others)", "True",
          "test_replay"),
    guard("door 0: its events alone", "EventBatch.of_doors",
          "found & self.about_doors() if 0 in doors else found", "found",
          "test_door_zero"),
    guard("door 0: what is about none in an excerpt", "Excerpt.chosen",
          "batch.of_doors(self.doors) | ~batch.about_doors()", "batch.of_doors(self.doors)",
          "test_door_zero"),
    guard("door 0: taken back", "taken_back._doors",
          "batch.door_ids()[batch.about_doors()]", "batch.door_ids()",
          "test_door_zero"),
    guard("door 0: drawn", "DoorLayerProjection.apply",
          "batch.about_doors()", "batch.door_ids() > 0", "costmaps.test_over_time"),
)  # fmt: skip

BROUGHT_BACK = (
    guard("brought back: in the map within the commit", "DoorIndex.bring_back",
          "self.placed[door_id], self.level_of[door_id] = removal.was_placed, removal.level", "",
          "test_retracting"),
    guard("brought back: without a place as before", "DoorIndex.bring_back",
          "removal.was_placed", "True", "test_retracting"),
    guard("brought back: not where its adding may be gone", "DoorIndex.brought_back",
          "removal.event == event.first_event",
          "event.first_event <= removal.event <= event.last_event",
          "test_retracting"),
    guard("brought back: how, in words", "DoorIndex.way_back",
          "removal is None", "removal", "test_retracting"),
    guard("brought back: what differs is written", "_DoorPlanner.door_back",
          "yield from self.update_of(door, removed.door, names)", "",
          "importing.test_importing"),
    guard("brought back: a new id where one is asked for", "_DoorPlanner.removed_door",
          "self.renumber", "False", "importing.test_importing"),
    guard("brought back: not where the adding was taken back", "_replace",
          "if gone:", "if False:", "test_yaml_start"),
    guard("a door that was removed, named by its id", "CurrentMap.resolve",
          "if removed:", "if False:",
          "test_retracting"),
)  # fmt: skip

GUARDS: tuple[Mutant, ...] = (
    *SYNCS, *LOCKS, *CHECKSUMS, *SIZES, *COMPUTED_ONCE, *BYTES, *SEGMENTS_OF_A_LOG, *REFUSALS,
    *COLUMNS, *REGISTERS, *FOLDERS, *CLOSED_PARTS, *COMMAND_INDEXES, *APPENDING, *REBASES,
    *CHECKPOINTS, *MOMENTS, *COSTMAPS, *BELIEFS, *PICTURES, *SEEN, *SERVING, *ROS_MAPPING,
    *FOREIGN, *LIVE_ROOMS, *DOOR_0, *BROUGHT_BACK, *LEVELS, *NEWER, *LINES, *HABITS, *ASKING,
    *PLANNERS, *PLANNER_FILES,
    *KERNELS, *OPRS, *SCANS, *LASER_INPUT, *SIGHTINGS, *STORES, *PROPOSALS, *PLANNING, *ROOMS,
    *TABLES, *EXPERIMENT, *EXPERIMENT_TABLES, *KEEPING, *INDEX, *JOINS, *FLEETS, *SIGNING,
    *TRIMMING, *OBJECTS, *QUERIES,
)  # fmt: skip
