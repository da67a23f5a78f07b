// The floor plan: a panel a level, doors as lines coloured by their state, the robot and its track.

const TRACK_MS = 30 * MINUTE;
const MOST_ZOOM = 24;
const MOST_NAMES = 24;
const ROOM_LETTER = 5.5; // pixels, about

class LevelPanel {
  constructor(level) {
    this.level = level.level;
    this.plans = [...(level.earlier || []), level]; // a building may be mapped anew
    this.plan = null;
    this.zoom = 1;
    this.marks = doors
      .filter((door) => door.places.some((place) => place[1] === this.level && place.length > 2))
      .map((door) => this.markOf(door));
    this.pictures = this.plans.map(({ floor }) => floor && pictureOf("floor", floor));
    this.tints = this.plans.map(({ rooms }) => rooms && pictureOf("rooms", rooms));
    this.roomNames = drawn("g", { class: "room-names", "aria-hidden": "true" });
    this.track = drawn("path", { class: "track" });
    this.robots = robots.map(() => drawn("circle", { class: "robot", r: 6 }));
    this.labels = drawn("g", { class: "labels", "aria-hidden": "true" });
    this.metres = drawn("g", { class: "metres", "aria-hidden": "true" });
    this.svg = drawn("svg", { class: "map", role: "group", "aria-label": `Plan of ${level.name}` },
      ...this.tints, ...this.pictures, this.roomNames, this.track, ...this.marks.map((mark) => mark.group), ...this.robots, this.labels, this.metres);
    this.unplaced = el("div", { class: "unplaced" });
    this.unlabelled = el("p", { class: "aside unlabelled" });
    this.element = el("div", { class: "level", role: "tabpanel", id: `level-${this.level}`, "aria-label": level.name },
      el("h3", { class: "printed" }, quoted(level.name)), level.isEmpty ? el("p", { class: "aside" }, "Nothing on this level has a place: there is no plan to draw.") : this.svg,
      this.unlabelled, this.unplaced);
    this.isEmpty = level.isEmpty;
    this.drawOn(this.plans.length - 1);
    this.setUpPointer();
  }

  /** Take the plan of that place; doors and robots of its time lie in its frame. */
  drawOn(place) {
    this.plan = this.plans[place];
    for (const images of [this.pictures, this.tints]) {
      images.forEach((image, i) => image && image.classList.toggle("gone", i !== place));
    }
    this.zoom = 1;
  }

  /** Return the place of the plan on which a moment is drawn. */
  planAt(t) {
    let place = this.plans.length - 1;
    while (place > 0 && t < this.plans[place].since) place -= 1;
    return place;
  }

  markOf(door) {
    const group = drawn("g", {
      class: "door", tabindex: 0, role: "button", "data-id": door.id,
      onclick: (event) => { event.stopPropagation(); clock.choose(clock.chosen === door.id ? null : door.id); },
      onkeydown: (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        event.stopPropagation();
        clock.choose(clock.chosen === door.id ? null : door.id);
      },
      onpointermove: (event) => showHint(linesOf(door, clock.t), event.clientX, event.clientY),
      onpointerleave: hideHint,
      onfocus: () => {
        const box = group.getBoundingClientRect();
        if (group.matches(":focus-visible")) showHint(linesOf(door, clock.t), box.right, box.bottom);
      },
      onblur: hideHint,
    });
    const shape = door.isOutlined ? "polyline" : "line";
    const mark = { door, group, halo: drawn(shape, { class: "halo" }), line: drawn(shape, { class: "leaf" }), hit: drawn(shape, { class: "hit" }) };
    group.append(mark.halo, mark.line, mark.hit);
    return mark;
  }

  /** Fit the bounds into the room there is; the size in pixels is the viewBox. */
  resize(width) {
    const [left, low, right, high] = this.plan.bounds;
    this.width = Math.max(width, 200);
    // As high as the highest of the plans: what lies below must not jump when another one comes.
    this.height = Math.max(...this.plans.map((plan) => this.heightOf(plan)));
    this.fit = Math.min(this.width / (right - left), this.height / (high - low));
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    if (this.zoom === 1) this.middle = [(left + right) / 2, (low + high) / 2];
    this.layOut();
  }

  heightOf({ bounds: [left, low, right, high], floor }) {
    const most = Math.min(floor ? 640 : 420, Math.max(window.innerHeight * 0.72, 320));
    return clamp((this.width * (high - low)) / (right - left), Math.min(220, most), most);
  }

  pixel(x, y) {
    const scale = this.fit * this.zoom;
    return [this.width / 2 + (x - this.middle[0]) * scale, this.height / 2 - (y - this.middle[1]) * scale];
  }

