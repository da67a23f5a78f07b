"""Every rule of recorder, bags, player and client: nothing lost in silence, nothing twice."""

from __future__ import annotations

from mutation.mutant import Mutant, mutants_in

LIVE = "semmap_log/live/"
RECORDER = "tests/live/test_ros_recorder.py"
BAGS = "tests/formats/test_bag_reading.py"
IMPORTS = "tests/test_bag_importing.py"
PACE = "tests/live/test_pace.py"
PLAYER = "tests/live/test_player.py"
CLIENT = "tests/live/test_client.py"
PLAYED = "tests/cli/test_play_and_call.py"
SPLIT = "tests/cli/test_ros_args.py"
RECORDED = "tests/cli/test_record_topics.py"
PACKAGE = "tests/live/test_ros_package.py"
NODE = "tests/live/test_ros_node.py"


_put = mutants_in("semmap_log/")


RECORDING = (
    _put("what was received is written at the end", "live/ros_recorder.py",
         "            if item is None:\n                break\n",
         "            if item is None or self.stopping:\n                return False\n", RECORDER),
    _put("nothing comes behind the end", "live/ros_recorder.py",
         "self.node.close()  # nothing comes any more", "pass", RECORDER),
    _put("what is dropped is counted", "live/ros_recorder.py",
         "            self.counts.dropped += 1\n", "", RECORDER),
    _put("memory is not filled by a slow disk", "live/ros_recorder.py",
         "if self._queue.qsize() >= MOST_WAITING:", "if False:", RECORDER),
    _put("messages that wait share a sync", "live/ros_recorder.py",
         "sync=False if self._is_synced_at_once else None", "sync=None", RECORDER),
    _put("each burst is synced", "live/ros_recorder.py", "            self._log.sync()\n",
         "            pass\n", RECORDER),
    _put("a write that fails ends the recording", "live/ros_recorder.py",
         "or self._error is not None, tick", ", tick", RECORDER),
    _put("a writer's error is not hidden", "live/ros_recorder.py",
         "        if self._error is not None:\n            raise self._error", "", RECORDER),
    _put("what the map forbids is not known", "live/ros_recorder.py",
         "self._translator.start_anew(self.sink.known())", "pass", RECORDER),
    _put("topics that come late are found", "live/ros_recorder.py",
         "if now >= self._next_look:", "if False:", RECORDER),
    _put("a topic is subscribed to once", "live/ros_recorder.py",
         "if topic in self._subscribed:", "if False:", RECORDER),
    _put("a type that is not installed", "live/ros_recorder.py",
         '        except RosError as error:\n            self.say(f"{topic}',
         '        except CommandError as error:\n            self.say(f"{topic}', RECORDER),
    _put("a ROS that does not answer", "live/ros_recorder.py",
         "        except RosError as error:\n            if not self._is_alone",
         "        except CommandError as error:\n            if not self._is_alone", RECORDER),
    _put("a late topic that cannot be read", "live/ros_recorder.py",
         "except CommandError as error:  # what is recorded already goes on",
         "except RosError as error:", RECORDER),
    _put("lines are no topics", "cli/record.py", "if mapping or dry_run or context.obj:",
         "if False:", RECORDED),
)  # fmt: skip

READING = (
    _put("messages that a reader passes over", "formats/rosbags_reading.py",
         "if count != expected:", "if False:", BAGS),
    _put("a part that lies beside the file", "formats/rosbags_reading.py",
         "if beside.exists() and beside.stat().st_size:", "if False:", BAGS),
    _put("an end that was never written", "formats/mcap_reading.py",
         "if size < FOOTER_BYTES or not file.read().endswith(MAGIC):", "if False:", BAGS),
    _put("a log of ours is no bag", "formats/mcap_reading.py",
         "if channel.message_type.name.startswith(OUR_TYPES):", "if False:", BAGS),
    _put("a log that is written is no bag", "formats/mcap_reading.py",
         "if OUR_TYPES.encode() in head:", "if False:", BAGS),
    _put("CRCs of a bag", "formats/mcap_records.py",
         "if chunk.uncompressed_crc and crc32(self.data) != chunk.uncompressed_crc:", "if False:",
         BAGS),
    _put("times that go back too far", "formats/mcap_reading.py",
         "if message.at_ns < last_ns:", "if False:", BAGS),
    _put("messages in the order of their times", "formats/mcap_reading.py",
         "ordered = in_order(self._scanned_messages(chosen), self._path)",
         "ordered = self._scanned_messages(chosen)", BAGS),
    _put("files of a folder in one order", "formats/bag_folder.py",
         "yield from heapq.merge(*streams, key=lambda message: message.at_ns)",
         "for stream in streams:\n            yield from stream", BAGS),
    _put("files of this folder only", "formats/bag_folder.py",
         'if Path(name).is_absolute() or ".." in Path(name).parts:', "if False:", BAGS),
    _put("what a library raises is our error", "formats/mcap_reading.py",
         "    except Exception as error:", "    except OSError as error:", BAGS),
    _put("an import's id is of the bag", "importing.py",
         "for file in (path, options.windows, options.mapping, picture):",
         "for file in (options.windows, options.mapping, picture):", IMPORTS),
    _put("an import's id is of its mapping", "importing.py",
         "for file in (path, options.windows, options.mapping, picture):",
         "for file in (path, options.windows, picture):", IMPORTS),
    _put("a bag without what is read", "bag_importing.py", "        if not chosen:\n",
         "        if False:\n", IMPORTS),
    _put("many events are not kept", "bag_importing.py", "if weight > MOST_KEPT:", "if False:",
         IMPORTS),
    _put("a bag that changes meanwhile", "bag_importing.py", "if count != self.count:",
         "if False:", IMPORTS),
)  # fmt: skip

