"""Every refusal that keeps a fold from going on from a checkpoint that does not fit."""

from __future__ import annotations

from mutation.mutant import Mutant

CHECKPOINT = "tests/folding/test_checkpoint.py"
FOLD = "tests/folding/test_fold.py"
LIVE = "tests/folding/test_live.py"


def _without(name: str, file: str, snippet: str, *tests: str, put: str) -> Mutant:
    return Mutant(name, f"semmap_log/folding/{file}", snippet, put, tests)


CHECKPOINTS = (
    _without("digest of a checkpoint", "checkpoint.py",
             " or hashlib.sha256(whole).digest() != digest", CHECKPOINT, put=""),
    _without("a checkpoint's commit in the log", "checkpoint.py",
             "if not position.is_in(reader):", CHECKPOINT, put="if False:"),
    _without("hash of a checkpoint's commit", "position.py",
             "(commit.last_event, commit.hash)", CHECKPOINT,
             put="(commit.last_event, self.commit_hash)"),
    _without("a checkpoint of this log", "checkpoint.py",
             '(("log_id", "the log"), ("projection", "the projection"))', CHECKPOINT,
             put='(("projection", "the projection"),)'),
    _without("a checkpoint among the segments", "checkpoint.py",
             "refuse_own_folder(reader.folder, path)", CHECKPOINT, put="pass"),
    _without("retractions of what a checkpoint took in", "running.py",
             "begins_anew = self.position.is_touched_by(later)", CHECKPOINT,
             put="begins_anew = False"),
    _without("retractions of what is saved on the way", "running.py",
             "if not self.position.is_touched_by(self._retractions):", FOLD, put="if True:"),
    _without("a checkpoint at the end of a commit", "running.py",
             "if commit is not None and commit.last_event == self._event:", FOLD,
             put="if commit is not None:"),
    _without("a state that its projection left half made", "running.py",
             "self._is_at_position = False\n        visible", LIVE, put="visible"),
    _without("a checkpoint of a later event", "fold.py",
             "(limit is None or position.event <= limit) and ", FOLD, put=""),
    _without("a checkpoint of what happened later", "fold.py",
             "scope.at_ns is None or position.latest_ns <= scope.at_ns", FOLD, put="True"),
    Mutant("a fold that does not see what comes meanwhile", "semmap_log/appendable_log.py",
           "self.refresh()", "self._reader.refresh()", (FOLD,)),
    _without("a log put back under a live fold", "live.py",
             "if not running.position.is_in(reader):", LIVE, put="if False:"),
    Mutant("another log under a live fold", "semmap_log/log/reading/reader.py",
           "if self.segments and log_id != self.info.log_id:", "if False:", (LIVE,)),
)  # fmt: skip
