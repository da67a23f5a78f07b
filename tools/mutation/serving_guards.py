"""Every rule that keeps a server's answers true to the log, and its files in one folder."""

from __future__ import annotations

from mutation.mutant import Mutant, mutants_in

ROOM = "semmap_log/live/serving/"
TESTS = "tests/live/serving/"
SERVER = TESTS + "test_door_server.py"
SAVED = TESTS + "test_saving.py"
FAILING = TESTS + "test_failing_logs.py"
FOLLOWER = TESTS + "test_door_follower.py"
COSTMAP = TESTS + "test_served_costmap.py"
DOORS = TESTS + "test_served_doors.py"
OFFERED = TESTS + "test_server.py"
STARTED = "tests/cli/test_serve.py"
YAML = TESTS + "test_yaml_start.py"


_put = mutants_in(ROOM)


GOALS = (
    _put("a goal's id is its commit's", "door_server.py",
         "command_id=work.goal.goal_id,", "command_id=None,", SERVER),
    _put("a goal's content beside its id", "door_server.py",
         "content=content_of(work.goal.action, ask),", "", SERVER),
    _put("who sent a goal", "door_server.py", "actor=self.goal.caller,", 'actor="",', SERVER),
    _put("a goal sent again has its first answer", "door_server.py",
         "if appended.repeated:", "if False:", SERVER),
    Mutant("an outcome waits for its commit to last", "semmap_log/appendable_log.py",
           "self._make_last(appended.commit, sync=None)\n            self._warn_of_early()\n",
           "self._warn_of_early()\n", (SERVER,)),
    _put("nothing done is false", "door_server.py",
         "value = nothing if self.result is None else self.result", "value = self.result or True",
         SERVER),
    _put("a file that is there is true", "door_server.py",
         "work.result = True  # whatever becomes of the commit", "pass", FAILING),
    _put("doors that are not in the map", "door_server.py",
         'raise UnknownDoorError(f"door_id: door {door_id} is not in the map.")',
         "return log.state.door(DoorId(1))", SERVER),
    _put("doors that were removed, said so", "door_server.py",
         "if door_id in log.state.used_door_ids:", "if False:", SERVER),
    _put("goals of a clock that went back", "door_server.py",
         "return latest_ns if latest_ns > log.now_ns() else None", "return None", SERVER),
    _put("what does not differ is not set", "door_server.py",
         "ask.state not in (None, known.state)", "ask.state is not None", SERVER),
    _put("a place is pose and width", "door_server.py",
         "if not known.is_placed and (ask.place is None) != (ask.width is None):", "if False:",
         SERVER),
    _put("each change is told", "door_server.py",
         "        self._changed()\n        return _answer(work.events[0])",
         "        return _answer(work.events[0])", SERVER),
    _put("who does not hear of the progress", "door_server.py",
         "with suppress(Exception):  # who", "with suppress():  # who", SERVER),
    _put("ids of 32 bits", "door_goals.py", "if not 0 <= door_id <= MAX_DOOR_ID:", "if False:",
         SERVER),
    _put("places that are numbers", "door_goals.py",
         "if not math.isfinite(self.number(name)):", "if False:", SERVER),
    _put("probabilities from 0 to 1", "door_goals.py", "if not 0 <= value <= 1:", "if False:",
         SERVER),
    _put("NaN does not wipe out what is known", "door_goals.py",
         'it stays as it is.")\n            return None',
         'it stays as it is.")\n            return value', SERVER),
    _put("flags say what is set", "door_goals.py",
         'self.place() if self.is_set("change_pos") else None', "self.place()", SERVER),
    _put("a text that is no state is told", "door_goals.py",
         "if known is None:\n            self", "if False:\n            self", SERVER),
)  # fmt: skip

FAILURES = (
    _put("a log that failed is opened anew", "door_server.py",
         "if self._log is failed and not self._is_closed:", "if False:", FAILING),
    _put("what a failed write stored is looked up", "door_server.py",
         "known = self._log.find_command(work.goal.goal_id)\n",
         "known = self._log.reader.last_commit()\n", FAILING),
    _put("a log that could not be opened is tried again", "door_server.py",
         "if self._broken is not None and not self._is_closed:\n                    self",
         "if False:\n                    self", FAILING),
    _put("a poisoned log is let go of", "door_server.py",
         "            self._log.close()\n        self._broken = error",
         "            pass\n        self._broken = error", FAILING),
    _put("doors after a log was opened anew are told", "door_server.py",
         "        self._broken = None\n        self._changed()", "        self._broken = None",
         FAILING),
)  # fmt: skip

