"""The lines on which it rests that doors lie right when a building was mapped anew."""

from __future__ import annotations

from mutation.mutant import guard

REBASES = (
    guard("which way a map turns", "RigidTransform.moved",
          "self.dx + cos * x - sin * y", "self.dx + cos * x + sin * y", "test_map_fit"),
    guard("which way points say that a map turns", "map_fit._rigid",
          "np.conj(old - middle)", "(old - middle)", "test_map_fit"),
    guard("doors that would be moved twice", "rebasing._check_map",
          "are_same([replace(floor, level=level)], [states.there])", "False", "test_rebasing"),
    guard("doors that were measured again", "rebasing._moved",
          "if measured is not None:", "if False:", "test_rebasing"),
    guard("a rebase while the clock is behind", "RebaseMap.events",
          "happened_ns = now.state.latest_happened_ns", "pass", "test_rebasing"),
    guard("where doors lay at that moment", "RebaseMap.events",
          "replay(now.reader, Scope(at_ns=at_ns))", "now.state", "test_rebasing"),
    guard("a bad pair is refused", "map_fit.check_fit",
          "fit.worst_m <= most_residual_m", "True", "test_map_fit"),
    guard("a plan that was taken back", "floor_plans._along_happened",
          '~excerpt.is_retracted(stamps["number"])', 'stamps["number"] >= 0',
          "views.rerun.test_mapped_anew"),
    guard("a robot's place on another plan", "track._runs",
          'jumps |= np.diff(np.searchsorted(begins, poses["folds_ns"], "right")) != 0', "pass",
          "test_track"),
    guard("a costmap over time on the plan of its time", "costmap_frames",
          "floors[1:]", "floors[:0]", "test_rebasing"),
)  # fmt: skip
