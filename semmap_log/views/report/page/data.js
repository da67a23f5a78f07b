// The log as the page holds it, and what is true at a moment. Times: milliseconds after `begin`.

const data = JSON.parse(byId("data").textContent);
const END = data.end;
const AT_THE_END = data.isWhole ? "at the end of the log" : "at the end of the page";
const CLASSES = ["unknown", "open", "closed", "unknown", "unknown"];
const STATE_WORDS = data.states.map((name) => name[0] + name.slice(1).toLowerCase());
/** What a state is called: a dock, which is no door, may be free or taken. */
const wordOf = (door, state) => (door.words || STATE_WORDS)[state];

class Door {
  constructor(raw) {
    Object.assign(this, raw);
    this.times = new Float64Array(raw.t.length);
    this.states = Uint8Array.from(raw.s, Number);
    raw.t.reduce((sum, delta, i) => (this.times[i] = sum + delta), 0);
    const at = [];
    for (let i = 0; i < this.states.length; i++) {
      if (i === 0 || this.states[i] !== this.states[i - 1]) at.push(i);
    }
    /** When a state began that was not the one before, and which; the first is the oldest known. */
    this.changedAt = Float64Array.from(at, (i) => this.times[i]);
    this.changedTo = Uint8Array.from(at, (i) => this.states[i]);
    this.changes = at.filter((i) => i > 0 && this.times[i] <= END).length;
    let told = 0;
    const edges = raw.lapses.map((delta) => (told += delta));
    /** When a sighting stopped holding, and when the door was reported on again. */
    this.lapsedAt = Float64Array.from(edges.filter((_, i) => i % 2 === 0));
    this.lapsedTill = Float64Array.from(edges.filter((_, i) => i % 2), (t) => (t >= END ? Infinity : t));
    this.placedAt = Float64Array.from(raw.places, (place) => place[0]);
    this.givenAt = Float64Array.from(raw.probs, (given) => given[0]);
  }

  isThere(t) {
    return this.added <= t && (this.removed === null || t < this.removed);
  }

  /** Since when the door was not seen at a moment; null: a sighting holds, or a state that was set. */
  lapsedSince(t) {
    const i = lastUpTo(this.lapsedAt, t);
    return i >= 0 && t < this.lapsedTill[i] ? this.lapsedAt[i] : null;
  }

  /** The parts of a time: [from, till, whether the door was not seen then]. */
  *parts(from, till) {
    let begin = from;
    for (let i = Math.max(lastUpTo(this.lapsedAt, from), 0); i < this.lapsedAt.length; i++) {
      const start = Math.max(this.lapsedAt[i], from), end = Math.min(this.lapsedTill[i], till);
      if (start >= till) break;
      if (end <= start) continue;
      if (start > begin) yield [begin, start, false];
      yield [start, end, true];
      begin = end;
    }
    if (begin < till || begin === from) yield [begin, till, false];
  }

  /** What a replay of that moment says of the door; null: it is not in the map. */
  at(t) {
    const run = lastUpTo(this.changedAt, t);
    if (!this.isThere(t) || run < 0) return null;
    const place = this.places[lastUpTo(this.placedAt, t)] || null;
    const given = this.probs[lastUpTo(this.givenAt, t)] || null;
    return {
      state: this.changedTo[run],
      since: this.changedAt[run],
      lapsed: this.lapsedSince(t),
      seen: this.times[lastUpTo(this.times, t)],
      place: place && place.length > 2 ? place : null,
      level: place ? place[1] : 0,
      given,
    };
  }
}

const doors = data.doors.map((raw) => new Door(raw));
const doorOf = new Map(doors.map((door) => [door.id, door]));
const levelNames = new Map(data.levels.map((level) => [level.level, level.name]));
/** A level in words; of several, 0 is none of them where it has no name. */
const levelName = (level) => levelNames.get(level) || (level === 0 ? "No level" : `Level ${level}`);

/** All moments at which a door becomes another, ascending, each once. */
const momentsOfChange = (() => {
  const all = new Set();
  for (const door of doors) for (const t of momentsOf(door)) all.add(t);
  return Float64Array.from(all).sort();
})();

/** The last change: what follows is a tail in which nothing happens to the doors. */
const LAST_CHANGE = momentsOfChange.length ? momentsOfChange[momentsOfChange.length - 1] : END;

function momentsOf(door) {
  const found = [door.added, ...door.placedAt];
  for (const t of door.changedAt) found.push(t);
  if (door.removed !== null) found.push(door.removed);
  return found.filter((t) => t >= 0 && t <= END);
}

