// Typical weeks: 7 rows of 24 cells a door, dark is surely closed, bright surely open.

const HOURS = 24, WEEK_HOURS = 168;

/** P(open) of the hour of the week that a moment lies in; null: nobody has seen it. */
function usualAt(door, t) {
  const percent = door.week ? door.week[hourOfWeek(t)] : -1;
  return percent < 0 ? null : percent / 100;
}

const hourOfWeek = (t) => weekday(wall(t)) * HOURS + wall(t).getUTCHours();

function setUpWeeks() {
  const known = doors.filter((door) => door.week);
  const missing = doors.filter((door) => door.isThere(END) && !door.week);
  const place = byId("weeks");
  if (known.length) {
    byId("scale").append("closed ", scaleBar(), " open", el("i", { class: "cell unseen", "aria-hidden": "true" }), "never seen then");
    const levels = new Map();
    for (const door of [...known].sort((a, b) => byLevel(a, b) || a.id - b.id)) {
      if (!levels.has(levelOf(door))) levels.set(levelOf(door), []);
      levels.get(levelOf(door)).push(door);
    }
    for (const [level, here] of levels) {
      if (panels.length > 1) place.append(el("h3", {}, quoted(levelName(level))));
      place.append(el("div", { class: "weeks" }, here.map(weekOf)));
    }
    place.append(el("p", { class: "aside" }, `Rows are days, Monday on top; columns hours, ${data.log.tz}. As known at the end, ${dateText(END)}.`));
  }
  if (missing.length) {
    const reasons = known.length === 0 && missing.length > 1 ? "Of no door is enough known for a typical week." :
      `Too little is known of ${missing.length === 1 ? "" : `${missing.length} doors: `}`;
    const names = missing.slice(0, 12).flatMap((door, i) => [i ? ", " : "", quoted(door.short)]);
    place.append(el("p", { class: "aside" }, reasons, ...(reasons.endsWith(".") ? [] : names),
      !reasons.endsWith(".") && missing.length > 12 ? ` and ${missing.length - 12} more` : null));
  } else if (!known.length) {
    place.append(el("p", { class: "aside" }, "There are no doors at the end."));
  }
  clock.follow((t, chosen) => {
    const hour = hourOfWeek(t);
    for (const figure of place.querySelectorAll("figure")) {
      figure.classList.toggle("chosen", Number(figure.dataset.id) === chosen);
      if (hour === figure.hour) continue;
      figure.hour = hour;
      figure.mark.style.left = `${(100 * (hour % HOURS)) / HOURS}%`;
      figure.mark.style.top = `${(100 * Math.floor(hour / HOURS)) / 7}%`;
    }
  });
}

function weekOf(door) {
  const canvas = el("canvas", { width: HOURS, height: 7, role: "img", "aria-label": weekText(door) });
  const pen = canvas.getContext("2d");
  door.week.forEach((percent, hour) => {
    if (percent < 0) return;
    pen.fillStyle = data.shades[percent];
    pen.fillRect(hour % HOURS, Math.floor(hour / HOURS), 1, 1);
  });
  const mark = el("i", { class: "mark", "aria-hidden": "true" });
  const map = el("div", {
    class: "week", onpointerleave: hideHint,
    onpointermove: (event) => {
      const box = canvas.getBoundingClientRect();
      const hour = clamp(Math.floor(((event.clientX - box.left) / box.width) * HOURS), 0, HOURS - 1);
      const day = clamp(Math.floor(((event.clientY - box.top) / box.height) * 7), 0, 6);
      const percent = door.week[day * HOURS + hour];
      showHint([el("b", {}, quoted(door.name)), `${DAY_NAMES[day]} ${pad(hour)}–${pad(hour + 1)} h: ${
        percent < 0 ? "never seen then" : `P(open) ${shortNumber(percent / 100)}`}`], event.clientX, event.clientY);
    },
  }, canvas, mark);
  const figure = el("figure", { "data-id": door.id }, el("figcaption", {},
    el("button", { type: "button", title: door.name, onclick: () => clock.choose(clock.chosen === door.id ? null : door.id) }, quoted(door.short))),
  el("div", { class: "days", "aria-hidden": "true" }, DAY_NAMES.map((name) => el("span", {}, name.slice(0, 2)))), map,
  el("div", { class: "hours", "aria-hidden": "true" }, [0, 6, 12, 18, 24].map((hour) => el("span", {}, String(hour)))));
  figure.mark = mark;
  return figure;
}

/** What the colours tell, in words: the likeliest and the least likely hour. */
function weekText(door) {
  const seen = door.week.map((percent, hour) => [percent, hour]).filter(([percent]) => percent >= 0);
  if (!seen.length) return `${door.name}: no hour was ever seen`;
  const said = ([percent, hour]) => `${DAY_NAMES[Math.floor(hour / HOURS)]} ${hour % HOURS} h (${percent} %)`;
  const most = seen.reduce((a, b) => (b[0] > a[0] ? b : a)), least = seen.reduce((a, b) => (b[0] < a[0] ? b : a));
  return `${door.name}: open likeliest ${said(most)}, least ${said(least)}; ${WEEK_HOURS - seen.length} hours never seen`;
}

function scaleBar() {
  const bar = el("canvas", { class: "bar", width: 101, height: 1, role: "img", "aria-label": "Colours from P(open) 0 to 1" });
  const pen = bar.getContext("2d");
  data.shades.forEach((colour, percent) => {
    pen.fillStyle = colour;
    pen.fillRect(percent, 0, 1, 1);
  });
  return bar;
}
