"""Every check that the answer to a moment of the past rests on, one by one."""

from __future__ import annotations

from mutation.mutant import Mutant

READING = "semmap_log/log/reading/"
STATE = "tests/log/reading/test_state.py"
WINDOW = "tests/log/reading/test_window.py"
SET = "tests/log/reading/test_segment_set.py"
SCAN = "tests/log/reading/test_scan.py"
FLIPS = "tests/faults/test_flips.py"
GUARDED = "tests/log/test_guards.py"


def _without(name: str, file: str, snippet: str, *tests: str, put: str = "pass") -> Mutant:
    return Mutant(name, READING + file, snippet, put, tests)


MOMENTS = (
    Mutant("version of a keyframe's state", "semmap_log/log/keyframes.py",
           "if version_of(data) != STATE_VERSION:", "if False:", (STATE,)),
    Mutant("hash of a keyframe's state", "semmap_log/log/keyframes.py",
           "if hashlib.sha256(blank).digest() != data[_HASH_AT : _HASH_AT + _HASH_BYTES]:",
           "if False:", (GUARDED, STATE)),
    _without("keyframes that rest on what was retracted", "state.py",
             "if behind is None:", STATE, put="if True:"),
    _without("keyframes of later events", "state.py", "serves &= events <= self.limit", STATE),
    _without("keyframes of what happened later", "state.py",
             "serves &= chunks <= self._chunks_by(place)", STATE),
    _without("keyframes of what happened later, in segments before", "state.py",
             "last = min(last, self.reader.segments_by(self.at_ns))", STATE),
    _without("events as the index counts them", "segment_reading.py",
             "        _check_numbers(page, batch, firsts[mine], ends[mine])\n", WINDOW, put=""),
    _without("kinds of messages as the summary says", "page_reading.py",
             'np.flatnonzero(kinds_of_chunks(page, ends) != rows["kinds"])', WINDOW,
             put="np.empty(0)"),
    _without("the data's CRC, where chunks are read in place", "closed_summary.py",
             "return crc == self.data_crc", WINDOW, FLIPS, put="return True"),
    _without("segments that follow by hash, in a replay", "reader.py",
             "check_follows(segment, commit, self.segments[place - 1])", SET),
)  # fmt: skip
