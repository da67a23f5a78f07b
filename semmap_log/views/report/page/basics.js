// Small tools: elements, searching, numbers. Text only ever becomes a text node.

const byId = (id) => document.getElementById(id);

function fill(made, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) {
      made.setAttribute(name, value === true ? "" : value);
    }
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return made;
}

const el = (tag, attributes, ...children) =>
  fill(document.createElement(tag), attributes, children);

const drawn = (tag, attributes, ...children) =>
  fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);

/** Text from the log, kept apart from what stands around it, whichever way it is written. */
const quoted = (text) => el("bdi", {}, text);

function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** A long name without its middle: names of doors differ at their ends. */
function shortened(text, most) {
  const letters = [...text], head = Math.floor((most - 1) * 0.4);
  if (letters.length <= most) return text;
  return `${letters.slice(0, head).join("")}…${letters.slice(head + 1 - most).join("")}`;
}

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/** The place of the last of some ascending numbers that is not above `limit`; -1: none is. */
function lastUpTo(numbers, limit, length = numbers.length) {
  let low = 0, high = length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (numbers[middle] <= limit) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

const count = (number, what) => `${grouped(number)} ${what}${number === 1 ? "" : "s"}`;

const grouped = (number) => String(number).replace(/\B(?=(\d{3})+$)/g, ",");

const megabytes = (bytes) =>
  bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;

/** `.83`, `<.01`, `>.99`: as the terminal writes probabilities. */
function shortNumber(p) {
  if (p < 0.005) return "<.01";
  if (p >= 0.995) return ">.99";
  return p.toFixed(2).slice(1);
}

function interval(low, high) {
  const end = (p) => ({ "<.01": "0", ">.99": "1" })[shortNumber(p)] || shortNumber(p);
  return `${end(low)}–${end(high)}`;
}

const hint = byId("hint");

/** Show lines of text beside the pointer, or beside an element that has the focus. */
function showHint(lines, x, y) {
  hint.replaceChildren(...lines.map((line) => el("div", {}, line)));
  hint.hidden = false;
  const room = document.documentElement.clientWidth - hint.offsetWidth - 8;
  const below = y + 16 + hint.offsetHeight < window.innerHeight;
  hint.style.left = `${clamp(x + 14, 8, Math.max(room, 8))}px`;
  hint.style.top = `${below ? y + 16 : Math.max(y - hint.offsetHeight - 10, 8)}px`;
}

function hideHint() {
  hint.hidden = true;
}
