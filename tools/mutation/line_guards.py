"""What a copy of a log rests on that goes through JSON lines."""

from __future__ import annotations

from mutation.mutant import mutants_in

COPIED = "tests/exporting/test_lines_round_trip.py"
PLANNED = "tests/formats/test_importing_lines.py"
RECORDED = "tests/cli/test_record.py"
GEOJSON = "tests/formats/test_geojson.py"
FLOORS = "tests/messages/test_codec.py"

FORMATS = "formats/importing_lines.py"
COMMITS = "formats/line_commits.py"
WRITING = "line_importing.py"

_put = mutants_in("semmap_log/", "lines: ")

LINES = (
    _put("retractions whenever they happened", "exporting/event_lines.py",
         " | (batch.kind == Retracted.kind)", "", COPIED),
    _put("numbers of what was taken back", COMMITS,
         "event = replace(event, first_event=first, last_event=last)", "pass", PLANNED, COPIED),
    _put("commits as they were", COMMITS,
         "return last.commit == line.commit", "return False", PLANNED, COPIED),
    _put("notes as they were", COMMITS,
         "if not note and not parsed.is_exported:", "if not note:", PLANNED, COPIED),
    _put("the file's id on its last commit", COMMITS,
         "place == groups - 1", "False", PLANNED),
    _put("what was taken back without its retraction", FORMATS,
         "            self.uncovered.add(parsed.number, line)\n", "            pass\n", PLANNED),
    _put("a line that was changed", FORMATS,
         "if held is None or not means_same(event, held):", "if False:", COPIED),
    _put("a note that was changed", FORMATS,
         "(commit.is_exported and commit.note != found.note)", "False", COPIED),
    _put("recorded times of a log with events of its own", FORMATS,
         "return is_copy and self.times.can_be_kept(self.now_ns)",
         "return self.times.can_be_kept(self.now_ns)", COPIED),
    _put("recorded times to come", FORMATS,
         "return self.ascend and self.last_ns <= now_ns", "return self.ascend", COPIED),
    _put("doors that a retraction brought back", FORMATS,
         "roster = self.without_retracted() if last.has_retraction else last.roster",
         "roster = last.roster", COPIED),
    _put("commits that are stored already", WRITING,
         "        found = stored.find(commit.command_id)\n        if found is None:",
         "        found = stored.find(commit.command_id)\n        if True:", COPIED),
    _put("numbers of what is stored already", WRITING,
         "            writing.pass_over(commit, found)\n", "            pass\n", COPIED),
    _put("a log that begins when the other did", WRITING,
         "            self.log.begin_at(recorded_ns - 1)\n", "            pass\n", COPIED),
    _put("room for a keyframe between kept times", "log/writing/writer.py",
         "has_time = not keeps_time or wall_ns - self.last_ns > 1", "has_time = True", COPIED),
    _put("a keyframe that takes no time from a commit", "log/writing/writer.py",
         "max(wall_ns - 1, self.last_ns + 1)", "max(wall_ns, self.last_ns + 1)", COPIED),
    _put("facts that are not judged again", "commands.py",
         "if is_late and not self._are_facts:", "if is_late:", COPIED),
    _put("angles of floor maps", "messages/codec.py",
         "                return near\n", "                pass\n", FLOORS, COPIED),
    _put("what was taken back, recorded", "live/event_lines.py",
         "        if parsed.retracted:\n", "        if False:\n", RECORDED),
    _put("each line of a commit by itself, recorded", "formats/event_json_reader.py",
         "return _own_id(self.command_id, self.number if self.commit else None)",
         "return self.command_id", RECORDED),
    _put("a plane of its own", "formats/geojson.py",
         '        "crs": {"type": "name", "properties": {"name": PLANE}},\n', "", GEOJSON),
    _put("places beyond all numbers", "formats/geojson.py",
         "if not all(math.isfinite(number) for end in ends for number in end):",
         "if not door.is_placed:", GEOJSON),
)  # fmt: skip
