// A room of one's own: an outline on a grid of 10 cm, doors and windows through its walls.

import { $, answered, changed, complain, grid, idle, inTurnHere, known, plan, render, say } from "./page.js";
import { metres, pixel, snapped } from "./plan.js";
import { openAlone } from "./saving.js";
import { WAYS, item, openings, outdated, state, words } from "./store.js";

const HINTS = {
  draw: "Click corner after corner, or go with the arrows and press Enter; the first corner again closes the outline.",
  door: "Click a wall, or go there with the arrows and press Enter.",
  window: "Click a wall, or go there with the arrows and press Enter.",
};
const NEAR = 4; // pixels: who points as near to the first corner means it
let closing = false; // an outline
const far = (one, other) => Math.hypot(one[0] - other[0], one[1] - other[1]);
const same = (one, other) => one.join() === other.join();

// A point on the grid; of an outline, one that is shown.
function reached(point) {
  const to = snapped(point);
  if (state.mode !== "draw") return to;
  const most = grid();
  return to.map((value, axis) => Math.min(Math.max(value, 0), most[axis]));
}

function enter(mode) {
  if (!idle()) return;
  Object.assign(state, { mode: state.mode === mode ? "edit" : mode, selected: null, thoughts: null, notice: "" });
  state.cursor = [...(mode === "draw" ? state.draft.at(-1) ?? [1, 1] : state.look.middle)];
  render();
  if (state.mode === "edit") return;
  say(HINTS[mode], false);
  plan.focus({ preventScroll: true });
  plan.scrollIntoView({ block: "nearest" }); // on a phone it is above
}

async function put() {
  const { mode, draft, cursor } = state;
  if (mode === "draw") {
    if (draft.length > 2 && (same(draft[0], cursor) || far(draft[0], cursor) < NEAR * pixel(plan))) return close();
    if (!draft.some((corner) => same(corner, cursor))) draft.push(cursor);
    return render();
  }
  const about = { kind: mode, at: cursor, width: Number($("wide").value) };
  return inTurnHere(() => rebuilt(about, () => ({ mode: state.mode === mode ? "edit" : state.mode })));
}

// Ask for walls with a door or window more, or less; and what else is so then.
async function rebuilt(about, then) {
  try {
    const said = await answered("opening", { room: state.room, ...about });
    Object.assign(state, { room: said.room, look: said, ...then(), ...outdated });
    await changed();
  } catch (error) {
    complain(error.message);
  }
}

async function close() {
  if (closing) return; // a second click, before the server has answered
  closing = true;
  const kind = $("kind").value;
  const room = { id: `my ${words(kind)}`, room_type: kind, outline: state.draft, doors: [], windows: [], furniture: [] };
  const opened = await openAlone(room).finally(() => { closing = false; });
  if (!opened) return;
  state.draft = [];
  state.source.saved.clear(); // unlike a room that is read, it is nowhere else
  $("adding").open = true;
  render();
}

document.addEventListener("unopen", ({ detail }) => {
  const chosen = JSON.stringify(openings(state.room)[detail]);
  return inTurnHere(() => {
    const remove = openings(state.room).findIndex((opening) => JSON.stringify(opening) === chosen);
    return remove < 0 ? null : rebuilt({ remove }, () => ({ selected: item() && state.selected }));
  });
});

plan.addEventListener("pointermove", (event) => {
  if (state.mode === "edit") return;
  const cursor = reached(metres(plan, event));
  if (same(cursor, state.cursor)) return;
  state.cursor = cursor;
  render();
});

plan.addEventListener("click", (event) => {
  if (state.mode === "edit") return;
  state.cursor = reached(metres(plan, event));
  put();
});

plan.addEventListener("keydown", (event) => {
  if (state.mode === "edit" || event.ctrlKey || event.metaKey || event.altKey) return;
  const way = WAYS[event.key];
  if (way) {
    state.cursor = reached(state.cursor.map((value, axis) => value + way[axis] * (event.shiftKey ? 1 : 0.1)));
    say(state.cursor.map((value) => value.toFixed(1)).join(", "), false);
    render();
  } else if (event.key === "Enter") put();
  else if (event.key === "Backspace") back();
  else if (event.key === "Escape") enter(state.mode);
  else return;
  event.preventDefault();
  event.stopImmediatePropagation();
});

export function back() {
  state.draft.pop();
  render();
}

$("draw").onclick = () => enter("draw");
$("door").onclick = () => enter("door");
$("window").onclick = () => enter("window");
$("wide").onchange = () => { if (!$("wide").valueAsNumber) $("wide").value = $("wide").defaultValue; };
$("close").onclick = close;
$("back").onclick = back;
$("grid").onchange = () => {
  state.cursor = reached(state.cursor);
  render();
};
export function offerKinds() {
  const kinds = Object.keys(known.palette);
  for (const id of ["kind", "type"]) $(id).replaceChildren(...kinds.map((kind) => new Option(words(kind), kind)));
}
