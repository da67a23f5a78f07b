// A lane for each door: drawn only while it is in sight, so that hundreds stay quick.

const LANE_HEIGHT = 14;
const HEIGHTS = { open: 1, closed: 0.5, unknown: 0.2 }; // a state is told without colours, too
const LAPSED_HEIGHT = 0.2;
const LETTER_PX = 6.7, NARROW_PX = 500;
const LONGEST_NAME = 20, LANES_ON_A_PAGE = 150, LANES_BELOW_AN_AXIS = 30;
const IS_PHONE = innerWidth < 600; // there is room for the id, and where a name begins

const view = { name: "all", from: 0, till: Math.max(END, 1) };
const lanes = [];
let inSight;

function setUpLanes() {
  const axis = el("div", { class: "axis" }, el("div", { class: "lane-name" }), el("div", { class: "ticks", id: "ticks" }));
  const body = el("div", { class: "lanes-body" });
  if (data.rounds.length) lanes.push(new Lane(null, "Patrol rounds"));
  for (const door of [...doors].sort((a, b) => byLevel(a, b) || a.id - b.id)) lanes.push(new Lane(door, door.short));
  const overlay = el("div", { class: "overlay", "aria-hidden": "true" }, el("div", { id: "grid" }), el("div", { id: "now" }));
  body.append(...withLevels(lanes), overlay);
  byId("lanes").append(axis, body);
  inSight = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) target.lane.see(isIntersecting);
  }, { root: byId("lanes"), rootMargin: "120px 0px" });
  for (const lane of lanes) inSight.observe(lane.element);
  setUpWindows();
  setUpPages();
  new ResizeObserver(() => {
    drawTicks();
    redrawLanes();
  }).observe(byId("ticks"));
  clock.follow((t, chosen) => {
    if (view.name !== "all" && !(view.from <= t && t < view.till)) setWindow(view.name);
    byId("now").style.left = `calc((100% - 2px) * ${shareOf(t)})`;
    byId("now").hidden = false;
    for (const lane of lanes) lane.element.classList.toggle("chosen", lane.door !== null && lane.door.id === chosen);
  });
}

const levelOf = (door) => (door.places.length ? door.places[door.places.length - 1][1] : 0);

const byLevel = (a, b) => levelOf(a) - levelOf(b);

/** The lanes, with a heading where another level begins. */
function withLevels(all) {
  if (panels.length === 1) return all.map((lane) => lane.element);
  let level = null;
  return all.flatMap((lane) => {
    if (!lane.door || levelOf(lane.door) === level) return [lane.element];
    level = levelOf(lane.door);
    return [el("h3", { class: "lane-level" }, quoted(levelName(level))), lane.element];
  });
}

const shareOf = (t) => (t - view.from) / (view.till - view.from);

