// Furniture by hand: dragged, turned, locked, added, deleted; and how it was before.

import { back } from "./building.js";
import { $, changed, idle, inTurn, inTurnHere, known, look, measures, plan, render, say, select, waits } from "./page.js";
import { metres } from "./plan.js";
import { WAYS, commit, foundNow, item, outdated, state, travel, words } from "./store.js";

const centimetres = (value) => Math.round(value * 100) / 100;
const TYPED = "input:not([type=checkbox], [type=file])"; // who types there undoes letters
const BACK = " It is back as it was.";
const FURNITURE = "[data-item], use"; // which shows the chosen item on top
let drag = null;
let touched = false; // by a finger, and not pressed

// Whether an item is dragged that was neither deleted nor undone, by the pointer of an event if one is given: a second
// finger moves nothing.
const dragging = (event) =>
  drag !== null && state.room.furniture.includes(drag.dragged) && (!event || drag.pointer === event.pointerId);

// Choose the door or window that was pointed at; where there is none, nothing is chosen.
function chooseOpening(target) {
  document.activeElement.blur(); // what was typed in a field is of the item that was chosen
  const opening = target.closest("[data-opening]");
  if (opening) select("opening", Number(opening.dataset.opening));
  else select(null);
}

plan.addEventListener("pointerdown", (event) => {
  if (dragging() || state.mode !== "edit" || !idle() || event.button !== 0) return;
  touched = event.pointerType === "touch";
  const furniture = event.target.closest(FURNITURE);
  if (!furniture && touched) return; // it may scroll; `click` tells
  if (!furniture) return chooseOpening(event.target);
  document.activeElement.blur();
  const index = Number(furniture.dataset.item ?? state.selected.index);
  select("item", index);
  document.querySelector(`[data-item="${index}"]`)?.focus({ preventScroll: true });
  event.preventDefault();
  if (state.locked[index] || waits()) return;
  plan.setPointerCapture(event.pointerId);
  const dragged = state.room.furniture[index];
  drag = { pointer: event.pointerId, dragged, from: metres(plan, event), center: dragged.center, moved: false };
});

plan.addEventListener("click", ({ target }) => {
  if (touched && state.mode === "edit" && idle() && !target.closest(FURNITURE)) chooseOpening(target);
});

plan.addEventListener("pointermove", (event) => {
  if (!dragging(event)) return;
  const [x, y] = metres(plan, event);
  const center = [drag.center[0] + x - drag.from[0], drag.center[1] + y - drag.from[1]].map(centimetres);
  if (!drag.moved && Math.hypot(x - drag.from[0], y - drag.from[1]) < 0.02) return;
  drag.moved = true;
  state.notice = "";
  drag.dragged.center = center;
  state.look.gaps = [];
  render();
  look();
});

async function dropped(event) {
  if (!dragging(event)) return;
  const { dragged, center, moved } = drag;
  drag = null;
  if (moved) await inTurn(() => settled(() => Object.assign(dragged, { center }), BACK));
}

plan.addEventListener("pointerup", dropped);
plan.addEventListener("pointercancel", dropped);
plan.addEventListener("lostpointercapture", dropped);

// Of a key that is held, what comes before the server has answered: an item would run on after it.
const tooSoon = (event) => event.repeat && waits();

// Keep a change if the server takes it, which is returned; else it is put back, and said why, and what became of it.
async function settled(putBack, became = "") {
  state.notice = "";
  render();
  await look();
  const { problem } = state;
  if (problem) {
    putBack();
    state.notice = became ? problem.replace(/[^.?]$/, "$&.") + became : problem;
    await look();
  } else {
    commit();
    render();
  }
  document.dispatchEvent(new Event("choose"));
  return !problem;
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
  if (drag) return null; // where it is now is not judged yet
  const chosen = item();
  return inTurn(() => changedTo(chosen, fieldsOf));
}

async function changedTo(chosen, fieldsOf) {
  if (changeable(chosen) < 0) return;
  const fields = fieldsOf(chosen);
  const before = Object.fromEntries(Object.keys(fields).map((name) => [name, chosen[name]]));
  const found = foundNow();
  if ("size" in fields || !chosen.center) Object.assign(state, outdated);
  Object.assign(chosen, fields);
  await settled(() => {
    Object.assign(chosen, before);
    Object.assign(state, found);
  }, BACK);
}

const wrapped = (degrees) => ((degrees % 360) + 360) % 360;
const turn = (degrees) => item()?.center && change(({ rotation }) => ({ rotation: wrapped((rotation ?? 0) + degrees) }));

