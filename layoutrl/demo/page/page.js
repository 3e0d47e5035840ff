// Shows what the page holds, and asks the server what is wrong with it.

import { ask } from "./api.js";
import { draw, drawDraft, thumbnail } from "./plan.js";
import { canTravel, commit, item, openings, outdated, snapshot, sourceOf, state, withLocked, words } from "./store.js";

export const $ = (id) => document.getElementById(id);
export const plan = $("plan");
export const known = { // what the server said at first
  gallery: [], palette: {}, fronts: new Set(), raised: new Set(), oddities: new Set(), units: [],
};

export function element(tag, attributes = {}, ...children) {
  const node = Object.assign(document.createElement(tag), attributes);
  node.append(...children);
  return node;
}

export const button = (text, onclick, attributes = {}) => element("button", { type: "button", textContent: text, onclick, ...attributes });

// Screen readers read out whatever is put there, were it the same again.
export function say(text, bad = true) {
  const verdict = $("verdict");
  verdict.classList.toggle("bad", bad);
  if (verdict.textContent === text) return;
  verdict.textContent = text;
  if (verdict.scrollHeight > verdict.clientHeight) verdict.tabIndex = 0; // keys scroll what has the focus
  else verdict.removeAttribute("tabindex");
}

// Say what went wrong, until something changes.
export function complain(text) {
  state.notice = text;
  say(text);
}

// What the page does: loading, idle, asking, playing. Only while it is idle can its rooms and tools be used.
export function become(name) {
  document.body.dataset.state = name;
  for (const part of document.querySelectorAll("nav, aside, #type")) part.inert = name !== "idle";
  if (name === "idle") document.dispatchEvent(new Event("idle"));
}

export const idle = () => document.body.dataset.state === "idle";
const playing = () => document.body.dataset.state === "playing";
const furnishing = () => playing() || document.body.dataset.state === "asking";

// What asks the server, so that at most one question is on its way: what changes meanwhile is asked after it. `asking` may
// learn whether it has.
export function latest(asking) {
  let running = null;
  let stale = false;
  const all = async () => {
    while (stale) {
      stale = false;
      await asking(() => stale);
    }
  };
  return () => {
    stale = true;
    running ??= all().finally(() => { running = null; });
    return running;
  };
}

let awaited = 0; // answers that the plan waits for

function busy(answer) {
  awaited += 1;
  plan.setAttribute("aria-busy", true);
  return answer.finally(() => {
    awaited -= 1;
    plan.setAttribute("aria-busy", awaited > 0);
  });
}

// Ask what is wrong now.
const looking = latest(async () => {
  const { selected, room } = state;
  const chosen = item()?.center ? selected.index : null;
  try {
    const said = await ask("look", { room, item: chosen });
    if (state.room === room) {
      Object.assign(state, { look: said, problem: "", refused: false });
      document.dispatchEvent(new Event("looked"));
    }
  } catch (error) {
    if (state.room === room) Object.assign(state, { problem: error.message, refused: error.cause === 400 });
  }
  if (!playing()) render();
});

export const look = () => busy(looking());

// Each change by hand waits for what the server says of the one before; what else alters the room, for all of them.
let last = Promise.resolve();
let waiting = 0; // changes

export function inTurn(act) {
  waiting += 1;
  last = last.then(act, act).finally(() => { waiting -= 1; });
  return last;
}

// The same of what is of the room as a whole: not of another that is shown by then, nor while it is furnished.
export function inTurnHere(act) {
  const { source, room: { id } } = state;
  const here = () => idle() && state.source === source && state.room.id === id;
  return inTurn(() => (here() ? act() : render()));
}

export const waits = () => waiting > 0;
export const judged = () => last;

// A question whose answer the plan waits for.
export const answered = (question, body) => busy(ask(question, body));

// Wait until no room is being furnished, and all changes are judged.
async function untilIdle() {
  await judged();
  while (furnishing()) {
    await new Promise((resolve) => { document.addEventListener("idle", resolve, { once: true }); });
    await judged();
  }
}

let asked = 0; // how often another room
let latestTaken = 0; // of these

// Take another room; whether it was taken. It is shown as soon as the server has read it, and no other is being furnished, but
// not after one that was asked for later.
export async function open(room, locked = [], source = sourceOf()) {
  asked += 1;
  const mine = asked;
  try {
    const said = await answered("look", { room });
    await untilIdle();
    if (mine < latestTaken) return false;
    latestTaken = mine;
    Object.assign(state, { room: said.room, source, look: said, problem: "", refused: false, notice: "", mode: "edit" });
    Object.assign(state, { selected: null, thoughts: null, ...outdated });
    state.locked = said.room.furniture.map((_, k) => locked[k] || false);
    state.room.furniture.forEach((item) => delete item.locked); // who edits may unlock it
    commit();
    render();
    become("idle");
    return true;
  } catch (error) {
    complain(error.message);
    if (!state.room) document.querySelector("nav").inert = false; // another may be shown
    return false;
  }
}

