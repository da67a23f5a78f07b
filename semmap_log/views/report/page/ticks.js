// Ticks of the time axis, and their labels: none covers another. `views/time_axis.py` in the
// browser: each tick is what its label says, a time of day or the first moment of a day, a month,
// a year; a time that comes a second time, when clocks are turned back, says how far ahead of UTC.

const CLOCK_STEPS = [
  ...[1, 2, 5, 10, 15, 30].map((n) => n * SECOND), ...[1, 2, 5, 10, 15, 30].map((n) => n * MINUTE),
  ...[1, 2, 3, 6, 12].map((n) => n * HOUR),
];
const DAY_STEPS = [1, 2, 7, 14], MONTH_STEPS = [1, 2, 3, 6];
const YEAR_STEPS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const STEP_GAP = 2, LEAST_GAP = 1; // between labels, in letters: usually, and where clocks change
const FIRST_MONDAY = 4;

/** The ticks from one moment to another: { at, label (or ""), beginsDay }. The axis is so many letters long. */
function timeTicks(start, end, clock, letters, short = false) {
  const length = Math.max(end - start, 1), [dayLetters, monthLetters] = short ? [6, 4] : [10, 8];
  const axis = { start, end, clock, short };
  const steps = [
    ...CLOCK_STEPS.map((ms) => [ms, ms < MINUTE ? 8 : dayLetters, () => timesOf(axis, ms)]),
    ...DAY_STEPS.map((n) => [n * DAY, dayLetters, () => daysOf(axis, n)]),
    ...MONTH_STEPS.map((n) => [n * 28 * DAY, monthLetters, () => monthsOf(axis, n)]),
    ...YEAR_STEPS.map((n) => [n * 365 * DAY, 4, () => monthsOf(axis, 12 * n)]),
  ];
  const [, , make] = steps.find(([ms, wide]) => (ms / length) * letters >= wide + STEP_GAP) || steps[steps.length - 1];
  return labelled(make(), (at) => ((at - start) / length) * letters, letters);
}

/** The times of day that a step marks, and each day's first moment. */
function timesOf(axis, step) {
  const marks = new Map(clockMarks(axis, step).map((tick) => [tick.at, tick]));
  for (const tick of daysOf(axis, 1)) marks.set(tick.at, tick);
  return [...marks.values()].sort((a, b) => a.at - b.at);
}

function clockMarks({ start, end, clock }, step) {
  const marks = [];
  for (const { from, till, ahead, before } of clock.stretches) {
    const low = Math.max(from, start), high = Math.min(till, end + 1);
    for (let at = Math.ceil((low + ahead) / step) * step - ahead; at < high; at += step) {
      const comesAgain = at + ahead < from + before && at - step < from;
      const label = timeOfDay(new Date(at + ahead), step < MINUTE) + (comesAgain ? ` ${aheadText(ahead)}` : "");
      marks.push({ at, label, beginsDay: false });
    }
  }
  return marks;
}

/** The first moments of days; weeks begin on Mondays. */
function daysOf(axis, step) {
  const { start, end, clock, short } = axis, ticks = [];
  const today = clock.day(start), phase = step % 7 ? 0 : FIRST_MONDAY;
  for (let day = today + modulo(phase - today, step); day <= clock.day(end) + 1; day += step) {
    const date = new Date(day * DAY);
    ticks.push(...beginning(axis, day, day + 1, `${short ? "" : `${DAY_NAMES[weekday(date)]} `}${dayOfMonth(date)}`));
  }
  return ticks;
}

/** The first moments of months, or of years. */
function monthsOf(axis, step) {
  const { start, end, clock, short } = axis, ticks = [];
  const now = monthOf(clock.day(start));
  for (let month = now + modulo(-now, step); month <= monthOf(clock.day(end)) + 1; month += step) {
    const year = Math.floor(month / 12), place = month % 12;
    const said = short ? MONTHS[place] : `${MONTHS[place]} ${year}`;
    const label = step % 12 === 0 || (short && place === 0) ? String(year) : said;
    ticks.push(...beginning(axis, firstDay(month), firstDay(month + 1), label));
  }
  return ticks;
}

/** The first moment of some days, unless it is outside, or all were left out. */
function beginning({ start, end, clock }, day, nextDay, label) {
  const at = clock.beginOf(day);
  return start <= at && at <= end && clock.day(at) < nextDay ? [{ at, label, beginsDay: true }] : [];
}

/** Without the labels for which there is no room; days come first, then times that come again. */
function labelled(ticks, place, letters) {
  const rank = ({ beginsDay, label }) => (beginsDay ? 0 : 2) + (label.includes(" ") ? 0 : 1);
  const taken = [], kept = new Set();
  for (const tick of [...ticks].sort((a, b) => rank(a) - rank(b) || a.at - b.at)) {
    const left = place(tick.at), right = left + tick.label.length;
    if (right > letters || taken.some(([a, b]) => right + LEAST_GAP > a && left < b + LEAST_GAP)) continue;
    taken.push([left, right]);
    kept.add(tick.at);
  }
  return ticks.map((tick) => (kept.has(tick.at) ? tick : { ...tick, label: "" }));
}

const modulo = (a, b) => ((a % b) + b) % b;

function monthOf(day) {
  const date = new Date(day * DAY);
  return 12 * date.getUTCFullYear() + date.getUTCMonth();
}

const firstDay = (month) => Date.UTC(Math.floor(month / 12), month % 12, 1) / DAY;
