// Draws rooms as SVG, in metres; the group of a room is turned so that y points up.

import { openings, words } from "./store.js";

const SVG = "http://www.w3.org/2000/svg";
const MARGIN = 0.15;
const GRID = 0.1;
const NARROWEST = 3; // pixels between lines of the grid, else only each tenth is drawn
const LETTER = 0.56; // of its height, a letter's width
const SMALLEST = 0.7; // of the usual height, letters that are drawn
const RAMP = [[0, 34, 78], [53, 69, 108], [124, 123, 120], [187, 175, 113], [254, 232, 56]]; // cividis: for all eyes

export function make(tag, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) if (value != null) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

const ring = (points) => `M${points.map((point) => point.join(" ")).join("L")}Z`;

// An empty picture of a box [x0, y0, x1, y1], and the group to draw in.
function framed(svg, [x0, y0, x1, y1]) {
  svg.replaceChildren();
  const [width, height] = [x1 - x0 + 2 * MARGIN, y1 - y0 + 2 * MARGIN];
  svg.setAttribute("viewBox", `${x0 - MARGIN} ${-y1 - MARGIN} ${width} ${height}`);
  return svg.appendChild(make("g", { transform: "scale(1 -1)" }));
}

// Metres a pixel, of what was drawn last.
export function pixel(svg) {
  const { width, height } = svg.viewBox.baseVal;
  const box = svg.getBoundingClientRect();
  return Math.max(width / (box.width || 1), height / (box.height || 1));
}

function shell(group, room, swings = []) {
  group.append(make("path", { class: "floor", d: ring(room.outline) + (room.holes ?? []).map(ring).join("") }));
  group.append(make("path", { class: "wall", d: room.walls.map((wall) => ring(wall.polygon)).join("") }));
  for (const swing of swings) if (swing) group.append(make("path", { class: "swing", d: swing }));
}

const named = (name, size, room) => {
  const parts = words(name).split(" ");
  return room >= 2.1 * size * parts.length && parts.length > 1 ? parts : [words(name)];
};

function label(item, size) {
  const turned = Math.abs(item.rotation % 180) === 90;
  const [across, up] = turned ? [item.size[1], item.size[0]] : item.size;
  const lines = named(item.category, size, Math.min(across, up));
  const long = Math.max(...lines.map((line) => line.length)) * LETTER;
  const stands = long * size > across && up > across;
  const fit = Math.min(size, (0.94 * (stands ? up : across)) / long);
  if (fit < SMALLEST * size) return make("g"); // its name is in the list
  const text = make("text", {
    class: "label", "font-size": fit, transform: `rotate(${-item.rotation}) scale(1 -1)${stands ? " rotate(-90)" : ""}`,
  });
  lines.forEach((line, k) => {
    const span = make("tspan", { x: 0, y: fit * (0.35 + k - (lines.length - 1) / 2) });
    span.textContent = line;
    text.append(span);
  });
  return text;
}

function furniture(item, fronts) {
  const [depth, width] = item.size;
  const round = item.shape === "circle";
  const nodes = [
    round
      ? make("circle", { class: "body", r: depth / 2 })
      : make("rect", { class: "body", x: -depth / 2, y: -width / 2, width: depth, height: width, rx: 0.02 }),
  ];
  if (!round && fronts.has(item.category)) {
    const at = depth / 2 - Math.min(0.06, depth / 6);
    nodes.push(make("path", { class: "front", d: `M${at} ${-0.36 * width}V${0.36 * width}` }));
  }
  return nodes;
}

// A finger on what it `drags` does not scroll the page. The node is asked itself, as it may be drawn anew before the plan is.
function held(node, drags) {
  const keep = (event) => { if (event.touches.length === 1 && drags()) event.preventDefault(); };
  node.addEventListener("touchstart", keep, { passive: false });
  return node;
}

const placed = (item) => `translate(${item.center.join(" ")}) rotate(${item.rotation ?? 0})`;

