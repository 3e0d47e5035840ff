// Furniture by hand: dragged, turned, locked, added, deleted; and how it was before.

import { $, answered, changed, known, look, plan, render, select } from "./page.js";
import { metres } from "./plan.js";
import { commit, item, outdated, state, travel, words } from "./store.js";

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const idle = () => document.body.dataset.state === "idle";
const centimetres = (value) => Math.round(value * 100) / 100;
let drag = null;

plan.addEventListener("pointerdown", (event) => {
  if (state.mode !== "edit" || !idle() || event.button !== 0) return;
  const thing = event.target.closest("[data-item], [data-opening]");
  if (!thing) return select(null);
  if (thing.dataset.opening) return select("opening", Number(thing.dataset.opening));
  const index = Number(thing.dataset.item);
  select("item", index);
  document.querySelector(`[data-item="${index}"]`)?.focus({ preventScroll: true });
  event.preventDefault();
  if (state.locked[index]) return;
  plan.setPointerCapture(event.pointerId);
  drag = { index, from: metres(plan, event), center: state.room.furniture[index].center, moved: false };
});

plan.addEventListener("pointermove", (event) => {
  if (!drag) return;
  const [x, y] = metres(plan, event);
  const center = [drag.center[0] + x - drag.from[0], drag.center[1] + y - drag.from[1]].map(centimetres);
  if (!drag.moved && Math.hypot(x - drag.from[0], y - drag.from[1]) < 0.02) return;
  drag.moved = true;
  state.notice = "";
  state.room.furniture[drag.index].center = center;
  state.look.gaps = [];
  render();
  look();
});

async function dropped() {
  if (!drag) return;
  const { index, center, moved } = drag;
  drag = null;
  if (!moved) return;
  await settled(state.room.furniture[index], { center });
}

plan.addEventListener("pointerup", dropped);
plan.addEventListener("pointercancel", dropped);

// How items were before changes that the server has not judged yet.
const unjudged = new Map();

// Keep a change of an item if the server takes it, else put it back as it was. Quick changes wait for one look: what an
// item was before the first of them is what the server last took.
async function settled(changing, before) {
  unjudged.set(changing, { ...before, ...unjudged.get(changing) });
  await look();
  const { problem } = state;
  if (problem) unjudged.forEach((was, entry) => Object.assign(entry, was));
  unjudged.clear();
  if (problem) {
    state.notice = problem;
    await look();
  } else {
    commit();
    render();
  }
  document.dispatchEvent(new Event("choose"));
}

// Whether the chosen item is locked, which is said then.
function held() {
  if (!item() || !state.locked[state.selected.index]) return false;
  state.notice = `The ${words(item().category)} is locked. Unlock it first.`;
  render();
  return true;
}

function change(fields) {
  const chosen = item();
  if (!chosen || !idle() || held()) return;
  const before = Object.fromEntries(Object.keys(fields).map((name) => [name, chosen[name]]));
  if ("size" in fields || !chosen.center) Object.assign(state, outdated);
  Object.assign(chosen, fields);
  state.notice = "";
  render();
  settled(chosen, before);
}

const turn = (degrees) => item()?.center && change({ rotation: (((item().rotation ?? 0) + degrees) % 360 + 360) % 360 });

function lock() {
  if (!item()) return;
  state.locked[state.selected.index] = !state.locked[state.selected.index];
  changed();
}

function remove() {
  const { selected, room } = state;
  if (!selected || !idle() || held()) return;
  if (selected.kind === "opening") return document.dispatchEvent(new CustomEvent("unopen", { detail: selected.index }));
  room.furniture.splice(selected.index, 1);
  state.locked.splice(selected.index, 1);
  retarget(room);
  unselect();
  changed();
}

// What has the focus is chosen: it leaves it first.
function unselect() {
  plan.focus({ preventScroll: true });
  select(null);
}

// Which item moves by default is for files that name it; here the list has changed.
function retarget(room) {
  delete room.target;
  state.look.faults = [];
  Object.assign(state, outdated);
}

function add(entries) {
  const { room } = state;
  retarget(room);
  for (const entry of entries) {
    room.furniture.push(structuredClone(entry));
    state.locked.push(false);
  }
}

document.addEventListener("add", ({ detail }) => {
  add([{ ...detail, center: [...state.look.middle], rotation: 0 }]);
  select("item", state.room.furniture.length - 1);
  changed();
});

$("usual").onclick = () => {
  add(known.palette[state.room.room_type].flatMap(({ item: entry, usual }) => Array(usual).fill(entry)));
  changed();
};

$("clear").onclick = () => {
  state.room.furniture.forEach((entry, k) => {
    if (state.locked[k]) return;
    delete entry.center;
    delete entry.rotation;
  });
  state.lines = [];
  state.look.gaps = [];
  changed();
};

$("turn").onclick = () => turn(90);
$("lock").onclick = lock;
$("delete").onclick = remove;
$("place").onclick = () => change({ center: [...state.look.middle], rotation: item().rotation ?? 0 });
for (const [id, side] of [["depth", 0], ["width", 1]]) {
  $(id).onchange = () => {
    const value = Number($(id).value);
    const size = item().shape === "circle" ? [value, value] : item().size.with(side, value);
    change({ size });
  };
}
$("degrees").onchange = () => item().center && change({ rotation: Number($("degrees").value) });

async function travelled(back) {
  if (!idle() || !travel(back)) return;
  Object.assign(state, { ...outdated, thoughts: null, problem: "", look: { ...state.look, gaps: [] } });
  state.look = await answered("look", { room: state.room });
  document.dispatchEvent(new Event("choose"));
  look();
}

$("undo").onclick = () => travelled(true);
$("redo").onclick = () => travelled(false);

document.addEventListener("keydown", (event) => {
  const letter = event.key.toLowerCase();
  if (!(event.ctrlKey || event.metaKey) || event.target.matches("input")) return;
  if (letter === "z") travelled(!event.shiftKey);
  else if (letter === "y") travelled(false);
  else return;
  event.preventDefault();
});

plan.addEventListener("keydown", (event) => {
  if (state.mode !== "edit" || !idle() || event.ctrlKey || event.metaKey || event.altKey) return;
  const thing = event.target.closest("[data-item], [data-opening]");
  const way = STEPS[event.key];
  if (thing && (event.key === "Enter" || event.key === " ")) {
    if (thing.dataset.item) select("item", Number(thing.dataset.item));
    else select("opening", Number(thing.dataset.opening));
  } else if (way && item()?.center) {
    const step = event.shiftKey ? 0.01 : 0.05;
    change({ center: item().center.map((value, axis) => centimetres(value + step * way[axis])) });
  } else if (event.key === "Escape") unselect();
  else if (event.key === "Delete" || event.key === "Backspace") remove();
  else if (event.key === "r" || event.key === "R") turn(event.shiftKey ? 15 : 90);
  else if (event.key === "l" || event.key === "L") lock();
  else return;
  event.preventDefault();
});

plan.addEventListener("focusin", ({ target }) => {
  if (state.mode === "edit" && idle() && !drag && target.dataset?.item) select("item", Number(target.dataset.item));
});
