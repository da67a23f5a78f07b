// What is told in words: the head, the last changes, how the log is.

function setUpHead() {
  const { log, health } = data;
  say(byId("name"), log.building || log.name);
  const days = END / DAY;
  const length = days >= 2 ? `${days.toFixed(1)} days` : `${(END / HOUR).toFixed(1)} h`;
  const facts = [
    ["Log", quoted(log.name)],
    ["Robot", log.robot ? quoted(log.robot) : null],
    ["From", data.isEmpty ? null : `${dateText(0)} ${clockText(0, false)}`],
    ["To", data.isEmpty ? null : `${dateText(END)} ${clockText(END, false)} (${length})`],
    ["Zone", log.tz],
    ["Doors", grouped(doors.length)],
    ["Events shown", grouped(data.events)],
    ["A sighting holds", data.log.holds],
    ["Rounds", data.rounds.length ? grouped(data.rounds.length) : null],
    ["Health", health.warnings.length + health.suspects ? count(health.warnings.length + health.suspects, "warning") : "no warnings"],
  ];
  byId("facts").append(...facts.filter(([, value]) => value !== null)
    .map(([key, value]) => el("div", {}, el("dt", {}, key), el("dd", {}, value))));
  byId("empty").hidden = !data.isEmpty;
  if (data.howToBegin) say(byId("empty"), data.howToBegin);
  byId("foot").append(`Doors at each moment are those of semmap-log replay --at. ${notes().join(" ")}`);
}

/** What the page leaves out. */
function notes() {
  const said = [];
  if (runs.length) said.push(`The robot's track is simplified: it lies within ${data.trackWithin} m of the poses.`);
  if (data.seenWithin) said.push(`Of very many sightings some that repeat a state are left out: “last seen” may lag by ${ageText(data.seenWithin)}, states never.`);
  said.push("Retracted events are left out.");
  return said;
}

const ON_PAPER = 30; // as print.css has it

function setUpChanges() {
  say(byId("changes-note"), data.changes.length ? `the last ${data.changes.length}, the latest first; poses and sightings that changed nothing are left out` : "none");
  if (!data.changes.length) return;
  if (data.changes.length > ON_PAPER) byId("changes-note").append(el("span", { class: "on-paper" }, `; on paper the last ${ON_PAPER}`));
  const head = ["When", "Door", "What", "Who", "Why"].map((title) => el("th", { scope: "col" }, title));
  byId("changes").append(el("caption", { class: "unseen-text" }, "The last changes"), el("thead", {}, el("tr", {}, head)),
    el("tbody", {}, data.changes.map(changeRow)));
  clock.follow((t, chosen) => {
    for (const row of byId("changes").tBodies[0].rows) {
      row.classList.toggle("chosen", chosen !== null && Number(row.dataset.id) === chosen);
      row.classList.toggle("later", Number(row.dataset.t) > t);
    }
  });
}

function changeRow(change) {
  const door = change.door === null ? null : doorOf.get(change.door);
  const late = change.recorded === null ? null : el("div", { class: "aside" }, `recorded ${shortTime(change.recorded)}`);
  return el("tr", { "data-id": change.door, "data-t": change.t },
    el("td", { class: "number" }, el("button", { type: "button", title: `Event ${change.event}: go there`, onclick: () => clock.set(change.t) }, shortTime(change.t)), late),
    el("td", {}, door ? el("button", { type: "button", onclick: () => clock.choose(door.id) }, quoted(door.name)) : ""),
    el("td", {}, change.state === null ? null : dot(change.state), quoted(change.what)),
    el("td", {}, quoted([change.actor, change.source].filter(Boolean).join(" via "))),
    el("td", {}, quoted(change.reason)));
}

function setUpHealth() {
  const { health } = data;
  const place = byId("health");
  const worries = [...health.warnings, ...health.lastSuspects.map((text) => `Clock: ${text}`)];
  const more = health.suspects - health.lastSuspects.length;
  place.append(worries.length
    ? el("ul", { class: "worries" }, worries.map((text) => el("li", {}, quoted(text))), more > 0 ? el("li", {}, `and ${more} more suspect clocks before these`) : null)
    : el("p", { class: "fine" }, "No warnings, and no suspect clocks."));
  const promised = Object.entries(health.durability).map(([name, many]) => `${name} (${count(many, "commit")})`).join(", ");
  const facts = [
    ["Happened", health.happened ? health.happened.join(" to ") : "–"],
    ["Recorded", health.recorded ? health.recorded.join(" to ") : "–"],
    ["Events", `${grouped(health.events)} in ${count(health.commits, "commit")}`],
    ["Durability promised", promised || "–"],
    ["Size", `${megabytes(health.bytes)} in ${count(health.segments, "segment")}`],
    ["Log id", el("code", {}, health.logId)],
    ["Head", el("code", {}, health.head)],
  ];
  place.append(el("dl", { class: "pairs" }, facts.map(([key, value]) => el("div", {}, el("dt", {}, key), el("dd", {}, value)))),
    el("p", { class: "aside" }, "Keep the head elsewhere: semmap-log verify LOG --head HASH then shows whether a log was cut or rewritten since."),
    el("div", { class: "two" },
      small("Events by kind", ["Kind", "Events"], Object.entries(health.kinds).map(([kind, many]) => [kind, grouped(many)])),
      small("Segments", ["File", "Size", "First event", "Closed"], health.files.map(([name, bytes, closed, first]) =>
        [quoted(name), megabytes(bytes), grouped(first), closed ? "yes" : "no"]))));
}

function small(caption, titles, rows) {
  return el("table", { class: "small" }, el("caption", {}, caption),
    el("thead", {}, el("tr", {}, titles.map((title, i) => el("th", { scope: "col", class: i ? "number" : null }, title)))),
    el("tbody", {}, rows.map((row) => el("tr", {}, row.map((value, i) => el("td", { class: i ? "number" : null }, value))))));
}
