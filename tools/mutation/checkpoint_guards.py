"""Every refusal that keeps a fold from going on from a checkpoint that does not fit."""

from __future__ import annotations

from mutation.mutant import guard

CHECKPOINTS = (
    guard("digest of a checkpoint", "_taken_apart",
          "hashlib.sha256(whole).digest() != digest", "False",
          "test_checkpoint"),
    guard("a checkpoint's commit in the log", "Checkpoint.load",
          "not position.is_in(reader)", "False", "test_checkpoint"),
    guard("a checkpoint from before a redaction", "Checkpoint.load",
          "position.is_before_redaction(reader)", "False", "test_checkpoint"),
    guard("hash of a checkpoint's commit", "Position.is_in",
          "commit.hash", "self.commit_hash", "test_checkpoint"),
    guard("a checkpoint of this log", "Checkpoint._fits",
          '(("log_id", "the log"), ("projection", "the projection"))',
          '(("projection", "the projection"),)', "test_checkpoint"),
    guard("a checkpoint among the segments", "Checkpoint.__init__",
          "refuse_own_folder(reader.folder, path)", "", "test_checkpoint"),
    guard("retractions of what a checkpoint took in", "RunningFold.advance",
          "so_far.is_touched_by(later)", "False", "test_checkpoint"),
    guard("retractions of what is saved on the way", "RunningFold._save_on_the_way",
          "not self.position.is_touched_by(self._retractions)", "True",
          "test_fold"),
    guard("a checkpoint at the end of a commit", "RunningFold.advance",
          "commit.last_event == self._event", "True", "test_fold"),
    guard("a state that its projection left half made", "RunningFold._apply",
          "self._is_at_position = False", "", "replay.test_live"),
    guard("a checkpoint of a later event", "_is_earlier",
          "(limit is None or position.event <= limit) and (scope.at_ns is None or "
          "position.latest_ns <= scope.at_ns)",
          "scope.at_ns is None or position.latest_ns <= scope.at_ns",
          "test_fold"),
    guard("a checkpoint of what happened later", "_is_earlier",
          "scope.at_ns is None or position.latest_ns <= scope.at_ns", "True",
          "test_fold"),
    guard("a fold that does not see what comes meanwhile", "CurrentMap.refresh",
          "self._reader = self._reader.refreshed()", "self._reader.refresh()", "test_fold"),
    guard("a log put back under a live fold", "_check_continues",
          "not running.position.is_in(reader)", "False", "replay.test_live"),
    guard("another log under a live fold", "LogReader._check_same_log",
          "self.segments and log_id != self.info.log_id", "False",
          "replay.test_live"),
)  # fmt: skip