SAVING = (
    _put("saved: a folder of its own beside the log", "saving.py",
         "own.with_name(own.name + DEFAULT_SUFFIX)", "own.parent", SAVED),
    _put("saved: the folder is made", "saving.py", "self._root.mkdir(exist_ok=True)", "pass",
         SAVED),
    _put("saved: a folder that cannot be written", "saving.py",
         "if os.access(self._root.parent if makes else self._root, os.W_OK | os.X_OK):", "if True:",
         SAVED),
    _put("saved: no other log's folder", "saving.py",
         'any(each.suffix == ".mcap" for each in folder.iterdir())', "False", SAVED),
    _put("saved: without what was not given", "saving.py", "is_partial=True", "is_partial=False",
         SAVED),
    Mutant("saved: what was not given is no number", "semmap_log/formats/thesis_yaml.py",
           '"" if math.isnan(prob) else ', "", (SAVED,)),
    Mutant("a service without a log stays stopped", "semmap_log/cli/common.py",
           "except (NotALogError, FormatError, CommandError) as error:",
           "except FormatError as error:", ("tests/cli/test_serve.py",)),
    _put("no .. in names of files", "saving.py", ' or ".." in path.parts', "", SAVED),
    _put("no control characters in names of files", "saving.py",
         "not file_name.isprintable() or ", "", SAVED),
    _put("absolute names lie inside", "saving.py", "if not inside:", "if False:", SAVED),
    _put("files are YAML", "saving.py", "if path.suffix not in SUFFIXES:", "if False:", SAVED),
    _put("folders are no links", "saving.py", "_FOLDER | os.O_NOFOLLOW", "_FOLDER", SAVED),
    _put("a file is named in the folder that was opened", "saving.py",
         'yield Path(f"/proc/self/fd/{descriptor}")',
         "yield self._root.joinpath(*folders)", SAVED),
    _put("only files are replaced", "saving.py", "if not stat.S_ISREG(mode):", "if False:",
         SAVED),
    _put("a link's own kind counts", "saving.py", "(folder / name).lstat().st_mode",
         "(folder / name).stat().st_mode", SAVED),
    _put("the log's own folder", "saving.py",
         "refuse_own_folder(self._log_folder, folder.resolve() / name)", "pass", SAVED),
)  # fmt: skip

SHOWING = (
    _put("the map is there before the actions", "server.py",
         "self._show()  # who finds", "pass  # who finds", OFFERED),
    _put("one look after each change", "server.py",
         "                self._wake.wait()\n                self._wake.clear()  # before looking: "
         "what comes now is looked at again\n                self._show()",
         "                self._wake.wait()\n                self._show()\n"
         "                self._wake.clear()", OFFERED),
    _put("who cannot show must not go on", "server.py",
         "            self._failure = error", "            pass", OFFERED),
    _put("the last map is latched", "served_doors.py",
         'BagTopic("lta_semantic_map_door_db", DOOR_MAP, is_latched=True)',
         'BagTopic("lta_semantic_map_door_db", DOOR_MAP, is_latched=False)', DOORS),
    _put("topics of levels are latched", "served_topics.py",
         "is_latched: bool = True", "is_latched: bool = False", COSTMAP),
    _put("each message only when it is another", "served_doors.py",
         "        if is_thesis_new:\n", "        if True:\n", DOORS),
    _put("a map without doors is said, too", "served_doors.py",
         "is_thesis_new = not self._has_sent", "is_thesis_new = False", DOORS),
    _put("doors that are gone", "served_topics.py", ", **dict.fromkeys(gone)}", "}", DOORS),
    _put("levels keep their topics", "served_topics.py",
         "found[0] if len(found) == 1 else 0", "0", DOORS),
    _put("a reader takes no goal", "door_follower.py", "succeeded=False,", "succeeded=True,",
         FOLLOWER),
    _put("a reader sees retractions", "door_follower.py", "if Retracted in followed.batch:",
         "if False:", FOLLOWER),
    _put("a reader's error is not hidden", "door_follower.py",
         "if self._failure is not None:", "if False:", FOLLOWER),
    _put("a grid that grows with its doors", "served_costmap.py",
         " or not known.has_room_for(to_fit)", "", COSTMAP),
    _put("a warning once", "served_costmap.py",
         "if self._warned.get(level) != problem:", "if True:", COSTMAP),
    _put("a floor that came later", "served_costmap.py",
         " or known.plan_event != plan", "", COSTMAP),
    _put("a floor that was given stays", "served_costmap.py",
         "known is None or level in self._floors", "known is None", COSTMAP),
    _put("what doors cost is chosen", "served_costmap.py", "by=self._by)", 'by="state")', COSTMAP),
    _put("costs around doors are served", "served_costmap.py",
         "layers_of(geometry, floor, self._layer, options)",
         "layers_of(geometry, floor, self._layer, CostmapOptions())", COSTMAP),
    _put("the clock of grids never goes back", "served_costmap.py",
         "self._at_ns = max(self._at_ns, at_ns)", "self._at_ns = at_ns", COSTMAP),
)  # fmt: skip

FILES = (
    _put("a log that had doors is not filled", "yaml_start.py",
         "if not log.state.used_door_ids:", "if not log.door_map().doors:", YAML),
    _put("a file that differs stops the server", "yaml_start.py",
         "if _is_known(log, table, level, default_prob):", "if True:", YAML),
    _put("doors that only the log has", "yaml_start.py",
         "if there.is_placed and door_id not in listed:", "if False:", YAML),
    _put("doors that only the file has", "yaml_start.py",
         "        if there is None:\n", "        if there is None:\n            continue\n", YAML),
    _put("doors without a place are no file's business", "yaml_start.py",
         "if door.is_placed and door_id not in listed", "if door_id not in listed", YAML),
    _put("a file that the log took in", "yaml_start.py",
         "if any(log.find_command(each) for each in ids):", "if False:", YAML),
    Mutant("no log is made for a file that cannot be read", "semmap_log/cli/serve.py",
           "            read_thesis_yaml(yaml)\n", "            pass\n", (STARTED,)),
    Mutant("a reader makes no log", "semmap_log/cli/serve.py",
           "if not (read_only or log_option.exists()):", "if not log_option.exists():", (STARTED,)),
    _put("what is left out at the start is told", "yaml_start.py",
         "[*plan.summary, *left_out,", "[*plan.summary,", STARTED),
    _put("a file that the server saved", "yaml_start.py",
         "recorded.event.format == SAVED_FORMAT", 'recorded.event.format == ""', YAML),
)  # fmt: skip

SERVING: tuple[Mutant, ...] = (*GOALS, *FAILURES, *SAVING, *SHOWING, *FILES)