// Under others: rugs and platforms, then what is tucked, and of the rest what is larger.
function order(room, raised) {
  const under = ({ item }) => (raised.has(item.category) ? 2e9 : item.tucked ? 1e9 : 0) + item.size[0] * item.size[1];
  const standing = room.furniture.map((item, index) => ({ item, index })).filter(({ item }) => item.center);
  return standing.sort((one, other) => under(other) - under(one));
}

// A small picture of a room.
export function thumbnail(room, box, { raised }, faulty = new Set()) {
  const svg = make("svg", { class: "thumbnail", "aria-hidden": "true" });
  const group = framed(svg, box);
  shell(group, room);
  for (const opening of openings(room)) group.append(make("path", { class: opening.kind, d: ring(opening.polygon) }));
  for (const { item, index } of order(room, raised)) {
    const looks = faulty.has(index) ? "item faulty" : "item";
    group.append(make("g", { class: looks, transform: placed(item) }, ...furniture(item, new Set())));
  }
  return svg;
}

function measure(group, [[x0, y0], [x1, y1], metres], size) {
  group.append(make("path", { class: "gap", d: `M${x0} ${y0}L${x1} ${y1}` }));
  const at = `translate(${(x0 + x1) / 2} ${(y0 + y1) / 2}) scale(1 -1)`;
  const text = make("text", { class: "metres", "font-size": size, transform: at, y: size * 0.35 });
  text.textContent = metres.toFixed(2);
  group.append(text);
}

const shade = (share) => {
  const at = Math.min(share * (RAMP.length - 1), RAMP.length - 1 - 1e-9);
  const [low, high] = [RAMP[Math.floor(at)], RAMP[Math.floor(at) + 1]];
  return `rgb(${low.map((value, k) => Math.round(value + (high[k] - value) * (at % 1))).join(" ")})`;
};

function heat(group, { centers, values }, step) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  centers.forEach(([x, y], k) => {
    const fill = shade((values[k] - low) / (high - low || 1));
    group.append(make("rect", { class: "value", x: x - step / 2, y: y - step / 2, width: step, height: step, fill }));
  });
}

function arrow(group, [x0, y0], [x1, y1], rank) {
  const long = Math.hypot(x1 - x0, y1 - y0);
  const turn = (Math.atan2(y1 - y0, x1 - x0) * 180) / Math.PI;
  const shape = long > 0.01 ? `M0 0H${long - 0.1}M${long - 0.12} 0.06L${long} 0L${long - 0.12} -0.06Z` : "M-.08 0H.08M0 -.08V.08";
  group.append(make("path", { class: `arrow rank${rank}`, d: shape, transform: `translate(${x0} ${y0}) rotate(${turn})` }));
}

// The room that the page holds, to be worked on.
export function draw(svg, state, { fronts, raised }, idle) {
  const { room, look, selected } = state;
  const group = framed(svg, look.box);
  const size = 12 * pixel(svg);
  const drags = (index) => state.mode === "edit" && idle() && !state.locked[index];
  svg.prepend(hatching(pixel(svg)));
  const chosen = selected?.kind === "item" ? selected.index : -1;
  const faults = new Map();
  for (const [k, , told] of look.faults) faults.set(k, [...(faults.get(k) ?? []), told]);
  if (state.refused && chosen >= 0) faults.set(chosen, [state.problem]);
  shell(group, room, look.swings);
  if (state.thoughts?.values) heat(group, state.thoughts.values, state.thoughts.step);
  openings(room).forEach((opening, index) => {
    const on = selected?.kind === "opening" && selected.index === index;
    group.append(make("path", {
      class: `${opening.kind}${on ? " selected" : ""}`, d: ring(opening.polygon), "data-opening": index,
      role: "button", tabindex: 0, "aria-pressed": on, "aria-label": opening.kind,
    }));
  });
  for (const { item, index } of order(room, raised)) {
    const told = faults.get(index);
    const looks = ["item", told && "faulty", state.locked[index] && "locked", index === chosen && "selected"];
    if (index === chosen && state.thoughts?.values) looks.push("valued");
    const about = [words(item.category), state.locked[index] && "locked", told?.join(", ")];
    const nodes = furniture(item, fronts);
    if (told) nodes.push(nodes[0].cloneNode());
    if (told) nodes.at(-1).setAttribute("class", "hatch");
    if (!item.tucked || index === chosen) nodes.push(label(item, size)); // else under a table
    if (state.locked[index]) nodes.push(padlock(item, size));
    group.append(held(make("g", {
      class: looks.filter(Boolean).join(" "), "data-item": index, role: "button", tabindex: 0, id: index === chosen ? "chosen" : null,
      "aria-pressed": index === chosen, "aria-label": about.filter(Boolean).join("; "), transform: placed(item),
    }, ...nodes), () => drags(index)));
  }
  // What is chosen lies on top, but stays where it is among the others: Tab goes from one to the next in this order.
  if (room.furniture[chosen]?.center) {
    const top = make("use", { href: "#chosen", "aria-hidden": true, tabindex: -1 });
    group.append(held(top, () => drags(chosen)));
  }
  if (state.mode === "edit" && chosen >= 0) for (const gap of look.gaps) measure(group, gap, 0.95 * size);
  const from = room.furniture[chosen]?.center;
  if (from) (state.thoughts?.moves ?? []).forEach(({ to }, rank) => arrow(group, from, to, rank));
  if (state.mode !== "edit") crosshair(group, state.cursor, 14 * pixel(svg));
}