  zoomBy(factor, x = this.width / 2, y = this.height / 2) {
    const before = this.fit * this.zoom;
    this.zoom = clamp(this.zoom * factor, 1, MOST_ZOOM);
    const after = this.fit * this.zoom;
    this.middle[0] += (x - this.width / 2) * (1 / before - 1 / after);
    this.middle[1] -= (y - this.height / 2) * (1 / before - 1 / after);
    this.keepInside();
    this.layOut();
  }

  /** Bring a place into the middle, where only a part of the plan is seen. */
  centre([, , x, y]) {
    if (this.zoom === 1) return;
    this.middle = [x, y];
    this.keepInside();
    this.layOut();
  }

  keepInside() {
    const [left, low, right, high] = this.plan.bounds;
    if (this.zoom === 1) this.middle = [(left + right) / 2, (low + high) / 2];
    this.middle = [clamp(this.middle[0], left, right), clamp(this.middle[1], low, high)];
    this.svg.classList.toggle("zoomed", this.zoom > 1);
  }

  /** Place everything that only moves with the view; doors and robot follow. */
  layOut() {
    if (!this.width) return;
    const scale = this.fit * this.zoom;
    const place = this.plans.indexOf(this.plan);
    this.lay(this.pictures[place], this.plan.floor, scale);
    this.lay(this.tints[place], this.plan.rooms, scale);
    this.nameRooms(scale);
    this.drawMetres(scale);
    this.places = null;
    this.show(clock.t, clock.chosen);
  }

  /** Names of rooms give way to the labels of doors. */
  yieldTo(labels) {
    for (const name of this.roomNames.children) {
      const x = Number(name.getAttribute("x")), y = Number(name.getAttribute("y"));
      const reach = (label) => (label.text.length + name.textContent.length) * (ROOM_LETTER / 2) + 4;
      name.classList.toggle("gone", labels.some((label) => Math.abs(label.y - y) < 12 && Math.abs(label.x - x) < reach(label)));
    }
  }

  lay(image, where, scale) {
    if (!image) return;
    const [a, b, c, d, e, f] = where.matrix;
    const [x, y] = this.pixel(e, -f);
    image.setAttribute("transform", `matrix(${[a, b, c, d].map((n) => n * scale).join(" ")} ${x} ${y})`);
  }

  /** Write the names that find room; the others wait until somebody looks more closely. */
  nameRooms(scale) {
    const names = (this.plan.rooms ? this.plan.rooms.names : []).filter(([, , name, side]) => side * scale > name.length * ROOM_LETTER);
    this.roomNames.replaceChildren(...names.map(([x, y, name]) => {
      const [across, down] = this.pixel(x, y);
      return drawn("text", { x: across, y: down }, name);
    }));
  }

  drawMetres(scale) {
    const wanted = 90 / scale, power = 10 ** Math.floor(Math.log10(wanted));
    const metres = power * [5, 2, 1].find((n) => n * power <= wanted);
    const x = 14, y = this.height - 14;
    this.metres.replaceChildren(
      drawn("path", { d: `M${x} ${y - 4}v4h${metres * scale}v-4` }),
      drawn("text", { x: x + 4, y: y - 6 }, `${metres} m`));
  }

  show(t, chosen) {
    if (!this.width) return;
    const place = this.planAt(t);
    if (this.plans[place] !== this.plan) {
      this.drawOn(place);
      this.resize(this.width); // which shows all of it
      return;
    }
    const now = this.marks.map(({ door }) => door.at(t));
    const places = now.map((state) => (state && state.place && state.level === this.level ? state.place : null));
    const moved = !this.places || chosen !== this.chosenThen || places.some((place, i) => place !== this.places[i]);
    this.places = places;
    this.chosenThen = chosen;
    this.marks.forEach((mark, i) => {
      const state = now[i];
      mark.group.classList.toggle("gone", !places[i]);
      mark.group.classList.toggle("chosen", mark.door.id === chosen);
      if (state) {
        mark.group.dataset.state = data.states[state.state];
        mark.group.classList.toggle("lapsed", state.lapsed !== null);
        mark.group.setAttribute("aria-label", `${mark.door.name}: ${wordOf(mark.door, state.state)}`);
      }
    });
    if (moved) this.drawDoors();
    this.showRobot(t);
    this.showUnplaced(t, chosen);
  }

