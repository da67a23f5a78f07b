"""Every check that the answer to a moment of the past rests on, one by one."""

from __future__ import annotations

from mutation.mutant import guard

MOMENTS = (
    guard("version of a keyframe's state", "keyframes.decode",
          "version_of(data) != STATE_VERSION", "False", "test_state"),
    guard("hash of a keyframe's state", "keyframes.decode",
          "hashlib.sha256(blank).digest() != data[_HASH_AT : _HASH_AT + _HASH_BYTES]", "False",
          "test_guards", "test_state"),
    guard("keyframes that rest on what was retracted", "_Search._nearest",
          "behind is None", "True", "test_state"),
    guard("keyframes of later events", "_Search._candidates",
          "serves &= events <= self.limit", "", "test_state"),
    guard("keyframes of what happened later", "_Search._candidates",
          "serves &= chunks <= self._chunks_by(place)", "", "test_state"),
    guard("keyframes of what happened later, in segments before", "_Search._last_segment",
          "last = min(last, self.reader.segments_by(self.at_ns))", "",
          "test_state"),
    guard("a writer that goes on knows the state so far", "WrittenState.__init__",
          "DoorMapState() if reader is None else state_at(reader)", "DoorMapState()",
          "test_replay"),
    guard("a recovered log's keyframes know what was saved", "NewLog.add",
          "self._keyframes.add(chunk)", "", "test_salvage"),
    guard("keyframes are compared with the replay", "ReplayKeyframeCheck._keyframe",
          "keyframes.encode(self._state) != data", "False", "test_verification"),
    guard("a log that lies elsewhere is read from there again", "LogReader.anew",
          "LogReader(self._store, only=self._only)", "LogReader(self.folder, only=self._only)",
          "test_segment_store"),
    guard("events as the index counts them", "batches_of",
          "_check_numbers(page, numbers, firsts[mine], ends[mine])", "",
          "test_window"),
    guard("kinds of messages as the summary says", "_violation",
          'np.flatnonzero(kinds_of_chunks(page, ends) != rows["kinds"])', "np.empty(0)",
          "test_window"),
    guard("the data's CRC, where chunks are read in place", "ClosedSummary.fits_data",
          "crc == self.data_crc", "True", "test_window", "test_flips"),
    guard("segments that follow by hash, in a replay", "LogReader._check_follows",
          "check_follows(segment, commit, self.segments[place - 1])", "",
          "test_segment_set"),
)  # fmt: skip
