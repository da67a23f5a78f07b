// Days and clocks of the building's zone. Times: milliseconds since 1970; days: since then, too.

const SECOND = 1000, MINUTE = 60 * SECOND, HOUR = 60 * MINUTE, DAY = 24 * HOUR;
const DAY_NAMES = ["Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"];
const MONTHS = "Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec".split(" ");

const pad = (number, digits = 2) => String(number).padStart(digits, "0");

const weekday = (date) => (date.getUTCDay() + 6) % 7;

/** A zone's clocks, of [from when, seconds ahead of UTC], ascending. */
class WallClock {
  constructor(offsets) {
    /** Times in which the clocks were not changed: [from, till), ahead of UTC, ahead until then. */
    this.stretches = offsets.map(([from, seconds], i) => ({
      from: i ? from : -Infinity,
      till: i + 1 < offsets.length ? offsets[i + 1][0] : Infinity,
      ahead: SECOND * seconds,
      before: SECOND * offsets[Math.max(i - 1, 0)][1],
    }));
  }

  /** By how much they are ahead of UTC. */
  ahead(at) {
    let i = this.stretches.length - 1;
    while (this.stretches[i].from > at) i -= 1;
    return this.stretches[i].ahead;
  }

  /** Tell whether they show the same at another moment, too: in the hour that comes twice. */
  comesTwice(at) {
    const shown = at + this.ahead(at);
    return this.stretches.filter(({ from, till, ahead }) => from <= shown - ahead && shown - ahead < till).length > 1;
  }

  /** A Date whose UTC fields are what they show. */
  wall(at) {
    return new Date(at + this.ahead(at));
  }

  /** The local day of a moment. */
  day(at) {
    return Math.floor((at + this.ahead(at)) / DAY);
  }

  /** The first moment of a local day; of one that was left out (Samoa, 30 December 2011), the next's. */
  beginOf(day) {
    for (const { from, till, ahead } of this.stretches) {
      const at = Math.max(from, day * DAY - ahead);
      if (at < till) return at;
    }
    throw new RangeError(`no day ${day}`);
  }
}

const timeOfDay = (date, seconds) => date.toISOString().slice(11, seconds ? 19 : 16);

const dayOfMonth = (date) => `${date.getUTCDate()} ${MONTHS[date.getUTCMonth()]}`;

function aheadText(ahead) {
  return `${ahead < 0 ? "−" : "+"}${timeOfDay(new Date(Math.abs(ahead)), false)}`;
}
