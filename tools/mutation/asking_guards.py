"""What keeps a person's word from being taken for another, one by one."""

from __future__ import annotations

from mutation.mutant import Mutant

NUMBERS = "tests/test_replay.py"
REMOVED = "tests/test_removed_doors.py"
IDS = "tests/test_free_ids.py"
NAMES = "tests/cli/test_file_names.py"
LINES = "tests/formats/test_event_json.py"
TOLD_LATER = "tests/cli/test_probabilities.py"


def _put(name: str, file: str, snippet: str, put: str, *tests: str) -> Mutant:
    return Mutant(name, f"semmap_log/{file}", snippet, put, tests)


ASKING = (
    _put("an event behind the log's end", "door_log.py",
         "if event is not None and event > self.reader.last_event() + behind_the_last:",
         "if False:", NUMBERS),
    _put("a range ends behind the last event", "door_log.py",
         "self._check_is_there(bound.event, behind_the_last=1)",
         "self._check_is_there(bound.event)", NUMBERS),
    _put("what was told later, of the door that is asked for", "known_later.py",
         "doors = None if door is None else [door]", "doors = None", TOLD_LATER),
    _put("what was told later than an event", "known_later.py",
         "first_event=None if known.event is None else known.event + 1,", "first_event=None,",
         TOLD_LATER),
    _put("a name of two removed doors, in an answer", "door_log.py",
         "            if len(removed) > 1:\n", "            if False:\n", REMOVED),
    _put("a name of two removed doors, in a command", "appendable_log.py",
         "                if len(removed) > 1:\n", "                if False:\n", REMOVED),
    _put("a removed door has its name in messages", "appendable_log.py",
         "                self._roster.names = self._names_now\n", "", REMOVED),
    _put("id:7 is the id", "commands.py",
         "    if isinstance(text, str) and text.startswith(ID_PREFIX):\n", "    if False:\n",
         REMOVED),
    _put("behind the last id the lowest", "doors.py", "    if following > MAX_DOOR_ID:\n",
         "    if False:\n", IDS),
    _put("a level's name that is another's number", "levels.py",
         "if named and numbered[:1] and numbered[0] in names and numbered[0] != named[0]:",
         "if False:", "tests/test_levels.py"),
    _put("an unknown key before a missing one", "formats/event_json_reader.py",
         "        self.refuse_unknown(kind)\n", "        pass\n", LINES),
    _put("a log in another zone than its lines", "formats/importing_lines.py",
         "        if others and self.count:\n", "        if False:\n",
         "tests/exporting/test_lines_round_trip.py"),
    _put("a log called as a file is", "log/writing/opening.py",
         "        _check_is_folders_name(path)\n", "", NAMES),
    _put("a file called as standard output is", "cli/common.py", 'if path == Path("-"):',
         "if False:", NAMES),
    _put("no old spelling is offered", "cli/verbs.py",
         "error.possibilities = self._similar(error.option_name)", "pass",
         "tests/cli/test_failures.py"),
    _put("a node that would fail again waits", "cli/__init__.py",
         "if code == USAGE and os.environ.get(RESPAWNED):", "if False:",
         "tests/cli/test_respawned.py"),
)  # fmt: skip
