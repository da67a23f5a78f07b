// The moment that is shown, and the door that is chosen: slider, keys, playing, the link.

const clock = {
  t: LAST_CHANGE,
  chosen: null,
  listeners: [],

  /** Call back with the moment, now and whenever it, or the chosen door, is another. */
  follow(listener) {
    this.listeners.push(listener);
  },

  set(t) {
    const moment = clamp(Math.round(t), 0, END);
    if (moment !== this.t) this.change({ t: moment });
  },

  choose(id) {
    this.change({ chosen: id !== null && doorOf.has(id) ? id : null });
  },

  change(what) {
    Object.assign(this, what);
    this.tell();
    this.remember();
  },

  tell() {
    for (const listener of this.listeners) listener(this.t, this.chosen);
  },

  /** Go to the change before or after; of the chosen door, if asked for. */
  step(direction, onlyChosen = false) {
    const door = onlyChosen && this.chosen !== null ? doorOf.get(this.chosen) : null;
    const moments = door ? Float64Array.from(momentsOf(door)).sort() : momentsOfChange;
    const next = direction > 0
      ? moments[lastUpTo(moments, this.t) + 1]
      : moments[lastUpTo(moments, this.t - 1)];
    this.set(next === undefined ? (direction > 0 ? END : 0) : next);
  },

  /** The link's last part: later changes of it wait, or browsers complain. */
  remember() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      const door = this.chosen === null ? "" : `&door=${this.chosen}`;
      this.link = `#t=${isoText(this.t)}${door}`;
      try {
        history.replaceState(null, "", this.link);
      } catch {
        // Shown inside another page, which has the link.
      }
    }, 150);
  },

  recall() {
    const said = new URLSearchParams(location.hash.slice(1).replaceAll("+", "%2B"));
    const at = Date.parse(said.get("t") || "");
    const door = Number(said.get("door"));
    const t = Number.isNaN(at) ? this.t : clamp(at - data.begin, 0, END);
    this.change({ t, chosen: doorOf.has(door) ? door : null });
  },
};

/* Playing. */

const SPEEDS = [
  ["1 s/s", 1000], ["1 min/s", MINUTE], ["10 min/s", 10 * MINUTE], ["1 h/s", HOUR],
  ["6 h/s", 6 * HOUR], ["1 day/s", DAY], ["1 week/s", 7 * DAY],
];
const SECONDS_OF_ALL = 45;

const player = {
  isOn: false,

  toggle() {
    this.isOn = !this.isOn && END > 0;
    if (this.isOn && clock.t >= LAST_CHANGE) clock.set(0);
    byId("play").setAttribute("aria-pressed", String(this.isOn));
    byId("play").setAttribute("aria-label", this.isOn ? "Pause" : "Play");
    this.last = performance.now();
    this.exact = clock.t;
    if (this.isOn) requestAnimationFrame((now) => this.frame(now));
  },

  frame(now) {
    if (!this.isOn) return;
    if (Math.abs(this.exact - clock.t) > 1) this.exact = clock.t; // somebody moved the slider
    const passed = Math.min(now - this.last, 200) / 1000;
    this.last = now;
    this.exact = Math.min(this.exact + passed * Number(byId("speed").value), END);
    clock.set(this.exact);
    if (this.exact >= END) this.toggle();
    else requestAnimationFrame((next) => this.frame(next));
  },
};

/* The bar on top. */

function setUpTransport() {
  const slider = byId("slider");
  slider.max = String(END);
  slider.disabled = END === 0;
  slider.addEventListener("input", () => clock.set(Number(slider.value)));
  byId("back").addEventListener("click", (event) => clock.step(-1, event.shiftKey));
  byId("forth").addEventListener("click", (event) => clock.step(1, event.shiftKey));
  byId("play").addEventListener("click", () => player.toggle());
  const wanted = END / SECONDS_OF_ALL;
  const speed = SPEEDS.findIndex(([, ms]) => ms >= wanted);
  byId("speed").append(...SPEEDS.map(([text, ms], i) =>
    el("option", { value: ms, selected: i === (speed < 0 ? SPEEDS.length - 1 : speed) }, text)));
  say(byId("first"), `${dateText(0)} ${clockText(0, false)}`);
  say(byId("last"), `${dateText(END)} ${clockText(END, false)}`);
  clock.follow((t) => {
    slider.value = String(t);
    slider.setAttribute("aria-valuetext", `${dateText(t)} ${clockText(t)}`);
    byId("clock").replaceChildren(el("b", {}, timeOfDay(wall(t), true)), ` ${dateText(t)}`);
    say(byId("zone"), `${data.log.tz} ${offsetText(t)}`);
  });
  document.addEventListener("keydown", onKey);
  addEventListener("hashchange", () => location.hash !== clock.link && clock.recall());
  new ResizeObserver(drawActivity).observe(byId("activity"));
}

function onKey(event) {
  const target = event.target;
  const writes = target.matches("input:not([type=range]), select, textarea, [role=tab]");
  if (writes || event.ctrlKey || event.metaKey || event.altKey) return;
  const act = {
    ArrowLeft: () => clock.step(-1, event.shiftKey),
    ArrowRight: () => clock.step(1, event.shiftKey),
    PageUp: target.type === "range" && (() => clock.set(clock.t - HOUR)),
    PageDown: target.type === "range" && (() => clock.set(clock.t + HOUR)),
    Home: target.type === "range" && (() => clock.set(0)),
    End: target.type === "range" && (() => clock.set(END)),
    " ": !target.matches("button, [role=button]") && (() => player.toggle()),
    Escape: () => clock.choose(null),
  }[event.key];
  if (!act) return;
  event.preventDefault();
  act();
}

/** How much changes when, above the slider. */
function drawActivity() {
  const canvas = byId("activity");
  const width = Math.max(Math.floor(canvas.clientWidth / 3), 1);
  const counts = new Float64Array(width);
  for (const t of momentsOfChange) {
    counts[Math.min(Math.floor((t / Math.max(END, 1)) * width), width - 1)] += 1;
  }
  // The first adds all doors at once: what comes after it shall be seen.
  const most = Math.max(...Array.from(counts).sort((a, b) => a - b).slice(0, -1), 1);
  const scale = devicePixelRatio || 1;
  canvas.width = width * 3 * scale;
  canvas.height = canvas.clientHeight * scale;
  const pen = canvas.getContext("2d");
  pen.fillStyle = getComputedStyle(canvas).getPropertyValue("--muted");
  counts.forEach((many, i) => {
    const height = many ? Math.max(Math.sqrt(Math.min(many / most, 1)) * canvas.height, scale) : 0;
    pen.fillRect(i * 3 * scale, canvas.height - height, 2 * scale, height);
  });
}
