// Puts the page together, and makes it fit for paper when it is printed.

function start() {
  setUpHead();
  if (data.isEmpty) {
    for (const part of document.querySelectorAll("main > :not(:last-child), #transport")) part.hidden = true;
    setUpHealth();
    return;
  }
  setUpTransport();
  setUpPlan();
  setUpBeside();
  setUpLanes();
  setUpTable();
  setUpWeeks();
  setUpChanges();
  setUpHealth();
  let chosenThen = null;
  clock.follow((t, chosen) => {
    if (chosen === chosenThen) return;
    chosenThen = chosen;
    if (chosen !== null) showWhereItIs(doorOf.get(chosen), t);
  });
  if (location.hash) clock.recall();
  else clock.tell();
  addEventListener("beforeprint", () => {
    redrawLanes(true);
    repeatAxis();
  });
  addEventListener("afterprint", () => {
    lanes.forEach((lane) => lane.see(lane.isSeen));
    for (const axis of document.querySelectorAll(".axis.again")) axis.remove();
  });
}

/** Bring the level of a door to the front, and its lane and row into their boxes. */
function showWhereItIs(door, t) {
  const now = door.at(t);
  const panel = panels.find((other) => other.level === (now ? now.level : levelOf(door)));
  if (panel && panel !== front) bringToFront(panel);
  if (panel && panel.width && now && now.place && !isOnScreen(panel, now.place)) panel.centre(now.place);
  for (const [box, row] of [[byId("lanes"), `.lane[data-id="${door.id}"]`], [byId("table").parentElement, `tr[data-id="${door.id}"]`]]) {
    const found = box.querySelector(row);
    if (!found || found.hidden) continue;
    const top = found.getBoundingClientRect().top - box.getBoundingClientRect().top;
    if (top < 40 || top > box.clientHeight - 30) box.scrollTop += top - box.clientHeight / 2; // the page itself stays
  }
}

function isOnScreen(panel, [, , x, y]) {
  const [right, down] = panel.pixel(x, y);
  return right > 0 && down > 0 && right < panel.width && down < panel.height;
}

start();
