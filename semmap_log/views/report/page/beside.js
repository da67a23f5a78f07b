// Beside the plan: how many doors are in which state, the door that is chosen, what happened last.

const RECENT = 6, LONGEST_RECENT = 13;

function setUpBeside() {
  const bar = el("div", { class: "shares", "aria-hidden": "true" });
  const counts = el("dl", { class: "counts" });
  const whereabouts = el("p", { class: "aside" });
  const chosenPart = el("div", { class: "details" });
  const recent = el("ol", { class: "recent" });
  byId("beside").append(el("h2", {}, "At this moment"), bar, counts, whereabouts, chosenPart,
    el("h3", {}, "Just before"), recent);
  let chosenThen = "", recentThen = "";
  clock.follow((t, chosen) => {
    showCounts(bar, counts, t);
    say(whereabouts, whereaboutsText(t));
    const details = detailsOf(t, chosen);
    const key = `${chosen} ${details.map((part) => part.textContent).join()}`;
    if (key !== chosenThen) chosenPart.replaceChildren(...details);
    chosenThen = key;
    const latest = recentChanges(t);
    const latestKey = latest.map(([door, when]) => `${door.id}:${when}`).join() + chosen;
    if (latestKey !== recentThen) recent.replaceChildren(...latest.map(recentLine));
    recentThen = latestKey;
  });
}

function showCounts(bar, counts, t) {
  const many = [0, 0, 0, 0, 0];
  let lapsed = 0;
  for (const door of doors) {
    const now = door.at(t);
    if (now) many[now.state] += 1;
    if (now && now.lapsed !== null) lapsed += 1;
  }
  const shown = [1, 2, 0, 3, 4].filter((state) => many[state] || state < 3);
  bar.replaceChildren(...[1, 2, 0].map((state) => {
    const share = el("i", { class: CLASSES[state] });
    share.style.flexGrow = String(state ? many[state] : many[0] + many[3] + many[4]);
    return share;
  }));
  counts.replaceChildren(...shown.map((state) =>
    el("div", {}, el("dt", {}, dot(state), STATE_WORDS[state]), el("dd", {}, grouped(many[state])))));
  if (lapsed) counts.append(el("div", { class: "aside" }, el("dt", {}, "of these not seen since"), el("dd", {}, grouped(lapsed))));
}

function whereaboutsText(t) {
  const said = [];
  const round = roundAt(t);
  if (round) said.push(`Under way: ${roundText(round)}.`);
  for (const one of robots) {
    const robot = robotAt(one, t), called = robots.length > 1 ? one.name : "Robot";
    if (robot) {
      const level = panels.length > 1 ? `${levelNames.get(robot.level) || "level not told"}, ` : "";
      const old = t - robot.told > 10 * MINUTE ? `, standing since ${shortTime(robot.told)}` : "";
      said.push(`${called}: ${level}${metres(robot.x)},\u00a0${metres(robot.y)}\u00a0m${old}.`);
    } else if (one.runs.length) {
      said.push(`Nobody knows where ${robots.length > 1 ? called : "the robot"} is.`);
    }
  }
  return said.join(" ");
}

const metres = (length) => length.toFixed(1).replace("-", "−");

/** A round in words; its name may come from anybody. */
const roundText = ([, , name, actor]) => (actor ? `${name} (${actor})` : name);

function detailsOf(t, chosen) {
  if (chosen === null) {
    return doors.length ? [el("p", { class: "aside on-screen" }, "Choose a door on the plan, in the lanes or in the table.")] : [];
  }
  const door = doorOf.get(chosen);
  const close = el("button", { type: "button", class: "close", "aria-label": "Choose no door", onclick: () => clock.choose(null) }, "×");
  const title = el("h3", { title: door.name }, quoted(door.short), close);
  const place = [`#${door.id}`, levelNames.get((door.at(t) || { level: door.places.length ? door.places[0][1] : 0 }).level)];
  const said = door.said.map(([key, value]) => el("div", {}, quoted(key), ": ", quoted(value)));
  return [title, el("div", { class: "aside" }, place.filter(Boolean).join(", ")),
    ...linesOf(door, t).slice(1).map((line) => el("div", {}, line)), ...said];
}

/** The last changes of state up to a moment: [door, when, state], the latest first. */
function recentChanges(t) {
  const found = [];
  for (const door of doors) {
    const last = Math.min(lastUpTo(door.changedAt, t), door.changedAt.length - 1);
    for (let i = last; i > Math.max(last - RECENT, -1); i--) {
      if (door.changedAt[i] >= 0 && door.isThere(t)) found.push([door, door.changedAt[i], door.changedTo[i]]);
    }
  }
  return found.sort((one, other) => other[1] - one[1]).slice(0, RECENT);
}

function recentLine([door, when, state]) {
  return el("li", { class: door.id === clock.chosen ? "chosen" : null },
    el("button", { type: "button", class: "when", title: `${dateText(when)}: go there`, onclick: () => clock.set(when) },
      dayText(when) === dayText(clock.t) ? clockText(when) : shortTime(when)),
    el("button", { type: "button", class: "who", title: door.name, onclick: () => clock.choose(door.id) }, dot(state), quoted(shortened(door.short, LONGEST_RECENT))),
    el("span", { class: `state ${CLASSES[state]}` }, wordOf(door, state).toLowerCase()));
}