class Lane {
  constructor(door, name) {
    this.door = door;
    this.picture = drawn("svg", { preserveAspectRatio: "none", role: "img", "aria-label": door ? spanText(door) : count(data.rounds.length, "patrol round") });
    const label = door
      ? el("button", { type: "button", title: door.name, onclick: () => clock.choose(clock.chosen === door.id ? null : door.id) }, quoted(IS_PHONE ? `${door.id} ${name}` : shortened(name, LONGEST_NAME)))
      : el("span", {}, name);
    this.element = el("div", { class: door ? "lane" : "lane rounds", "data-id": door ? door.id : null },
      el("div", { class: "lane-name" }, label), el("div", { class: "lane-bar" }, this.picture));
    this.element.lane = this;
    this.isSeen = false;
    const bar = this.element.lastChild;
    const momentOf = (event) => {
      const box = bar.getBoundingClientRect();
      return view.from + clamp((event.clientX - box.left) / box.width, 0, 1) * (view.till - view.from);
    };
    bar.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      clock.set(momentOf(event));
      if (event.pointerType === "mouse") bar.setPointerCapture(event.pointerId);
    });
    bar.addEventListener("pointermove", (event) => {
      if (bar.hasPointerCapture(event.pointerId)) clock.set(momentOf(event));
      showHint(this.told(Math.round(momentOf(event))), event.clientX, event.clientY);
    });
    bar.addEventListener("pointerleave", hideHint);
  }

  see(isSeen) {
    this.isSeen = isSeen;
    if (isSeen) this.draw();
    else this.picture.replaceChildren(); // gives back its memory
  }

  /** One path a state, as vectors: so it is sharp on paper, too. What is short lies on top. */
  draw() {
    const width = this.picture.parentElement.clientWidth || 1000;
    this.picture.setAttribute("viewBox", `0 0 ${width} ${LANE_HEIGHT}`);
    const paths = this.door ? this.statePaths(width) : this.roundPaths(width);
    this.picture.replaceChildren(...Object.entries(paths).filter(([, parts]) => parts.length)
      .map(([name, parts]) => drawn("path", { class: name, d: parts.join("") })));
  }

  statePaths(width) {
    const { changedAt, changedTo, added, removed } = this.door;
    const paths = {}, drawnTo = {};
    const last = Math.min(removed ?? END, END);
    for (const name of Object.keys(HEIGHTS)) paths[`${name} lapsed`] = [];
    for (const name of Object.keys(HEIGHTS)) paths[name] = [];
    for (let i = Math.max(lastUpTo(changedAt, view.from), 0); i < changedAt.length; i++) {
      const from = Math.max(changedAt[i], added, view.from);
      const till = Math.min(i + 1 < changedAt.length ? changedAt[i + 1] : last, last, view.till);
      if (from > view.till) break;
      for (const [begin, end, isLapsed] of this.door.parts(from, till)) {
        const name = CLASSES[changedTo[i]] + (isLapsed ? " lapsed" : "");
        const x = shareOf(begin) * width, right = Math.max(shareOf(end) * width, x + 1);
        if (end < begin || right <= (drawnTo[name] ?? -1)) continue; // no eye sees it
        paths[name].push(boxOf(x, right, isLapsed ? LAPSED_HEIGHT : HEIGHTS[name]));
        drawnTo[name] = Math.ceil(right);
      }
    }
    return paths;
  }

  roundPaths(width) {
    const paths = { round: [], "round guessed": [] };
    for (const [from, till] of data.rounds) {
      const x = shareOf(from ?? 0) * width, end = Math.max(shareOf(till ?? END) * width, x + 1);
      if (end < 0 || x > width) continue;
      paths[from === null || till === null ? "round guessed" : "round"].push(boxOf(x, end, 0.6));
    }
    return paths;
  }

  told(t) {
    const when = `${dateText(t)} ${clockText(t)}`;
    if (!this.door) {
      const round = roundAt(t);
      return [round ? quoted(roundText(round)) : "No patrol", when];
    }
    const now = this.door.at(t);
    const title = el("b", {}, quoted(this.door.name));
    if (!now) return [title, when, "not in the map"];
    const lines = [title, when, el("span", {}, dot(now.state), `${wordOf(this.door, now.state)} ${sinceText(now)}`)];
    return now.lapsed === null ? lines : [...lines, lapsedText(this.door, now)];
  }
}

const boxOf = (x, end, share) =>
  `M${x.toFixed(1)} ${LANE_HEIGHT}v${-share * LANE_HEIGHT}H${end.toFixed(1)}V${LANE_HEIGHT}z`;

/** The share of its known time that a door was open, for who cannot see its lane. */
function spanText(door) {
  let open = 0, known = 0, lapsed = 0;
  door.changedAt.forEach((from, i) => {
    const till = i + 1 < door.changedAt.length ? door.changedAt[i + 1] : door.removed ?? END;
    for (const [begin, end, isLapsed] of door.parts(Math.max(from, 0), Math.min(till, END))) {
      const length = Math.max(end - begin, 0);
      if (isLapsed) lapsed += length;
      else if (door.changedTo[i] === 1) open += length;
      if (!isLapsed && (door.changedTo[i] === 1 || door.changedTo[i] === 2)) known += length;
    }
  });
  const share = known ? `open ${Math.round((100 * open) / known)} % of the time in which that was known` : "never known";
  const unseen = lapsed ? `, not seen for ${ageText(lapsed)}` : "";
  return `${door.name}: ${share}${unseen}, ${count(door.changes, "change")}`;
}

/** Write the times above every so many lanes, so that each sheet of paper has them. */
function repeatAxis() {
  const axis = document.querySelector(".axis");
  for (let i = LANES_BELOW_AN_AXIS; i < lanes.length; i += LANES_BELOW_AN_AXIS) {
    const again = axis.cloneNode(true);
    again.classList.add("again");
    for (const part of again.querySelectorAll("[id]")) {
      part.classList.add(part.id);
      part.removeAttribute("id");
    }
    lanes[i].element.before(again);
  }
}