  drawDoors() {
    const labelled = [];
    this.marks.forEach(({ door, halo, line, hit }, i) => {
      const place = this.places[i];
      if (!place) return;
      const points = pointsOf(place).map(([x, y]) => this.pixel(x, y));
      const [a, b] = door.isOutlined ? boxAround(points) : points;
      for (const part of [halo, line, hit]) {
        if (door.isOutlined) {
          part.setAttribute("points", points.map((point) => point.join()).join(" "));
          continue;
        }
        part.setAttribute("x1", a[0]);
        part.setAttribute("y1", a[1]);
        part.setAttribute("x2", b[0]);
        part.setAttribute("y2", b[1]);
      }
      const x = (a[0] + b[0]) / 2, y = (a[1] + b[1]) / 2; // a label beside nothing would be another's
      const inside = x >= 0 && y >= 0 && x <= this.width && y <= this.height;
      if (inside) labelled.push({ text: door.short, id: door.id, a, b, isChosen: door.id === clock.chosen });
    });
    labelled.sort((one, other) => other.isChosen - one.isChosen);
    // Many names would hide the plan: then ids stand for them, until somebody looks more closely.
    const named = labelled.length <= MOST_NAMES;
    for (const mark of labelled) if (!named && !mark.isChosen) mark.text = String(mark.id);
    const placed = placeLabels(labelled, this.width, this.height - 18);
    this.labels.replaceChildren(...placed.flatMap((label, i) => (label ? [drawn("text", {
      x: label.x, y: label.y, class: labelled[i].isChosen ? "chosen" : null,
    }, label.text)] : [])));
    this.yieldTo(placed.filter(Boolean));
    const without = placed.filter((label) => !label).length;
    say(this.unlabelled, without ? `There is no room for the labels of ${count(without, "door")}: zoom in, or point at one.` : "");
  }

  showRobot(t) {
    const since = this.plans.indexOf(this.plan) ? this.plan.since : -Infinity;
    robots.forEach((one, i) => {
      const robot = robotAt(one, t), mark = this.robots[i];
      const here = robot !== null && robot.level === this.level;
      mark.classList.toggle("gone", !here);
      if (!here) return;
      const [x, y] = this.pixel(robot.x, robot.y);
      mark.setAttribute("cx", x);
      mark.setAttribute("cy", y);
    });
    const lines = robots.flatMap((one) => wayOf(one, this.level, Math.max(t - TRACK_MS, since), t)).map((line) =>
      "M" + line.map(([x, y]) => this.pixel(x, y).map((n) => n.toFixed(1)).join(" ")).join("L"));
    this.track.setAttribute("d", lines.join(""));
  }

  /** Sensors without geometry are on no plan: they stand below it. */
  showUnplaced(t, chosen) {
    const found = doors.map((door) => [door, door.at(t)])
      .filter(([, now]) => now && !now.place && (now.level === this.level || !levelNames.has(now.level)));
    const key = found.map(([door, now]) => `${door.id}:${now.state}`).join() + chosen;
    if (key === this.unplacedThen) return;
    this.unplacedThen = key;
    this.unplaced.replaceChildren(...(found.length ? [el("span", { class: "aside" }, "Without a place: ")] : []),
      ...found.map(([door, now]) => el("button", {
        type: "button", class: door.id === chosen ? "chip chosen" : "chip", "data-id": door.id,
        "data-state": data.states[now.state], onclick: () => clock.choose(door.id === chosen ? null : door.id),
      }, dot(now.state), quoted(door.short))));
  }

  setUpPointer() {
    let from = null;
    const svg = this.svg;
    const local = (event) => {
      const box = svg.getBoundingClientRect();
      return [((event.clientX - box.left) * this.width) / box.width, ((event.clientY - box.top) * this.height) / box.height];
    };
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      this.zoomBy(Math.exp(-event.deltaY / 300), ...local(event));
    }, { passive: false });
    svg.addEventListener("dblclick", (event) => this.zoomBy(2, ...local(event)));
    svg.addEventListener("pointerdown", (event) => {
      if (this.zoom > 1 && event.button === 0) from = local(event);
    });
    addEventListener("pointermove", (event) => {
      if (!from) return;
      const to = local(event), scale = this.fit * this.zoom;
      this.middle[0] -= (to[0] - from[0]) / scale;
      this.middle[1] += (to[1] - from[1]) / scale;
      from = to;
      this.keepInside();
      this.layOut();
    });
    addEventListener("pointerup", () => (from = null));
    addEventListener("pointercancel", () => (from = null));
  }
}

const pictureOf = (kind, { src, width, height }) => drawn("image", { class: kind, href: src, width, height, preserveAspectRatio: "none" });

/** The points of a place: the ends of a door's line, or the corners of another object. */
const pointsOf = (place) => place.slice(2).flatMap((x, i, all) => (i % 2 ? [] : [[x, all[i + 1]]]));

/** The left and the right end of the middle of what lies between points. */
function boxAround(points) {
  const [across, down] = [0, 1].map((i) => points.map((point) => point[i]));
  const y = (Math.min(...down) + Math.max(...down)) / 2;
  return [[Math.min(...across), y], [Math.max(...across), y]];
}

