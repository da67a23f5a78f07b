// The table of doors: at the moment that is shown, sorted and filtered as asked.

const NOT_THERE = { state: -1, seen: -Infinity };
const COLUMNS = [
  { key: "id", title: "Id", of: (row) => row.door.id, isNumber: true },
  { key: "name", title: "Name", of: (row) => row.door.name },
  { key: "level", title: "Level", of: (row) => levelNames.get(row.now.level ?? levelOf(row.door)) || "" },
  { key: "state", title: "State", of: (row) => row.now.state },
  { key: "seen", title: "Last seen", of: (row) => -row.now.seen, isNumber: true },
  { key: "p", title: "P(open)", more: ` ${AT_THE_END}`, of: (row) => (row.door.p ? -row.door.p[0] : 2), isNumber: true },
  { key: "changes", title: "Changes", of: (row) => -row.door.changes, isNumber: true },
];
const collator = new Intl.Collator(undefined, { numeric: true });

const table = { sort: "id", descends: false, rows: [] };

function setUpTable() {
  const head = el("tr", {}, COLUMNS.map((column) => (column.head = el("th", { scope: "col", class: `of-${column.key}`, "aria-sort": "none" },
    el("button", { type: "button", onclick: () => sortBy(column.key) }, column.title,
      column.more ? el("span", { class: "more" }, column.more) : null),
    // A head with buttons in it is not repeated on the next sheet of paper.
    el("span", { class: "on-paper", "aria-hidden": "true" }, column.title, column.more || "")))));
  table.rows = doors.map(rowOf);
  table.body = el("tbody", {}, table.rows.map((row) => row.element));
  byId("table").append(el("caption", { class: "unseen-text" }, "Doors at the moment that is shown"), el("thead", {}, head), table.body);
  byId("filter-state").append(...[["", "All states"], ["1", "Open"], ["2", "Closed"], ["0", "Unknown"], ["3", "Moving"], ["4", "Offline"], ["-1", "Not in the map"]]
    .map(([value, text]) => el("option", { value }, text)));
  byId("filter").addEventListener("input", () => showTable(clock.t, clock.chosen));
  byId("filter-state").addEventListener("change", () => showTable(clock.t, clock.chosen));
  markSorted();
  clock.follow(showTable);
}

function rowOf(door) {
  const cells = Object.fromEntries(COLUMNS.map(({ key, isNumber }) => [key, el("td", { class: `of-${key}${isNumber ? " number" : ""}` })]));
  cells.id.append(String(door.id));
  cells.name.append(el("button", { type: "button", onclick: () => clock.choose(clock.chosen === door.id ? null : door.id) }, quoted(door.name)));
  if (door.p) cells.p.append(el("b", {}, shortNumber(door.p[0])), el("span", { class: "wide" }, ` ${interval(door.p[1], door.p[2])}`));
  else cells.p.append(el("span", { class: "aside", title: door.why || "not in the map then" }, "unknown"));
  cells.changes.append(grouped(door.changes));
  const row = { door, cells, now: null, element: el("tr", { "data-id": door.id }, Object.values(cells)) };
  row.search = `${door.id} ${door.name} ${levelNames.get(levelOf(door)) || ""}`.toLowerCase();
  return row;
}

function showTable(t, chosen) {
  const wanted = byId("filter").value.trim().toLowerCase(), state = byId("filter-state").value;
  let shown = 0;
  for (const row of table.rows) {
    const now = row.door.at(t) || NOT_THERE;
    if (!row.now || ["state", "level", "lapsed"].some((key) => now[key] !== row.now[key])) showState(row, now);
    row.now = now;
    say(row.cells.seen, now === NOT_THERE ? "–" : agoText(t - now.seen));
    const isShown = row.search.includes(wanted) && (state === "" || String(now.state) === state);
    row.element.hidden = !isShown;
    row.element.classList.toggle("chosen", row.door.id === chosen);
    shown += isShown;
  }
  say(byId("shown"), shown === doors.length ? count(shown, "door") : `${shown} of ${count(doors.length, "door")}`);
  if (["state", "seen", "level"].includes(table.sort)) sortRows();
}

function showState(row, now) {
  row.element.dataset.state = now === NOT_THERE ? "" : data.states[now.state];
  say(row.cells.level, levelNames.get(now.level ?? levelOf(row.door)) || "");
  row.cells.state.replaceChildren(...(now === NOT_THERE ? [el("span", { class: "aside" }, "not in the map")]
    : [dot(now.state), wordOf(row.door, now.state),
      now.lapsed === null ? "" : el("span", { class: "aside", title: lapsedText(row.door, now) }, ", not seen since")]));
}

function sortBy(key) {
  table.descends = table.sort === key && !table.descends;
  table.sort = key;
  markSorted();
  sortRows();
}

function sortRows() {
  const { of } = COLUMNS.find((column) => column.key === table.sort);
  const keys = new Map(table.rows.map((row) => [row, of(row)]));
  const compare = (a, b) => (typeof keys.get(a) === "string" ? collator.compare(keys.get(a), keys.get(b)) : keys.get(a) - keys.get(b));
  const sorted = [...table.rows].sort((a, b) => (compare(a, b) || 0) * (table.descends ? -1 : 1) || a.door.id - b.door.id);
  if (sorted.every((row, i) => table.body.children[i] === row.element)) return;
  table.body.append(...sorted.map((row) => row.element));
}

function markSorted() {
  for (const { key, head } of COLUMNS) {
    head.setAttribute("aria-sort", key !== table.sort ? "none" : table.descends ? "descending" : "ascending");
  }
}
