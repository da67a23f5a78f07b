"""Every rule that keeps a probability honest: what counts as evidence, how much, and from when."""

from __future__ import annotations

from mutation.mutant import Mutant, mutants_in

ROOM = "semmap_log/probabilities/"
TESTS = "tests/probabilities/"
EVENTS = TESTS + "evidence/test_evidence.py"
TABLES = TESTS + "evidence/test_day_tables.py"
NODES = TESTS + "chain/test_nodes.py"
CHAIN = TESTS + "chain/test_chain.py"
RATES = TESTS + "chain/test_rates.py"
FORGETTING = TESTS + "chain/test_forgetting.py"
HABITS = TESTS + "methods/test_habits.py"
AVERAGING = TESTS + "methods/test_averaging.py"
SCHEDULE = TESTS + "methods/test_schedule.py"
FILTER = TESTS + "methods/test_filter.py"
EPOCHS = TESTS + "methods/test_filter_epochs.py"
WAITING = TESTS + "methods/test_waiting.py"
MEMORY = TESTS + "methods/test_memory.py"
COUNT = TESTS + "methods/test_count.py"
LAST = TESTS + "methods/test_last.py"
ALL = TESTS + "test_estimators.py"
FOLD = TESTS + "test_belief_fold.py"
CLOCK = TESTS + "test_local_clock.py"
SCORES = TESTS + "test_scores.py"
NO_PEEKING = "tests/beliefs/test_no_peeking.py"
EVALUATION = "tests/beliefs/test_evaluation.py"
APPLYING = "tests/beliefs/test_applying.py"


_put = mutants_in(ROOM)


EVIDENCE = (
    _put("readings corrected in the tables", "evidence/day_tables.py",
         "excess = evidence.reads_open - (1.0 - evidence.accuracy_closed)",
         "excess = evidence.reads_open * tells", TABLES),
    _put("visits fill what stretches leave of an hour", "evidence/day_tables.py",
         "np.minimum(seen.weight, free)", "seen.weight", TABLES),
    _put("silence of thirty days is a gap", "evidence/holds.py",
         "HOLDS_NS = 30 * DAY_NS", "HOLDS_NS = 3000 * DAY_NS", EVENTS),
    _put("what the map said at first gives way", "evidence/holds.py",
         " | (means[base] == Means.ADDED)", "", EVENTS),
    _put("a state that is none begins a gap", "evidence/holds.py",
         "holds = tells[base] & ", "holds = ", EVENTS),
    _put("a pass is the mean of its sightings", "evidence/visits.py",
         "np.where(place == first, llr, mean - np.append(0.0, mean[:-1]))", "llr", EVENTS, FILTER),
    _put("a pass lasts five minutes", "evidence/visits.py",
         "PASS_NS = 300 * SECOND_NS", "PASS_NS = 3000 * SECOND_NS", EVENTS),
    _put("no reading is a proof", "evidence/visits.py",
         "LEAST_ACCURACY, MOST_ACCURACY = 0.5, 0.999",
         "LEAST_ACCURACY, MOST_ACCURACY = 0.5, 1 - 1e-9", EVENTS),
    _put("a sensor's two accuracies", "evidence/visits.py",
         "when_closed = np.clip(accuracy_closed,", "when_closed = np.clip(accuracy_open,", EVENTS,
         FILTER),
    _put("stretches end where knowledge does", "evidence/evidence.py",
         "end_ns=np.minimum(self.end_ns[held], until_ns)", "end_ns=self.end_ns[held]", EVENTS),
    _put("the last state holds at the end, too", "evidence/evidence.py",
         "holds_on = bool((last > until_ns).any()) or (", "holds_on = (", NODES, NO_PEEKING),
    _put("held at the end", "chain/nodes.py", "if evidence.holds_on:", "if False:", NODES),
    _put("the end of what is known is a look", "chain/nodes.py",
         "ends = _last_known(evidence)", "ends = _last_known(evidence) & False", NODES),
)  # fmt: skip