function lock() {
  if (drag) return null;
  const chosen = item();
  return inTurn(() => {
    const index = state.room.furniture.indexOf(chosen);
    if (index < 0 || !idle()) return;
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

// What has the focus in the plan is chosen: it leaves it first. A row of the list keeps it.
function unselect() {
  if (!document.activeElement.dataset.row) plan.focus({ preventScroll: true });
  select(null);
}

// Which item moves by default is for files that name it; here the list has changed.
function retarget(room) {
  delete room.target;
  state.look.faults = [];
  Object.assign(state, outdated);
}

// Whether the server takes furniture more; else there is none of it.
async function added(entries) {
  if (!idle()) return false;
  const { room, locked } = state;
  const [before, found] = [{ ...room }, foundNow()];
  retarget(room);
  room.furniture = [...room.furniture, ...entries.map((entry) => structuredClone(entry))];
  state.locked = [...locked, ...entries.map(() => false)];
  return settled(() => {
    Object.assign(room, before);
    Object.assign(state, { ...found, locked });
  });
}

// An item more stands in the middle, or is to be placed where it does not fit there.
document.addEventListener("add", ({ detail }) => inTurn(async () => {
  const standing = { ...detail, center: [...state.look.middle], rotation: 0 };
  if ((await added([standing])) || (await added([detail]))) select("item", state.room.furniture.length - 1);
}));

// What most rooms of the type have, and this one has not yet.
function lacking({ room_type, furniture }) {
  const same = (one, other) => one.category === other.category && one.shape === other.shape;
  return known.palette[room_type].flatMap(({ item: entry, usual }) => {
    const has = furniture.filter((other) => same(entry, other)).length;
    return Array(Math.max(usual - has, 0)).fill(entry);
  });
}

$("usual").onclick = () => inTurn(() => {
  const entries = lacking(state.room);
  if (entries.length) return added(entries);
  state.notice = "All that is usual is there.";
  return render();
});

$("clear").onclick = () => inTurn(async () => {
  if (!idle()) return;
  const free = state.room.furniture.filter((_, k) => !state.locked[k]);
  const before = free.map((entry) => ({ ...entry }));
  for (const entry of free) {
    delete entry.center;
    delete entry.rotation;
  }
  state.lines = [];
  state.look.gaps = [];
  await settled(() => free.forEach((entry, k) => Object.assign(entry, before[k])));
});

// What stands stays, whatever the room is now; it is furnished as one of that type.
$("type").onchange = () => {
  const kind = $("type").value;
  return inTurnHere(() => {
    const { room } = state;
    const [before, found] = [{ ...room }, foundNow()];
    retarget(room);
    room.room_type = kind;
    return settled(() => {
      Object.assign(room, before);
      Object.assign(state, found);
    }, BACK);
  });
};

$("turn").onclick = () => turn(90);
$("lock").onclick = lock;
$("delete").onclick = remove;
$("place").onclick = () => change(({ rotation }) => ({ center: [...state.look.middle], rotation: rotation ?? 0 }));
// A field of the chosen item, and what becomes of its number. Then it says what is so: what it was, where that is refused.
function typed(id, act) {
  $(id).onchange = async () => {
    const [value, chosen] = [$(id).valueAsNumber, item()];
    if (Number.isFinite(value)) await act(value);
    if (chosen && chosen === item() && !waits()) $(id).value = measures(chosen)[id];
  };
}

const within = ({ min, max }, value) => Math.min(Math.max(value, min), max);

for (const [id, side] of [["depth", 0], ["width", 1]]) {
  typed(id, (value) => change(({ shape, size }) => {
    const length = within($(id), value);
    return { size: shape === "circle" ? [length, length] : size.with(side, length) };
  }));
}
typed("degrees", (degrees) => item()?.center && change(() => ({ rotation: wrapped(degrees) })));

async function travelled(before) {
  if (!idle() || !travel(before)) return;
  Object.assign(state, { thoughts: null, notice: "", look: { ...state.look, gaps: [], faults: [] } });
  await look();
  document.dispatchEvent(new Event("choose"));
  if (state.problem) say(state.problem); // else unsaid while a door or window is put in
}

// Of an outline that is drawn, the last corner is undone: the room is hidden.
const undo = () => (state.mode === "draw" ? back() : inTurn(() => travelled(true)));
const redo = () => state.mode !== "draw" && inTurn(() => travelled(false));

$("undo").onclick = undo;
$("redo").onclick = redo;

document.addEventListener("keydown", (event) => {
  const letter = event.key.toLowerCase();
  if (!(event.ctrlKey || event.metaKey) || event.target.matches(TYPED)) return;
  if ("yz".includes(letter) && tooSoon(event)) return event.preventDefault();
  if (letter === "y" || (letter === "z" && event.shiftKey)) redo();
  else if (letter === "z") undo();
  else return;
  event.preventDefault();
});

function pressed(event) {
  if (state.mode !== "edit" || !idle() || event.ctrlKey || event.metaKey || event.altKey) return;
  if (tooSoon(event)) return event.preventDefault();
  const thing = event.target.closest("[data-item], [data-opening]");
  const way = WAYS[event.key];
  if (thing && (event.key === "Enter" || event.key === " ")) {
    if (thing.dataset.item) select("item", Number(thing.dataset.item));
    else select("opening", Number(thing.dataset.opening));
  } else if (way && item()?.center) {
    const step = event.shiftKey ? 0.01 : 0.05;
    const stepped = ({ center }) => ({ center: center.map((value, axis) => centimetres(value + step * way[axis])) });
    change(stepped);
  } else if (event.key === "Escape") unselect();
  else if (event.key === "Delete" || event.key === "Backspace") remove();
  else if (event.key === "r" || event.key === "R") turn(event.shiftKey ? 15 : 90);
  else if (event.key === "l" || event.key === "L") lock();
  else return;
  event.preventDefault();
}

function focused({ target }) {
  const index = target.dataset.item ?? target.dataset.row;
  if (state.mode === "edit" && idle() && !drag && index) select("item", Number(index));
}

for (const part of [plan, $("furniture")]) {
  part.addEventListener("keydown", pressed);
  part.addEventListener("focusin", focused);
}
