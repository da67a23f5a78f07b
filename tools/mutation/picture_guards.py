"""Every line on which it rests that a picture of a log shows what a replay gives, one by one."""

from __future__ import annotations

from mutation.mutant import mutants_in

TIMELINES = "tests/views/rerun/test_timelines.py"
RECORDING = "tests/views/rerun/test_recording.py"
THINNING = "tests/views/rerun/test_thinning.py"
ROUNDS = "tests/views/rerun/test_rounds.py"
LIVE_ROWS = "tests/views/rerun/test_live_rows.py"
LAYER = "tests/views/rerun/test_costmap.py"
CURVES = "tests/views/rerun/test_beliefs.py"
REPORT = "tests/views/report/test_report.py"
TIMES = "tests/views/test_zone_times.py"
TRACK = "tests/views/report/test_track.py"
MARKERS = "tests/exporting/test_stream.py"
ARRAYS = "tests/formats/test_array_messages.py"
LEAVES = "tests/formats/test_door_markers.py"
PATROLS = "tests/projections/test_rounds.py"
SHARES = "tests/projections/test_time_shares.py"
LINES = "tests/projections/test_timeline.py"
DAY = "tests/test_day.py"
DRAWABLE = "tests/views/rerun/test_drawable.py"
AXIS = "tests/views/test_time_axis.py"
TICKS = "tests/views/report/test_ticks.py"
BROWSER = "tests/views/report/test_in_browser.py"
LANES = "tests/views/plots/test_lanes.py"
VIEW = "tests/cli/test_view.py"


_recording = mutants_in("semmap_log/views/", "recording: ")
_report = mutants_in("semmap_log/views/report/", "report: ")
_markers = mutants_in("semmap_log/", "markers: ")
_states = mutants_in("semmap_log/", "states: ")
_axis = mutants_in("semmap_log/views/", "axis: ")