/** What hovering over a door tells. */
function linesOf(door, t) {
  const now = door.at(t);
  const title = el("b", {}, quoted(door.name));
  if (!now) return [title, "not in the map at this moment"];
  const lines = [title, el("span", {}, dot(now.state), `${wordOf(door, now.state)} ${sinceText(now)}`),
    `last seen ${shortTime(now.seen)}, ${agoText(t - now.seen)}`];
  if (now.lapsed !== null) lines.push(lapsedText(door, now));
  if (now.given) lines.push(`set in the map: ${givenText(now.given)}`);
  const usual = usualAt(door, t);
  if (usual !== null) lines.push(`P(open) in a typical week at this hour: ${shortNumber(usual)}`);
  lines.push(`P(open) ${AT_THE_END}: ${door.p ? beliefText(door.p) : `unknown${door.why ? `, ${door.why}` : ""}`}`);
  return lines;
}

const agoText = (ms) => (ms < 1000 ? "just now" : `${ageText(ms)} ago`);

const sinceText = (now) => (now.since < 0 ? `since before ${shortTime(0)}` : `since ${shortTime(now.since)}`);

/** Why a state is not known any more. */
const lapsedText = (door, now) => `not seen since ${shortTime(now.lapsed)}: a sighting holds for ${ageText(door.holds)}`;

const beliefText = ([p, low, high]) => `${shortNumber(p)} (${interval(low, high)})`;

const givenText = ([, open, closed]) =>
  [["P(open)", open], ["P(closed)", closed]].filter(([, p]) => p !== null)
    .map(([what, p]) => `${what} ${p.toFixed(2)}`).join(", ") || "no probabilities";

const dot = (state) => el("i", { class: `dot ${CLASSES[state]}`, "aria-hidden": "true" });

const panels = data.levels.map((level) => new LevelPanel(level));
let front = panels[0];

function setUpPlan() {
  byId("levels").append(...panels.map((panel) => panel.element));
  byId("tabs").append(...panels.map((panel) => (panel.tab = el("button", {
    type: "button", role: "tab", "aria-controls": `level-${panel.level}`, onclick: () => bringToFront(panel),
    onkeydown: (event) => {
      const turn = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (turn) bringToFront(panels[(panels.indexOf(panel) + turn + panels.length) % panels.length], true);
    },
  }, quoted(levelNames.get(panel.level))))));
  byId("tabs").hidden = panels.length === 1;
  const withRooms = byId("with-rooms");
  withRooms.hidden = panels.every((panel) => !panel.plans.some((plan) => plan.rooms));
  withRooms.addEventListener("click", () => {
    const without = byId("levels").classList.toggle("without-rooms");
    withRooms.setAttribute("aria-pressed", String(!without));
  });
  byId("nearer").addEventListener("click", () => front.zoomBy(1.6));
  byId("farther").addEventListener("click", () => front.zoomBy(1 / 1.6));
  byId("whole").addEventListener("click", () => front.zoomBy(0));
  byId("legend").append(...["Open", "Closed", "Unknown"].map((word) =>
    el("li", {}, el("i", { class: `stroke ${word.toLowerCase()}`, "aria-hidden": "true" }), word)),
  ...(doors.some((door) => door.lapsedAt.length) ? [el("li", {}, el("i", { class: "stroke lapsed", "aria-hidden": "true" }), "Pale: not seen since")] : []),
  ...(runs.length ? [el("li", {}, el("i", { class: "dot robot", "aria-hidden": "true" }), "Robot, and its last 30 minutes")] : []));
  bringToFront(mostOfInterest());
  let width = 0;
  new ResizeObserver(() => {
    if (byId("levels").clientWidth === width) return;
    width = byId("levels").clientWidth;
    for (const panel of panels) panel.resize(width);
  }).observe(byId("levels"));
  clock.follow((t, chosen) => {
    for (const panel of panels) panel.show(t, chosen);
  });
}

/** The level where the robot is, if it has doors, or the one with most. */
function mostOfInterest() {
  const levels = robots.map((one) => robotAt(one, clock.t)?.level);
  const withRobot = panels.find((panel) => levels.includes(panel.level));
  const withMost = panels.reduce((best, panel) => (panel.marks.length > best.marks.length ? panel : best));
  return withRobot && (withRobot.marks.length || !withMost.marks.length) ? withRobot : withMost;
}

function bringToFront(panel, withFocus = false) {
  front = panel;
  for (const button of document.querySelectorAll(".zooms button")) button.disabled = panel.isEmpty;
  for (const other of panels) {
    other.element.classList.toggle("behind", other !== panel);
    other.tab.setAttribute("aria-selected", String(other === panel));
    other.tab.tabIndex = other === panel ? 0 : -1;
  }
  if (withFocus) panel.tab.focus();
}
