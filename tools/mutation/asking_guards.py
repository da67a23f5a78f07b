"""What keeps a person's word from being taken for another, one by one."""

from __future__ import annotations

from mutation.mutant import guard

ASKING = (
    guard("an event behind the log's end", "DoorLog._check_is_there",
          "event is not None and event > self._reader.last_event() + behind_the_last", "False",
          "test_replay"),
    guard("a range ends behind the last event", "DoorLog.window",
          "behind_the_last=1", "", "test_replay"),
    guard("what was told later, of the door that is asked for", "known_later.known_later",
          "None if door is None else [door]", "None", "cli.test_probabilities"),
    guard("what was told later than an event", "known_later.known_later",
          "first_event=None if known.event is None else known.event + 1", "first_event=None",
          "cli.test_probabilities"),
    guard("a name of two removed doors, in an answer", "door_ever",
          "len(removed) > 1", "False", "test_removed_doors"),
    guard("a name of two removed doors, in a command", "CurrentMap.resolve",
          "len(removed) > 1", "False", "test_removed_doors"),
    guard("a removed door has its name in messages", "CurrentMap.door_index",
          "self.index.names = partial(_names_now, self._written)", "", "test_removed_doors"),
    guard("id:7 is the id", "resolve_door",
          "isinstance(text, str) and text.startswith(ID_PREFIX)", "False", "test_removed_doors"),
    guard("behind the last id the lowest", "next_door_id",
          "following > MAX_DOOR_ID", "False", "test_free_ids"),
    guard("a level's name that is another's number", "level_called",
          "named and numbered[:1] and numbered[0] in names and numbered[0] != named[0]", "False",
          "test_levels"),
    guard("an unknown key before a missing one", "_LineReader.line",
          "self.refuse_unknown(kind)", "", "test_event_json"),
    guard("a log in another zone than its lines", "_LinePlanner.warnings",
          "others and self.count", "False", "test_lines_round_trip"),
    guard("a log called as a file is", "create_log",
          "_check_is_folders_name(path)", "", "test_file_names"),
    guard("a file called as standard output is", "a_file",
          'path == Path("-")', "False", "test_file_names"),
    guard("no old spelling is offered", "Verb.parse_args",
          "error.possibilities = self._similar(error.option_name)", "", "cli.test_failures"),
    guard("a node that would fail again waits", "cli.main",
          "code == USAGE and os.environ.get(RESPAWNED)", "False", "test_respawned"),
)  # fmt: skip