PLAYING = (
    _put("nothing drifts", "live/pace.py",
         "return self._wall_ns + round((at_ns - self._log_ns) / self._rate)",
         "self._wall_ns, self._log_ns = self.now_ns(), self._before_ns\n"
         "        return self._wall_ns + round((at_ns - self._log_ns) / self._rate)", PACE),
    _put("the log's time never goes back", "live/pace.py",
         "max(self._log_ns + passed_ns, self._before_ns)", "self._log_ns + passed_ns", PACE),
    _put("the log's time waits for its messages", "live/pace.py",
         "return min(max(self._log_ns + passed_ns, self._before_ns), self.next_ns)",
         "return max(self._log_ns + passed_ns, self._before_ns)", PACE),
    _put("long stretches are left out", "live/pace.py", "self._log_ns += gap_ns", "pass", PACE),
    _put("short stretches are not left out", "live/pace.py", "gap_ns > self._longest_gap_ns",
         "gap_ns > 0", PACE),
    _put("a message when it is due", "live/player.py",
         "            self._wait(pace, message.at_ns)\n", "", PLAYER),
    _put("a loop begins at the beginning", "live/player.py",
         "self.pace = pace = Pace(begin_ns,",
         "self.pace = pace = self.pace or Pace(begin_ns,", PLAYER),
    _put("once is once", "live/player.py", "if not self._options.loop:", "if False:", PLAYER),
    _put("no stamp ahead of the clock", "live/player.py",
         "            self._clock.show(message.at_ns)  # no stamp lies ahead of the clock",
         "            pass", PLAYER),
    _put("a time is shown once", "live/player.py", "if at_ns != self._shown_ns:", "if True:",
         PLAYER),
    _put("latched messages wait for each other", "live/player.py",
         "1 if topic.is_latched else MOST_WAITING", "MOST_WAITING", PLAYER),
    _put("messages wait for who is slow", "live/player.py",
         "if self.waiting >= self.most_waiting:", "if False:", PLAYER),
    _put("topics follow the namespace", "live/player.py", 'name=topic.name.lstrip("/")',
         "name=topic.name", PLAYER),
    _put("playing waits for who listens", "live/player.py", "if self._options.wait:", "if False:",
         PLAYER),
    _put("playing stays behind its end", "live/player.py", "if self._options.keep_alive:",
         "if False:", PLAYER),
    _put("a player that is stopped", "live/player.py",
         "            if self.stopped.is_set():\n                return\n            self._publish",
         "            self._publish", PLAYER),
    _put("a player's error is not hidden", "live/player.py", "    playing.result()\n", "", PLAYER),
    _put("rates that are any", "cli/play.py", "if not SLOWEST <= rate <= FASTEST:", "if False:",
         PLAYED),
)  # fmt: skip

CALLING = (
    _put("a place in part is completed", "live/client.py",
         "if given and len(given) < len(door.place):", "if False:", CLIENT),
    _put("a place is completed by what is not given", "live/client.py",
         "x=entry.pos_x if door.x is None else door.x", "x=entry.pos_x", CLIENT),
    _put("a door that is not in the map", "live/client.py", "if door_id not in doors:",
         "if not doors:", CLIENT),
    _put("no map in time", "live/client.py",
         "        if not got:\n", "        if not got:\n            return {}\n", CLIENT),
    _put("only what is given is set", "live/client.py", '"change_pos": bool(given)',
         '"change_pos": True', CLIENT),
    _put("a probability that is not given is NaN", "live/client.py",
         " | dict.fromkeys(lacking, math.nan)", "", CLIENT),
    _put("no NaN goes to a server of others", "live/client.py",
         'if lacking and not self._is_ours("AddDoor"):', "if False:", CLIENT),
    _put("a server of ours by any name", "live/client.py",
         "_OURS.search(topic)", "topic == MARKERS_NAME", CLIENT),
    _put("a server that is not there is not ours", "live/client.py",
         "if not topics():", "if False:", CLIENT),
    _put("what was refused is logged", "live/ros_node.py", "    if outcome.text:\n",
         "    if False:\n", NODE),
    _put("messages of others are left alone", "live/ros_package.py",
         'if not (target / "msg" / "_DoorMap.py").is_file():', "if False:", PACKAGE),
    _put("each call has an id of its own", "live/client.py", "goal_id = uuid4().bytes",
         "goal_id = bytes(16)", CLIENT),
    _put("why a goal was aborted", "live/client.py",
         "answer = replace(answer, text=reasons.wait())", "pass", CLIENT),
    _put("why this goal was aborted", "live/client.py",
         "if self._goal_id.encode() in received.data:", "if True:", CLIENT),
    _put("what is false is not done", "cli/call.py",
         "any(value is False for value in answer.result.values())", "False", CLIENT),
    _put("a door's id may be 0", "cli/call.py", "value is False for value", "not value for value",
         CLIENT),
    _put("what is refused is told by the exit code", "cli/call.py",
         "        if not done:\n            raise typer.Exit(1)", "", CLIENT),
    _put("ROS's arguments are taken out", "cli/ros.py", 'if in_ros_args or ":=" in each:',
         "if in_ros_args:", SPLIT),
    _put("ROS's arguments end", "cli/ros.py",
         '        if each == "--":\n            in_ros_args = False', "", SPLIT),
    _put("other verbs' arguments are theirs", "cli/ros.py", "if verb not in VERBS:", "if False:",
         SPLIT),
    _put("which ROS has to be said", "cli/ros.py", "if ros1 == ros2:", "if False:", PLAYED),
)  # fmt: skip

LIVE_ROOMS: tuple[Mutant, ...] = (*RECORDING, *READING, *PLAYING, *CALLING)