RECORDINGS = (
    _recording("what was taken back is not on `happened`", "excerpt/excerpt.py",
               "happened = ~self.is_retracted(numbers)", "happened = numbers >= 0", TIMELINES),
    _recording("what was taken back later is on `recorded`", "excerpt/excerpt.py",
               "in_ranges(numbers, ahead)", "in_ranges(numbers, known.ranges)", TIMELINES),
    _recording("what was recorded after `until` is not on `recorded`", "excerpt/excerpt.py",
               "recorded &= recorded_ns < self.until_ns", "pass", TIMELINES),
    _recording("what happened before `since` is not on `happened`", "excerpt/excerpt.py",
               "happened &= folds_ns >= self.since_ns", "pass", TIMELINES),
    _recording("rows of different timelines are written apart", "rerun/rows.py",
               "if (happened & recorded).all():", "if True:", TIMELINES, ROUNDS, RECORDING,
               "tests/views/rerun/test_event_lines.py"),
    _recording("a commit is known as a whole", "rerun/rows.py",
               'np.where(behind > 0, rows["number"] - first, 0)', "0", TIMELINES, RECORDING),
    _recording("chunks of 4096 rows", "rerun/rows.py", "MOST_ROWS = 4096", "MOST_ROWS = 2**20",
               RECORDING),
    _recording("a door that is back at once does not vanish", "rerun/rows.py",
               "rows[~self._is_back(timeline, rows, returns)]", "rows", TIMELINES, RECORDING),
    _recording("a late event wins nothing that is newer", "rerun/knowledge.py",
               "outdone = setting[rank < np.maximum.accumulate(rank)]", "outdone = setting[:0]",
               TIMELINES),
    _recording("after a retraction a door goes on from the fold's stamps", "rerun/knowledge.py",
               "parts.append(_winning(np.concatenate([one.row, changes[start:stop]]), one.stamps))",
               "parts.append(_winning(np.concatenate([one.row, changes[start:stop]]), {}))",
               TIMELINES),
    _recording("what was taken back before the first event", "rerun/taken_back.py",
               "retractions_behind(reader, excerpt.number_before())",
               "retractions_behind(reader, -1)", TIMELINES),
    _recording("what is taken back after `until`", "rerun/taken_back.py",
               "            return\n        if doors", "            pass\n        if doors",
               TIMELINES),
    _recording("a retraction hides nothing behind itself", "rerun/taken_back.py",
               "min(retraction.last_event, retraction.number - 1)", "retraction.first_event",
               TIMELINES),
    _recording("doors with late events are drawn apart on each timeline", "rerun/survey.py",
               "self.is_plain &= bool(both.all()) and not is_late.any()",
               "self.is_plain &= bool(both.all())", TIMELINES),
    _recording("doors with events taken back are drawn apart", "rerun/survey.py",
               "self.is_plain &= bool(both.all()) and not is_late.any()",
               "self.is_plain &= not is_late.any()", TIMELINES),
    _recording("a door that is not there is not drawn", "excerpt/door_fold.py",
               'states=rows[there & (appears | _differs(rows, before, ["state"]))]',
               'states=rows[appears | _differs(rows, before, ["state"])]', TIMELINES),
    _recording("a door that comes back shows all it is", "excerpt/door_fold.py",
               "placements=rows[there & (appears | _differs(rows, before, PLACE))]",
               "placements=rows[there & _differs(rows, before, PLACE)]", TIMELINES, RECORDING),
    _recording("values not set stay as they were", "excerpt/door_fold.py",
               "rows[name] = np.where(source >= 0, rows[name][source], self.last[name])", "pass",
               RECORDING, TIMELINES),
    _recording("a place that was left is not drawn there", "rerun/door_pen.py",
               '~is_placed | (placements["level"] != level)', "~is_placed", TIMELINES),
    _recording("the costmap's layer is written apart on each timeline", "rerun/costmap.py",
               "        if happened.patches == recorded.patches and np.array_equal(\n"
               "            happened.pictures, recorded.pictures\n        ):",
               "        if len(happened.pictures):", LAYER),
    _recording("a change of state keeps its line", "rerun/thinning.py",
               'before == ordered["state"]', "before >= 0", THINNING),
    _recording("around late sightings every line stays", "rerun/thinning.py",
               "(states[1:] == states[:-1]) & ~told_between", "states[1:] == states[:-1]",
               THINNING),
    _recording("only sightings are left out", "rerun/thinning.py",
               'repeats["number"][is_sighting]', 'repeats["number"]', THINNING),
    _recording("short recordings leave nothing out", "rerun/thinning.py",
               "return scene.events > FULL_UP_TO", "return True", RECORDING, THINNING,
               "tests/views/rerun/test_event_lines.py"),
    _recording("a round is as it was known then", "rerun/rounds.py",
               "if entry.number <= number and not is_hidden:", "if not is_hidden:", ROUNDS),
    _recording("a round that was taken back was driven until that was known", "rerun/rounds.py",
               "yield replace(entry, retracted=False)", "yield entry", ROUNDS),
    _recording("curves are of what had happened by then", "rerun/beliefs.py",
               "beliefs.predict(door.door_id, times_ns, times_ns)",
               "beliefs.predict(door.door_id, times_ns, times_ns[:1])", CURVES),
    _recording("a curve ends with its door", "rerun/beliefs.py",
               "return first_ns, max(first_ns, min(end_ns, removed_ns))",
               "return first_ns, max(first_ns, end_ns)", CURVES),
    _recording("followed: late events are written anew", "rerun/fitting.py",
               " or survey.is_late(batch)", "", LIVE_ROWS),
    _recording("followed: what is taken back is written anew", "rerun/fitting.py",
               "NEVER_FIT = (Retracted, ", "NEVER_FIT = (", LIVE_ROWS),
    _recording("followed: rounds are written anew", "rerun/fitting.py",
               "FloorMap, PatrolStarted, PatrolFinished)", "FloorMap)", LIVE_ROWS),
    _recording("followed: new doors are written anew", "rerun/fitting.py",
               "MAY_CHANGE_THE_SCENE = (DoorAdded, ", "MAY_CHANGE_THE_SCENE = (", LIVE_ROWS),
    _recording("followed: new names are written anew", "rerun/fitting.py",
               "DoorRemoved, DoorAnnotated, DoorUpdated)", "DoorRemoved, DoorUpdated)", LIVE_ROWS),
    _recording("followed: a robot off the plan makes a new one", "rerun/fitting.py",
               "return RobotPose not in batch or _is_robot_inside(batch, scene)", "return True",
               LIVE_ROWS),
    _recording("followed: where commits begin that came since", "rerun/file.py",
               "        self._writer.note_commits(batch.number, batch.recorded_ns)\n", "",
               LIVE_ROWS),
)  # fmt: skip