// Show and keep a change that is done, and ask what is wrong with it now.
export function changed() {
  state.notice = "";
  commit();
  render();
  return look();
}

export function select(kind, index) {
  const same = state.selected?.kind === kind && state.selected.index === index;
  if (same) return;
  Object.assign(state, { selected: kind ? { kind, index } : null, thoughts: null, notice: "" });
  state.look.gaps = [];
  document.dispatchEvent(new Event("choose"));
  render();
  look();
}

// Metres of the grid to draw on: as large as is chosen, and never less than what is drawn.
export const grid = () =>
  $("grid").value.split(" ").map((least, axis) => Math.max(least, ...state.draft.map((corner) => Math.ceil(corner[axis]))));

export function render() {
  if (!state.room) return;
  const focus = document.activeElement?.closest?.("[data-item], [data-opening], [data-row]");
  const where = focus && ["item", "opening", "row"].map((name) => [name, focus.dataset[name]]).find(([, value]) => value);
  if (state.mode === "draw") drawDraft(plan, state, grid());
  else draw(plan, state, known, idle);
  renderStrip();
  renderList();
  renderSelected();
  renderChoices();
  renderTools();
  renderLines();
  $("link-label").hidden = state.linked === null || snapshot() !== state.linked; // the link holds a room as it was
  if (where) (document.querySelector(`[data-${where[0]}="${where[1]}"]`) ?? plan).focus({ preventScroll: true });
}

function renderStrip() {
  const now = state.source.pictures.get(state.room.id)?.parentElement;
  for (const node of $("gallery").querySelectorAll("[aria-current]")) if (node !== now) node.removeAttribute("aria-current");
  now?.setAttribute("aria-current", "true");
}

function wrongWith(index) {
  return state.look.faults.filter(([k]) => k === index).map(([, , text]) => text);
}

function rowOf(index) {
  const row = button("", () => select("item", index));
  row.dataset.row = index;
  return element("li", {}, row, element("p", { className: "bad" }));
}

// Rows stay, with other words: one may have the focus, or be pressed just now.
function renderList() {
  const { room, look: { faults }, problem, notice, mode } = state;
  $("title").textContent = `${words(room.room_type)}, ${state.look.area.toFixed(1)} m²`;
  $("title").dataset.room = room.id;
  const list = $("furniture");
  while (list.children.length > room.furniture.length) list.lastChild.remove();
  room.furniture.forEach((entry, k) => {
    const [row, wrong] = (list.children[k] ?? list.appendChild(rowOf(k))).children;
    const size = entry.size.map((side) => side.toFixed(2)).join(" × ");
    row.textContent = `${words(entry.category)}, ${size} m${state.locked[k] ? ", locked" : ""}`;
    row.setAttribute("aria-pressed", state.selected?.kind === "item" && state.selected.index === k);
    wrong.textContent = wrongWith(k).join("; ");
    wrong.hidden = !wrong.textContent;
  });
  if (mode === "draw") $("title").textContent = "A new room";
  $("standing").hidden = $("adding").hidden = mode === "draw";
  if (mode !== "edit" || furnishing()) return;
  const standing = faults.filter(([k]) => room.furniture[k]?.center).map(([, , text]) => text);
  const waiting = faults.length - standing.length;
  const wrong = problem || notice || [waiting && `${waiting} to be placed`, ...standing].filter(Boolean).join("; ");
  say(wrong || (room.furniture.length ? "Nothing is wrong." : "It is empty: add furniture."), Boolean(wrong));
}

// What the fields of an item say.
export const measures = ({ size: [depth, width], rotation = 0 }) =>
  Object.fromEntries(Object.entries({ depth, width, degrees: rotation }).map(([id, value]) => [id, +value.toFixed(3)]));