CLOCKS = (
    _put("hours are local", "local_clock.py",
         "(seconds + self.offset_s(seconds) - _MONDAY_S) // HOUR_S",
         "(seconds - _MONDAY_S) // HOUR_S", CLOCK, SCHEDULE),
    _put("what clocks show is local", "local_clock.py",
         "return seconds + self.offset_s(seconds) - _MONDAY_S +", "return seconds - _MONDAY_S +",
         CLOCK, FORGETTING),
    _put("rates are of local hours", "chain/nodes.py",
         "clock.hour_of(times_ns[inside]) % 24", "times_ns[inside] // (2 * LOOK_NS) % 24", NODES),
)  # fmt: skip

CHAINS = (
    _put("rates within bounds", "chain/rates.py",
         "np.clip(np.where(enough, found, otherwise), LEAST_PER_S, MOST_PER_S)",
         "np.where(enough, found, otherwise)", RATES, WAITING),
    _put("an hour's rates are drawn to the door's", "chain/rates.py",
         "0.0 if prior is None else PRIOR_S", "0.0", RATES),
    _put("only unseen changes make rates", "chain/rates.py",
         "later = np.stack([(1 - sees) * (1 - along.later[inner]), sees * along.later[inner]])",
         "later = np.stack([1 - sees, sees])", RATES),
    _put("rates hold from a node on", "chain/chain.py",
         "before = np.append(0, nodes.bin[:-1])\n    long_run", "before = nodes.bin\n    long_run",
         CHAIN, RATES),
    _put("what is kept falls", "chain/forgetting.py",
         "self._through(to_s) - self._through(from_s)",
         "self._through(from_s) - self._through(to_s)", FORGETTING),
    _put("nothing is more than fresh", "chain/forgetting.py",
         "np.exp(-np.maximum(through, 0.0))", "np.exp(-through)", FORGETTING),
)  # fmt: skip

TABLES_OF_HABITS = (
    _put("a door that nobody knows is at one half", "forecast.py",
         "PRIOR_P = 0.5", "PRIOR_P = 0.3", HABITS, ALL),
    _put("weight of coarser tables", "methods/habits.py",
         "HOUR_DAYS, WEEK_DAYS = 2.0, 4.0", "HOUR_DAYS, WEEK_DAYS = 2.0, 2.0", HABITS),
    _put("weight of hours beside", "methods/habits.py",
         "near = _toward(*beside, coarser, weight_days)", "near = coarser", HABITS),
    _put("midnight is beside eleven", "methods/habits.py",
         "np.minimum(apart, 24 - apart)", "apart", HABITS),
    _put("five working days", "methods/habits.py",
         "WORKING_DAYS, DAYS_IN_WEEK = 5, 7", "WORKING_DAYS, DAYS_IN_WEEK = 6, 7", HABITS),
    _put("a share handed out anew", "methods/averaging.py",
         "(1 - share) * gained + share * start", "gained", AVERAGING),
    _put("long memories for what is far", "methods/averaging.py",
         "start = 1 / (1 + leads / habits.half_lives_d)",
         "start = 1 / (1 + 0 * leads / habits.half_lives_d)", AVERAGING),
    _put("tables scored as old as their forecasts", "methods/averaging.py",
         "habits.p_open[days - lead,", "habits.p_open[days,", AVERAGING),
    _put("hours of a day hang together", "methods/averaging.py",
         "RATE / (1 + leads / DAYS_IN_WEEK)", "1.0", AVERAGING),
)  # fmt: skip