REPORTS = (
    _recording(
        "a span that ends before it begins",
        "excerpt/excerpt.py",
        "refuse_reversed(since_ns, until_ns)",
        "pass",
        REPORT,
    ),
    _report("nothing in the data ends a script", "page.py", 'for character in "<>&\\u2028\\u2029":',
            'for character in "":', REPORT),
    _report("the title is text", "page.py", "html.escape(title)", "title", REPORT),
    _report("nothing is loaded", "page.py", "default-src 'none'; ", "", REPORT),
    _report("no script but its own", "page.py", "script-src '{_fingerprint(script)}'; ",
            "script-src 'unsafe-inline'; ", REPORT),
    _axis("nothing is shown within the millisecond before", "zone_times.py",
            "return -(-ns // MS_NS)", "return ns // MS_NS", REPORT),
    _report("no state is shown within the millisecond before", "doors.py",
            '-(-words["folds_ns"] // MS_NS)', 'words["folds_ns"] // MS_NS', REPORT),
    _report("of two words in a millisecond the later holds", "doors.py",
            "np.append(t[1:] != t[:-1], True)", "np.append(True, t[1:] != t[:-1])", REPORT),
    _report("changes are never thinned", "doors.py",
            "(steps[1:] != steps[:-1]) | (states[1:] != states[:-1])", "steps[1:] != steps[:-1]",
            REPORT),
    _report("the last word is never thinned", "doors.py", "        kept[-1] = True\n", "", REPORT),
    _report("words of a door that is not there", "doors.py",
            "said[Life(born, life.removed).covers(said)]", "said", REPORT),
    _report("the page ends before `until`", "report.py",
            "        end_ms = min(end_ms, last_ns // MS_NS)\n", "        pass\n", REPORT),
    _report("doors as they were before `since`", "report.py",
            "brought_by(found, excerpt.before().doors,", "brought_by(found, {},", REPORT),
    _axis("a day begins at its first moment, though midnight comes twice", "time_axis.py",
          "return next(at_ms for", "return max(at_ms for", AXIS),
    _axis("the hour that comes a second time says so", "time_axis.py",
          "if comes_again and at_ms - step_ms < stretch.from_ms:", "if not step_ms:", AXIS),
    _axis("times of day are by the clocks of their stretch", "time_axis.py",
          "* step_ms - stretch.ahead_ms\n", "* step_ms - stretch.before_ms\n", AXIS),
    _axis("no label covers another", "time_axis.py",
          "if fits and all(", "if fits or all(", AXIS),
    _axis("a day that was left out has no tick", "time_axis.py",
          "and self.clock.day(at_ms) < next_day:", "and next_day:", AXIS),
    _recording("a name of which a letter cannot be drawn gives way", "drawable_names.py",
               'category(c)[0] in "LMN" and', 'category(c)[0] in "" and', DRAWABLE),
    _recording("an empty log says what to do", "rerun/nothing.py",
               "if scene.doors:", "if not scene.doors:", RECORDING),
    _axis("weeks begin on Mondays", "time_axis.py",
          "FIRST_MONDAY if step % 7 == 0 else 0", "0", AXIS),
    _axis("the page's time that comes a second time says so", "report/page/ticks.js",
          "&& at - step < from;", "&& at < from;", TICKS),
    _axis("lanes in a picture have these ticks at their moments", "plots/lanes.py",
          "[tick.at_ms for tick in ticks]", "[tick.at_ms + 1_800_000 for tick in ticks]", LANES),
    _report("weeks that reach beyond the log have its zone's offsets", "report.py",
            "span.widened(BESIDE_MS)", "span", BROWSER),
    _axis("offsets change where the zone's clocks do", "zone_times.py",
            "_change_ms(max(day_ms - DAY_MS, span.begin_ms), day_ms, place)", "day_ms", TIMES),
    _report("the track is cut where the robot was not seen", "track.py",
            '    jumps |= np.diff(poses["folds_ns"]) > GAP_MS * 10**6\n', "", TRACK),
    _report("the track stays near the poses", "track.py",
            "            kept.append(i - 1)\n", "            pass\n", TRACK),
)  # fmt: skip

