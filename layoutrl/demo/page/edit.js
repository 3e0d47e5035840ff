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
  const dragged = state.room.furniture[index];
  await inTurn(() => settled(dragged, { center }));
}

plan.addEventListener("pointerup", dropped);
plan.addEventListener("pointercancel", dropped);

// Each change waits for what the server says of the one before.
let last = Promise.resolve();
const inTurn = (act) => (last = last.finally(act));

// Keep a change of an item if the server takes it, else put it back as it was.
async function settled(changing, before) {
  await look();
  const { problem } = state;
  if (problem) {
    Object.assign(changing, before);
    state.notice = problem;
    await look();
  } else {
    commit();
    render();
  }
  document.dispatchEvent(new Event("choose"));
}

// Where an item is in the list, if it may be changed: what is locked may not, which is said then.
function changeable(chosen) {
  const index = state.room.furniture.indexOf(chosen);
  if (index < 0 || !idle()) return -1;
  if (!state.locked[index]) return index;
  state.notice = `The ${words(chosen.category)} is locked. Unlock it first.`;
  render();
  return -1;
}

// Change the chosen item: `fieldsOf` says to what, of the item as it is once its turn has come.
function change(fieldsOf) {
  const chosen = item();
  return inTurn(() => changedTo(chosen, fieldsOf));
}

async function changedTo(chosen, fieldsOf) {
  if (changeable(chosen) < 0) return;
  const fields = fieldsOf(chosen);
  const before = Object.fromEntries(Object.keys(fields).map((name) => [name, chosen[name]]));
  if ("size" in fields || !chosen.center) Object.assign(state, outdated);
  Object.assign(chosen, fields);
  state.notice = "";
  render();
  await settled(chosen, before);
}

const turn = (degrees) =>
  item()?.center && change(({ rotation }) => ({ rotation: (((rotation ?? 0) + degrees) % 360 + 360) % 360 }));

function lock() {
  const chosen = item();
  return inTurn(() => {
    const index = state.room.furniture.indexOf(chosen);
    if (index < 0) return;
    state.locked[index] = !state.locked[index];
    changed();
  });
}

function remove() {
  const { selected } = state;
  if (selected?.kind === "opening" && idle()) document.dispatchEvent(new CustomEvent("unopen", { detail: selected.index }));
  const chosen = item();
  return inTurn(() => {
    const index = changeable(chosen);
    if (index < 0) return;
    state.room.furniture.splice(index, 1);
    state.locked.splice(index, 1);
    retarget(state.room);
    unselect();
    changed();
  });
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
$("place").onclick = () => change(({ rotation }) => ({ center: [...state.look.middle], rotation: rotation ?? 0 }));
for (const [id, side] of [["depth", 0], ["width", 1]]) {
  $(id).onchange = () => {
    const value = Number($(id).value);
    change(({ shape, size }) => ({ size: shape === "circle" ? [value, value] : size.with(side, value) }));
  };
}
$("degrees").onchange = () => {
  const rotation = Number($("degrees").value);
  if (item().center) change(() => ({ rotation }));
};

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
    const stepped = ({ center }) => ({ center: center.map((value, axis) => centimetres(value + step * way[axis])) });
    if (!event.repeat || plan.ariaBusy !== "true") change(stepped); // a key that is held waits: else the item ran on after it
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