function redrawLanes(all = false) {
  for (const lane of lanes) if (all || lane.isSeen) lane.draw();
}

/* Which doors are shown: of hundreds, so many at once. On paper, all. */

function setUpPages() {
  const paged = lanes.filter((lane) => lane.door), pages = Math.ceil(paged.length / LANES_ON_A_PAGE);
  if (pages < 2) return;
  const numbers = [...Array(pages).keys()];
  const last = (page) => Math.min((page + 1) * LANES_ON_A_PAGE, paged.length);
  const choice = el("select", { id: "lane-page", "aria-label": "Which doors have lanes", onchange: () => show(Number(choice.value)) },
    numbers.map((page) => el("option", { value: page }, `Doors ${page * LANES_ON_A_PAGE + 1} to ${last(page)} of ${paged.length}`)));
  const show = (page) => {
    choice.value = String(page);
    paged.forEach((lane, i) => lane.element.classList.toggle("off-page", Math.floor(i / LANES_ON_A_PAGE) !== page));
    for (const heading of document.querySelectorAll(".lane-level")) heading.classList.toggle("off-page", isEmpty(heading));
  };
  byId("windows").prepend(choice);
  show(0);
  let chosenThen = null;
  clock.follow((t, chosen) => {
    if (chosen === chosenThen) return;
    chosenThen = chosen;
    const place = paged.findIndex((lane) => lane.door.id === chosen);
    if (place >= 0) show(Math.floor(place / LANES_ON_A_PAGE));
  });
}

/** Tell whether no lane of a level is shown on the page. */
function isEmpty(heading) {
  let next = heading.nextElementSibling;
  while (next && next.classList.contains("off-page")) next = next.nextElementSibling;
  return !next || !next.classList.contains("lane");
}

/* Which part of the time is shown. */

const LENGTHS = { hour: HOUR, day: DAY, week: 7 * DAY, all: Infinity };

function setUpWindows() {
  const buttons = Object.entries(LENGTHS).map(([name, length]) => el("button", {
    type: "button", "data-window": name, disabled: name !== "all" && length >= END, onclick: () => setWindow(name),
  }, name[0].toUpperCase() + name.slice(1)));
  byId("windows").append(
    el("button", { type: "button", class: "turn", "aria-label": "Earlier", title: "Earlier", onclick: () => shift(-1) }, "‹"),
    ...buttons,
    el("button", { type: "button", class: "turn", "aria-label": "Later", title: "Later", onclick: () => shift(1) }, "›"));
  setWindow("all");
}

/** The hour, day or week of a moment by the building's clocks, or all. */
function spanOf(name, t) {
  const hour = t - (((wall(t).getTime() % HOUR) + HOUR) % HOUR), monday = -weekday(wall(t));
  return { hour: [hour, hour + HOUR], day: [midnightBefore(t), midnightBefore(t, 1)],
    week: [midnightBefore(t, monday), midnightBefore(t, monday + 7)], all: [0, Math.max(END, 1)] }[name];
}

/** Show the hour, day or week of the moment, or all. */
function setWindow(name) {
  view.name = name;
  [view.from, view.till] = spanOf(name, clock.t);
  for (const button of byId("windows").querySelectorAll("button")) {
    if (button.dataset.window) button.setAttribute("aria-pressed", String(button.dataset.window === name));
    else button.disabled = name === "all";
  }
  drawTicks();
  redrawLanes();
  byId("now").style.left = `calc((100% - 2px) * ${shareOf(clock.t)})`;
}

/** Go to the next hour, day or week, or the one before: so far into it as into this one. */
function shift(direction) {
  if (view.name === "all") return;
  const [from, till] = spanOf(view.name, direction > 0 ? view.till : view.from - 1);
  clock.set(Math.min(from + clock.t - view.from, till - 1));
}

function drawTicks() {
  const width = byId("ticks").clientWidth || 800;
  const ticks = timeTicks(data.begin + view.from, data.begin + view.till, buildingClock, width / LETTER_PX, width < NARROW_PX);
  const place = (element, { at }) => {
    element.style.left = `${100 * shareOf(at - data.begin)}%`;
    return element;
  };
  byId("ticks").replaceChildren(...ticks.filter(({ label }) => label).map((tick) => place(el("span", {}, tick.label), tick)));
  byId("grid").replaceChildren(...ticks.map((tick) => place(el("i", { class: tick.beginsDay ? "midnight" : null }), tick)));
}
