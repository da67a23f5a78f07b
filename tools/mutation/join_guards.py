"""What makes several robots' logs one: who wins, what is theirs alone, and what is refused."""

from __future__ import annotations

from mutation.mutant import guard

JOINS = (
    guard("join: a fork is refused", "joined_logs._without_copies",
          "there.hash != log.head", "False", "test_joining"),
    guard("join: another log in the place of one is refused", "joined_logs._opened",
          "reader.info.log_id != place.log_id", "False", "test_join_verb"),
    guard("join: a join is no part of itself", "joined_logs._flat",
          "one.place in inside", "False", "test_join_verb"),
    guard("join: sources say whose they are", "_Building._note",
          'replace(note, actor=actor, source=source, reason=reason, salt=b"")',
          'replace(note, reason=reason, salt=b"")', "test_joining"),
    guard("join: a command of two robots stays two", "_Building._command",
          "command_id in self._seen", "False", "test_joining"),
    guard("join: geometry without a frame does not count", "EventTranslation._placed",
          "self._log.frame is None", "False", "test_joining", "test_laws"),
    guard("join: poses without a frame do not, either", "EventTranslation._quickly",
          "RobotPose in batch and self._log.frame is None", "False", "test_joining"),
    guard("join: another's adding wipes no state", "EventTranslation._added",
          "not event.state.is_known", "False", "test_joining"),
    guard("join: a removal before the last adding does not count", "door_plan._counting",
          "not comes and stamp > last", "not comes", "test_joining"),
    guard("join: a name that one log has twice joins nothing", "door_plan._unique",
          "present if len(present) == 1 else []", "present[:1]", "test_joining"),
    guard("join: rounds of two robots stay two", "EventTranslation._round",
          "self._rounds.setdefault((self._log.name, patrol), len(self._rounds) + 1)",
          "patrol", "test_joining"),
    guard("join: the reference's floor map counts", "level_plan.level_plan",
          "drawn_by.setdefault(numbers.get((log.name, number), number), log.name)",
          "drawn_by[numbers.get((log.name, number), number)] = log.name", "test_joining"),
    guard("join: a door of the table stands once", "door_plan._told",
          "told[key] != row.building_door or not _same(lines[key], row)", "False",
          "test_joining"),
    guard("join: nobody drove from one robot to another", "track._runs",
          'poses = poses[np.argsort(poses["robot"], kind="stable")]', "",
          "views.report.test_track"),
    guard("join: a join is not shipped", "shipping.ship", "refuse_made(log)", "",
          "test_joining"),
)  # fmt: skip
