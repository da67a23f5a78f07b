"""What makes an answer of many logs true: whose it is, of when, and what became of each log."""

from __future__ import annotations

from mutation.mutant import guard

FLEETS = (
    guard("fleet: an answer that was cut or altered is none", "checked_file.read_checked",
          "found[:_DIGEST_BYTES] != _digest(path, data)", "False", "test_fleet_run"),
    guard("fleet: a log that has grown is asked again", "log_answer._answered",
          "asked.head and asked.head == question.known_head", "question.known_head",
          "test_fleet_run"),
    guard("fleet: verify believes no earlier run", "KeptAnswers.finish",
          "self._holds is Holds.within_a_run", "False", "test_fleet_run"),
    guard("fleet: damage has its file and byte", "log_answer._without",
          "isinstance(error, CorruptLogError)", "False", "test_fleet_run"),
    guard("fleet: a log that is written is told", "log_answer._described",
          "segments[-1].closed", "True", "test_fleet_run"),
    guard("fleet: a question that nobody can answer is an error", "Fleet.ask",
          "all(each.is_question_wrong for each in answers.values())", "False", "test_fleet_run"),
    guard("fleet: doors that were not seen between do not hide an opening", "door_jobs.openings_ns",
          "np.isin(timeline.state, (DoorState.OPEN, DoorState.CLOSED))", "timeline.state >= 0",
          "test_fleet_run"),
    guard("fleet: parts of a fold are of one moment", "FoldJob.ask_part",
          "known_event=last_event", "known_event=None", "test_fleet_run"),
    guard("fleet: parts of the doors are of one moment", "OpeningsJob.ask_part",
          "Scope(event=None if last_event < 0 else last_event)", "Scope()", "test_fleet_run"),
    guard("fleet: a folder whose name is a pattern is itself", "log_places._meant",
          "not _is_there(place)", "True", "test_log_places"),
    guard("fleet: old files of a log leave the lake", "lake_folder.remove_earlier_files",
          "folder.remove(name)", "pass", "test_month_export"),
)  # fmt: skip
