// Where names go on the plan, so that none covers a door or another name.

const LABEL_FONT = "500 11px system-ui, sans-serif";
const LABEL_HEIGHT = 13, LONGEST_LABEL = 28, NEAR = [4, 12];
const pen = document.createElement("canvas").getContext("2d");

function labelWidth(text) {
  pen.font = LABEL_FONT;
  return pen.measureText(text).width + 4;
}

const CLEARLY_NEARER = 3;

/**
 * Give each mark {text, id, a, b} (ends of its line, pixels) a place {text, x, y}, or null.
 * The first marks get the best places; where there is no room for a name its id may fit. A label
 * that could be taken for another door's is left out, unless it is the chosen one's.
 */
function placeLabels(marks, width, height) {
  const taken = marks.flatMap(({ a, b }) => boxesAlong(a, b));
  const others = (mark) => (mark.isChosen ? [] : marks.filter((other) => other !== mark));
  return marks.map((mark) => {
    for (const text of [shortened(mark.text, LONGEST_LABEL), String(mark.id)]) {
      const box = freeBox(mark, labelWidth(text), taken, others(mark), width, height);
      if (box) {
        taken.push(box);
        return { text, x: (box.left + box.right) / 2, y: box.bottom - 3 };
      }
    }
    return null;
  });
}

/** Boxes that cover a line, without the wide empty one around a slanting door. */
function boxesAlong(a, b) {
  const steps = Math.max(1, Math.ceil(Math.hypot(b[0] - a[0], b[1] - a[1]) / 6));
  return Array.from({ length: steps + 1 }, (_, i) => {
    const x = a[0] + ((b[0] - a[0]) * i) / steps, y = a[1] + ((b[1] - a[1]) * i) / steps;
    return { left: x - 4, right: x + 4, top: y - 4, bottom: y + 4 };
  });
}

function freeBox(mark, wide, taken, others, width, height) {
  const { a, b } = mark;
  const x = (a[0] + b[0]) / 2, y = (a[1] + b[1]) / 2;
  const across = Math.atan2(b[0] - a[0], a[1] - b[1]);
  for (const distance of NEAR) {
    for (const turn of [0, Math.PI, 0.6, -0.6, Math.PI - 0.6, Math.PI + 0.6, 1.57, -1.57]) {
      const box = boxBeside(x, y, wide, distance, across + turn, Math.hypot(b[0] - a[0], b[1] - a[1]));
      const inside = box.left >= 0 && box.top >= 0 && box.right <= width && box.bottom <= height;
      if (inside && !taken.some((other) => overlap(box, other)) && isNearest(mark, box, others)) return box;
    }
  }
  return null;
}

/** Tell whether a box is clearly nearer to its door than to any other. */
function isNearest(mark, box, others) {
  const most = gapTo(box, mark) + CLEARLY_NEARER;
  return others.every((other) => gapTo(box, other) >= most);
}

/** How far a box is from a door's line: from its ends and its middle. */
function gapTo(box, { a, b }) {
  const points = [a, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], b];
  return Math.min(...points.map(([x, y]) => Math.hypot(
    Math.max(box.left - x, 0, x - box.right), Math.max(box.top - y, 0, y - box.bottom))));
}

function boxBeside(x, y, wide, distance, angle, length) {
  const cos = Math.cos(angle), sin = Math.sin(angle);
  const reach = Math.min(
    Math.abs(cos) > 1e-9 ? wide / 2 / Math.abs(cos) : Infinity,
    Math.abs(sin) > 1e-9 ? LABEL_HEIGHT / 2 / Math.abs(sin) : Infinity,
  );
  const along = Math.min(length / 2, 4);
  const centreX = x + (distance + along + reach) * cos, centreY = y + (distance + along + reach) * sin;
  return {
    left: centreX - wide / 2, right: centreX + wide / 2,
    top: centreY - LABEL_HEIGHT / 2, bottom: centreY + LABEL_HEIGHT / 2,
  };
}

const overlap = (one, other) =>
  one.left < other.right && other.left < one.right &&
  one.top < other.bottom && other.top < one.bottom;