MARKED = (
    _markers("each message deletes what was there", "formats/door_markers.py",
             "[self._delete_all, *(part", "[*(part", LEAVES, MARKERS),
    _markers("ids beyond int32", "formats/door_markers.py",
             "return door_id - 2**32 if door_id >= 2**31 else int(door_id)", "return int(door_id)",
             LEAVES),
    _markers("doors without a place are not drawn", "formats/door_markers.py",
             "return door.is_placed and math.isfinite(sum(door.end))", "return True", MARKERS,
             LEAVES),
    _markers("elements lie as CDR aligns them", "formats/array_messages.py",
             "part.at_4 if (at + gap) % 8 else part.at_0", "part.at_0", ARRAYS),
    _markers("elements begin at multiples of 4", "formats/array_messages.py",
             "gap = -at % _ALIGNMENT", "gap = 0", ARRAYS),
    _markers("states the thesis does not know are UNKNOWN", "formats/thesis_messages.py",
             "reduced(door.state).name", "door.state.name", MARKERS),
    _markers("probabilities that were not given", "formats/thesis_messages.py",
             "return self._default_prob if math.isnan(prob) else prob", "return prob", MARKERS),
    _markers("doors in the order of their ids", "exporting/stream_topics.py",
             "self._shown[door].parts for door in sorted(self._shown)",
             "self._shown[door].parts for door in self._shown", MARKERS),
    _markers("a door that left a level is gone there", "exporting/stream_topics.py",
             "if door is None or door.level != self.level or not is_drawn(door):",
             "if door is None or not is_drawn(door):", MARKERS),
    _markers("events in the order in which they count", "exporting/in_order.py",
             "entries = sorted(_slice(log, first_ns, before_ns), "
             'key=attrgetter("folds_ns", "number"))',
             "entries = list(_slice(log, first_ns, before_ns))", MARKERS),
    _markers("what was taken back is not there", "exporting/in_order.py",
             "seen = (hidden.visible(batch) for batch in batches)", "seen = batches", MARKERS),
    _markers("what waits is sent at the end", "exporting/stream.py",
             "                waiting.send(self._last_ns)\n", "                pass\n", MARKERS),
    _markers("what waits is sent at its time", "exporting/stream.py",
             "        self._catch_up(at_ns)\n", "", MARKERS),
    _markers("doors that have no place are named", "exporting/log_bag.py",
             "for door in doors if not is_drawn(door))", "for door in doors if False)", MARKERS),
    _markers("the bag begins with the state before it", "exporting/stream.py",
             "DoorMap({}, {}) if since_ns is None else log.replay(at=since_ns)", "DoorMap({}, {})",
             MARKERS),
)  # fmt: skip

STATES = (
    _states("of several starts of a round the first counts", "projections/rounds.py",
            "isinstance(event, PatrolStarted) and here.start_ns is None",
            "isinstance(event, PatrolStarted)", PATROLS),
    _states("rounds that were taken back", "projections/rounds.py",
            "if entry.retracted or not", "if not", PATROLS, ROUNDS),
    _states("shares are of the time that is known", "projections/time_shares.py",
            "np.divide(open_ns, known_ns, out=opened, where=known_ns > 0)",
            "np.divide(open_ns, length_ns, out=opened)", SHARES),
    _states("an interval that reaches beyond its slot", "projections/timeline.py",
            "np.diff(before_ns[begun] - beyond_ns)", "np.diff(before_ns[begun])", LINES, SHARES),
    _states("an interval is cut at the begin", "projections/timeline.py",
            "            start = np.maximum(start, since_ns)\n", "", LINES),
    _states("a state after the removal", "projections/timeline.py",
            '            counts &= words["ns"] < self.removed_ns\n', "            pass\n", LINES),
    _states("a day begins with the states before it", "day.py", "chain([opening], today)",
            "chain(today)", DAY),
    _states("a lane of very many intervals shows what held longest", "views/plots/lanes.py",
            "spent.argmax(axis=0)", "spent.argmin(axis=0)", LANES),
    _states("options of a view that exclude each other", "cli/view.py",
            "            if {option, other} <= given:", "            if False:", VIEW),
    _states("options of a view that need another", "cli/view.py",
            "if option in given and other not in given:", "if False:", VIEW),
)  # fmt: skip

PICTURES = (*RECORDINGS, *REPORTS, *MARKED, *STATES)
