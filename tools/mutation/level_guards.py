"""What levels rest on: which one is meant, and which one is shown."""

from __future__ import annotations

from mutation.mutant import mutants_in

RULE = "tests/test_levels.py"
SHOWN = "tests/views/test_levels_shown.py"
MAPS = "tests/cli/test_import_map.py"
LINES = "tests/test_command_lines.py"

_put = mutants_in("semmap_log/", "levels: ")

LEVELS = (
    _put("of several one must be told", "levels.py", "if len(names) > 1:", "if False:", RULE),
    _put("doors with a place make a level", "levels.py",
         "sorted(door_map.levels.keys() | placed_levels(door_map))", "sorted(door_map.levels)",
         RULE),
    _put("doors with a place make a level for the writer", "commands.py",
         "numbers |= self.level_names.keys()", "numbers = set(self.level_names)", RULE),
    _put("a name counts before a number", "levels.py",
         "return (named or numbered)[0]", "return (numbered or named)[0]", RULE),
    _put("a name of two levels", "levels.py", "if len(named) > 1:", "if False:", RULE),
    _put("an event without a level", "commands.py",
         "        event = self.with_level(event)\n", "", RULE),
    _put("a door that moves stays on its level", "commands.py",
         "level=self.roster.level_of.get(event.door_id, 0)", "level=0", RULE),
    _put("a late move does not count", "commands.py",
         "isinstance(event, (DoorUpdated, LevelAdded)):", "False:", RULE),
    _put("a waiting pose gets its level at once", "appendable_log.py",
         "            pose = replace(pose, level=self.level_meant(pose.level))\n", "", RULE),
    _put("poses as columns", "commands.py",
         'poses["level"][poses["level"] == NO_LEVEL] = only_level(self.roster.levels)',
         'poses["level"][poses["level"] == NO_LEVEL] = 0', RULE),
    _put("floor maps in a batch", "commands.py",
         "return any(isinstance(event, FloorMap) and not is_given(event.level) for event in maps)",
         "return False", RULE),
    _put("a command that comes again without a level", "command_content.py",
         'if not is_given(getattr(given, "level", 0)):', "if False:", RULE),
    _put("a pose is refused by its own line", "formats/event_json_reader.py",
         "if kind in (DoorAdded, DoorUpdated, RobotPose)", "if kind in (DoorAdded, DoorUpdated)",
         RULE),
    _put("a costmap of the level with doors", "levels.py",
         "return placed.pop() if len(placed) == 1 else", "return", RULE),
    _put("level 0 is shown on the only level", "views/excerpt/levels.py",
         "return there.pop() if len(there) == 1 else None", "return 0", SHOWN),
    _put("a robot's level without doors is not in front", "views/rerun/blueprint.py",
         "wanted if wanted.doors or not busiest.doors else busiest", "wanted", SHOWN),
    _put("a robot's level without doors is not in front of a page", "views/report/page/plan.js",
         "withRobot && (withRobot.marks.length || !withMost.marks.length)", "withRobot", SHOWN),
    _put("a map's id is of its picture", "importing.py",
         "picture_of(path) if is_map(path) else None", "None", MAPS),
    _put("a map that is there already", "importing.py",
         "if there is not None and are_same([found], [there]):", "if False:", MAPS),
    _put("command lines are quoted", "command_lines.py", "shlex.join([program, verb, *said])",
         '" ".join([program, verb, *said])', LINES),
    _put("a path is no option", "command_lines.py", 'text.startswith("-")', "False", LINES),
)  # fmt: skip