function hatching(one) {
  const lines = make("path", { d: `M0 ${8 * one}L${8 * one} 0`, "stroke-width": 1.4 * one, class: "hatching" });
  const pattern = { id: "hatch", width: 8 * one, height: 8 * one, patternUnits: "userSpaceOnUse" };
  return make("defs", {}, make("pattern", pattern, lines));
}

function padlock(item, size) {
  const turn = `rotate(${-(item.rotation ?? 0)}) scale(1 -1) translate(0 ${0.95 * size})`;
  const text = make("g", { class: "padlock", transform: `${turn} scale(${size / 12})` });
  text.append(make("path", { d: "M-4 0H4V6H-4Z M-2.5 0V-2A2.5 2.5 0 0 1 2.5 -2V0" }));
  return text;
}

function crosshair(group, [x, y], arm) {
  group.append(make("path", { class: "cursor", d: `M${x - arm} ${y}H${x + arm}M${x} ${y - arm}V${y + arm}` }));
}

// An outline as it is drawn, on a grid of 10 cm.
export function drawDraft(svg, state, [width, height]) {
  const group = framed(svg, [0, 0, width, height]);
  const lines = [];
  const step = GRID < NARROWEST * pixel(svg) ? 10 : 1;
  for (let k = 0; k <= Math.round(width / GRID); k += step) lines.push([k, `M${k * GRID} 0V${height}`]);
  for (let k = 0; k <= Math.round(height / GRID); k += step) lines.push([k, `M0 ${k * GRID}H${width}`]);
  const path = (whole) => lines.filter(([k]) => (k % 10 === 0) === whole).map(([, d]) => d).join("");
  group.append(make("path", { class: "grid", d: path(false) }), make("path", { class: "grid metre", d: path(true) }));
  const { draft, cursor } = state;
  if (draft.length) {
    const d = `M${[...draft, cursor].map((point) => point.join(" ")).join("L")}`;
    group.append(make("path", { class: "draft", d }));
    const size = 12 * pixel(svg);
    const [last] = draft.slice(-1);
    if (last.join() !== cursor.join()) measure(group, [last, cursor, Math.hypot(cursor[0] - last[0], cursor[1] - last[1])], size);
  }
  for (const [x, y] of draft) group.append(make("circle", { class: "corner", cx: x, cy: y, r: 4 * pixel(svg) }));
  crosshair(group, cursor, 14 * pixel(svg));
}

export const snapped = ([x, y]) => [x, y].map((value) => Math.round(value / GRID) / Math.round(1 / GRID));

// Where a pointer is, in metres.
export function metres(svg, event) {
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  return [point.x, -point.y];
}