METHODS = (
    _put("a schedule knows nothing of today", "methods/schedule.py",
         "np.clip(known_day - self._first_day, 0,", "np.clip(known_day - self._first_day + 1, 0,",
         SCHEDULE, NO_PEEKING),
    _put("UNKNOWN below three hours", "methods/schedule.py",
         "self._seen_h[row, hour] >= LEAST_H", "self._seen_h[row, hour] >= 0", SCHEDULE),
    _put("a memory's worth is of the days before", "methods/memory.py",
         "day = self._days(then_ns) - first_day + 1", "day = self._days(then_ns) - first_day",
         MEMORY, NO_PEEKING),
    _put("a memory's worth beyond the chain's", "methods/memory.py",
         "self.targets[rows] - kept[:, None] * products[..., 0]", "self.targets[rows]", MEMORY),
    _put("evidence counts up to the forecast", "methods/filter.py",
         "        known_ns = np.minimum(known_ns, times_ns)\n", "", EPOCHS),
    _put("rates are of the days before", "methods/filter.py",
         "lessons(self._evidence.up_to(first_ns - 1), self._clock, back_ns, first_ns - 1)",
         "lessons(self._evidence, self._clock, back_ns, self._evidence.until_ns)", EPOCHS),
    _put("a look before the first sighting", "methods/filter.py",
         "RUN_UP_D) - LOOK_NS", "RUN_UP_D)", EPOCHS),
    _put("looks in a row wear nothing out", "methods/epoch.py",
         "LEAST * np.minimum((times_ns - before_ns) / LOOK_NS, 1.0)", "LEAST", FILTER),
    _put("a deviation is from the schedule of its time", "methods/filter.py",
         "self.schedule.p_open(belief.told_ns, known)", "self.schedule.p_open(times, known)",
         FILTER, EPOCHS),
    _put("what was seen grows old", "methods/filter.py", ">= FRESH", ">= 0", FILTER),
    _put("until open, or until closed", "methods/filter.py",
         "rate * (expected if until_open else 1 - expected)",
         "rate * (1 - expected if until_open else expected)", WAITING),
    _put("who is there already does not wait", "methods/filter.py",
         "float(1 - here if until_open else here)", "1.0", WAITING),
    _put("no faster than looks", "methods/filter.py",
         "np.minimum(forgetting.rates.relaxation, 1 / step_s)", "forgetting.rates.relaxation",
         WAITING),
    _put("readings corrected in a count", "methods/count.py",
         "evidence.reads_open[first] - (1 - evidence.accuracy_closed[first])",
         "evidence.reads_open[first] * tells", COUNT),
    _put("visits of an hour are its mean", "methods/count.py",
         "np.unique(clock.hour_of(evidence.seen_ns[first]), return_inverse=True)",
         "np.unique(evidence.seen_ns[first], return_inverse=True)", COUNT),
    _put("a count is by time", "evidence/stretches.py",
         "np.cumsum(end_ns - start_ns)", "np.cumsum(end_ns - start_ns > 0)", COUNT),
    _put("a last word that is not yet said", "methods/last.py",
         "np.minimum(times_ns, known_ns)", "times_ns", NO_PEEKING),
    _put("before any word, unsure", "methods/last.py",
         "np.where(is_known, p_open, LEAST)", "p_open", ALL),
    _put("an interval around its probability", "forecast.py",
         "np.clip(low, LEAST, p_open), np.clip(high, p_open, MOST)", "low, high", ALL),
    _put("rates that a late word moves are learnt anew", "methods/filter.py",
         " if at_ns <= unmoved_until_ns}", "}", FOLD),
    _put("late words are learnt", "belief_fold.py", "words == len(self.evidence) and ", "", FOLD),
)  # fmt: skip

FIGURES = (
    _put("a certain forecast is in the last bin", "scores.py",
         "np.minimum((p * BINS).astype(np.int64), BINS - 1)", "(p * BINS).astype(np.int64)",
         SCORES),
    _put("errors of two bins do not cancel", "scores.py",
         "np.abs(self.said - self.came).sum()", "abs((self.said - self.came).sum())", SCORES),
    _put("a surprise costs so much at most", "scores.py", "np.clip(p, CLIP, 1 - CLIP)",
         "np.clip(p, 1e-9, 1 - 1e-9)", SCORES),
    Mutant("a day is known when it is over", "semmap_log/beliefs/protocol.py",
           "return np.minimum(clock.midnights_ns(days), known_ns)", "return known_ns",
           (EVALUATION,)),
    Mutant("numbers are written to six digits", "semmap_log/beliefs/applying.py",
           "p_open = round(belief.p_open, DIGITS)", "p_open = belief.p_open", (APPLYING,)),
    Mutant("numbers that are there already", "semmap_log/beliefs/applying.py",
           " and _differs(belief, there.get(belief.door.door_id))", "", (APPLYING,)),
    Mutant("doors that are unknown get no numbers", "semmap_log/beliefs/applying.py",
           "known = [belief for belief in beliefs if belief.is_known]", "known = beliefs",
           (APPLYING,)),
)  # fmt: skip

BELIEFS = (*EVIDENCE, *CLOCKS, *CHAINS, *TABLES_OF_HABITS, *METHODS, *FIGURES)