/** The robot's runs, each with its level and its points; the last point holds until the next run. */
const runs = data.track.map(([level, ...deltas]) => {
  const length = deltas.length / 3;
  const run = { level, t: new Float64Array(length), x: new Float32Array(length), y: new Float32Array(length) };
  let t = 0, x = 0, y = 0;
  for (let i = 0; i < length; i++) {
    run.t[i] = 100 * (t += deltas[3 * i]);
    run.x[i] = (x += deltas[3 * i + 1]) / 10;
    run.y[i] = (y += deltas[3 * i + 2]) / 10;
  }
  return run;
});

/** The robots, each with its runs in order: the log may be of several. */
const robots = data.robots.map((name, place) => {
  const own = runs.filter((_, i) => data.trackRobots[i] === place);
  return { name, runs: own, runsBegin: Float64Array.from(own, (run) => run.t[0]) };
});

/** From when on each level has been drawn on its later plans: a building may be mapped anew. */
const plansBegin = new Map(data.levels.map((level) => [level.level, (level.earlier ? [...level.earlier.slice(1), level] : []).map((plan) => plan.since)]));

/** Whether a level was mapped anew between two moments; tracks tell tenths of seconds. */
const wasMappedAnew = (level, from, to) => (plansBegin.get(level) || []).some((begin) => from + 100 <= begin && begin <= to);

/** Where a robot is; null: nobody knows, nobody has known for a day, or it was told on another plan. */
function robotAt({ runs, runsBegin }, t) {
  const run = runs[lastUpTo(runsBegin, t)];
  if (!run) return null;
  const i = lastUpTo(run.t, t), told = run.t[i];
  if (t - told > DAY || wasMappedAnew(run.level, told, t)) return null;
  if (i + 1 >= run.t.length) return { level: run.level, x: run.x[i], y: run.y[i], told };
  const share = (t - told) / (run.t[i + 1] - told);
  return {
    level: run.level, told: t,
    x: run.x[i] + share * (run.x[i + 1] - run.x[i]),
    y: run.y[i] + share * (run.y[i + 1] - run.y[i]),
  };
}

/** A robot's way on a level from one moment to another: lines, each a list of [x, y]. */
function wayOf(robot, level, from, to) {
  const { runs, runsBegin } = robot, lines = [];
  for (let r = Math.max(lastUpTo(runsBegin, from), 0); r < runs.length && runs[r].t[0] <= to; r++) {
    const run = runs[r];
    if (run.level !== level) continue;
    const line = [];
    for (let i = Math.max(lastUpTo(run.t, from), 0); i < run.t.length && run.t[i] <= to; i++) {
      line.push([run.x[i], run.y[i]]);
    }
    if (run.t[run.t.length - 1] < from) continue;
    const now = robotAt(robot, to);
    if (now && now.level === level && lastUpTo(runsBegin, to) === r) line.push([now.x, now.y]);
    if (line.length > 1) lines.push(line);
  }
  return lines;
}

/** The round that goes on at a moment; null: none. */
function roundAt(t) {
  const found = data.rounds.filter(([from, till]) => (from ?? 0) <= t && t < (till ?? END + 1));
  return found.length ? found[found.length - 1] : null;
}

/* Times as the building's clocks show them. */

const buildingClock = new WallClock(data.offsets);

/** A Date whose UTC fields are the wall clock's. */
const wall = (t) => buildingClock.wall(data.begin + t);

const offsetText = (t) => aheadText(buildingClock.ahead(data.begin + t));

/** The time of day; in the hour that comes twice with its offset, or two moments look alike. */
const clockText = (t, seconds = true) =>
  timeOfDay(wall(t), seconds) + (buildingClock.comesTwice(data.begin + t) ? ` ${offsetText(t)}` : "");

const dayText = (t) => `${DAY_NAMES[weekday(wall(t))]} ${dayOfMonth(wall(t))}`;

const dateText = (t) => `${dayText(t)} ${wall(t).getUTCFullYear()}`;

/** `2 Mar 14:02:11`: short enough for a table; the weekday is told elsewhere. */
const shortTime = (t) => `${dayOfMonth(wall(t))} ${clockText(t)}`;

/** With which a link tells the moment, to the millisecond. */
const isoText = (t) =>
  wall(t).toISOString().slice(0, -1) + offsetText(t).replace("−", "-");

/** When the local day of a moment began, or one so many days later. */
const midnightBefore = (t, days = 0) =>
  buildingClock.beginOf(buildingClock.day(data.begin + t) + days) - data.begin;

/** `3 min`, `2 h 05`, `4 days`: how long something is ago. */
function ageText(ms) {
  if (ms < 1000) return "now";
  if (ms < MINUTE) return `${Math.floor(ms / 1000)} s`;
  if (ms < HOUR) return `${Math.floor(ms / MINUTE)} min`;
  if (ms < DAY) return `${Math.floor(ms / HOUR)} h ${pad(Math.floor((ms % HOUR) / MINUTE))}`;
  const days = ms / DAY;
  return days < 10 ? `${days.toFixed(1)} days` : `${grouped(Math.floor(days))} days`;
}