function renderSelected() {
  const { selected, room, look: { gaps } } = state;
  $("selected").hidden = !selected || state.mode !== "edit";
  $("thinking").hidden = $("selected").hidden || !item()?.center;
  if (!selected) return;
  const chosen = item();
  const opening = openings(room)[selected.index];
  for (const id of ["item-buttons", "item-sizes", "gaps"]) $(id).hidden = !chosen;
  $("name").textContent = chosen ? words(chosen.category) : opening.kind;
  $("delete").disabled = Boolean(chosen && state.locked[selected.index]);
  $("wrong").textContent = chosen ? (state.refused && state.problem) || wrongWith(selected.index).join("; ") : "";
  if (!chosen) return;
  const lock = Boolean(state.locked[selected.index]);
  $("lock").setAttribute("aria-pressed", lock);
  $("turn").disabled = lock || !chosen.center;
  $("only").disabled = lock;
  $("place").hidden = Boolean(chosen.center);
  for (const [id, value] of Object.entries(measures(chosen))) {
    if (document.activeElement !== $(id)) $(id).value = value;
    $(id).disabled = lock;
  }
  $("gaps").textContent = gaps.length ? `Free beside it: ${gaps.map(([, , metres]) => `${metres.toFixed(2)} m`).join(", ")}` : "";
}

const counted = (count, one, several) => count && `${count} ${count > 1 ? several : one}`;

// Nothing is said of a choice in which something was locked elsewhere since: nobody has looked at it.
function choiceOf(choice, k) {
  const { faults, by } = choice;
  const furniture = withLocked(choice);
  const pose = ({ center, rotation }) => JSON.stringify([center, rotation]);
  if (furniture.some((entry, index) => pose(entry) !== pose(choice.furniture[index]))) return choiceNode(furniture, k, `Choice ${k + 1}`);
  const faulty = new Set(faults.map(([index]) => index));
  const odd = faults.filter(([, name]) => known.oddities.has(name)).length;
  const counts = [counted(faults.length - odd, "fault", "faults"), counted(odd, "oddity", "oddities")];
  const text = counts.filter(Boolean).join(", ") || "no fault";
  return choiceNode(furniture, k, `Choice ${k + 1}${by ? `, by ${by}` : ""}: ${text}`, faulty);
}

function choiceNode(furniture, k, textContent, faulty = new Set()) {
  const node = button("", () => document.dispatchEvent(new CustomEvent("take", { detail: k })));
  node.append(thumbnail({ ...state.room, furniture }, state.look.box, known, faulty), element("span", { textContent }));
  return node;
}

let offered = []; // the choices that are drawn, in which box, and what was locked

// They stay while they are the same: one may have the focus, or be pressed just now.
function renderChoices() {
  const { choices, chosen, look, mode, room, locked } = state;
  const now = [choices, String(look.box), JSON.stringify(room.furniture.filter((_, k) => locked[k]))];
  $("choices").hidden = choices.length === 0 || mode === "draw";
  if (now.some((what, k) => what !== offered[k])) $("choices").replaceChildren();
  offered = now;
  for (let k = $("choices").children.length; k < choices.length; k += 1) $("choices").append(choiceOf(choices[k], k));
  [...$("choices").children].forEach((node, k) => node.setAttribute("aria-pressed", k === chosen));
}

// They are told by screen readers whenever they are drawn: once is enough.
let told = [];

function renderLines() {
  $("lines").hidden = state.mode === "draw";
  if (told === state.lines) return;
  told = state.lines;
  $("lines").replaceChildren(...told.map((textContent) => element("li", { textContent })));
}

function renderTools() {
  const { mode, draft, room } = state;
  $("undo").disabled = playing() || (mode === "draw" ? !draft.length : !canTravel(true));
  $("redo").disabled = playing() || mode === "draw" || !canTravel(false);
  $("furnish").disabled = playing() || mode === "draw";
  for (const id of ["close", "back", "grid-label"]) $(id).hidden = mode !== "draw";
  $("close").disabled = draft.length < 3;
  $("back").disabled = !draft.length;
  $("draw").textContent = mode === "draw" ? "Cancel" : draft.length ? "Go on with the outline" : "Draw an outline";
  for (const kind of ["door", "window"]) {
    $(kind).setAttribute("aria-pressed", mode === kind);
    $(kind).disabled = mode === "draw";
  }
  $("type").hidden = $("keys").hidden = mode === "draw";
  $("type").value = room.room_type;
  const entries = known.palette[room.room_type] ?? [];
  if ($("palette").dataset.type === room.room_type) return;
  $("palette").dataset.type = room.room_type;
  $("kind").value = room.room_type;
  $("palette").replaceChildren(...entries.map(({ item: entry }) => {
    const size = entry.size.map((side) => side.toFixed(2)).join(" × ");
    const add = () => document.dispatchEvent(new CustomEvent("add", { detail: entry }));
    return element("li", {}, button(`${words(entry.category)}${entry.shape ? ", round" : ""}, ${size} m`, add));
  }));
}
