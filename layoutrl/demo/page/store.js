// What the page holds: a room, what is locked in it, what is chosen, and how it was before.

export const state = {
  room: null, // as in its JSON
  locked: [], // of each piece of furniture: true, false, or "page" where nobody else locked it
  source: null, // that the room is from, made by sourceOf
  look: null, // what the server last said of the room
  problem: "", // why nobody says what is wrong with the room as it is
  refused: false, // whether that is because of the room
  notice: "", // what else is to be said, until something changes
  lines: [], // of a file that was opened, or of what was not placed
  selected: null, // {kind: "item" | "opening", index}
  mode: "edit", // or "draw", "door", "window"
  draft: [], // corners of an outline that is being drawn, until it is closed
  cursor: [1, 1], // where the keyboard would put the next
  choices: [],
  chosen: 0,
  linked: null, // a snapshot: what the link holds
  thoughts: null, // {values, moves} of the chosen item
};

// Where rooms are from: the gallery, a file, a drawing. Of those that were shown it has snapshots, by their ids: as they
// are now, as they were first, and as they were last saved. `name` is that of a file, `home` its bytes where that is a home,
// `lines` what was said of it, `pictures` are in the strip.
export const sourceOf = (rooms = [], name = "", home = null, lines = []) =>
  ({ rooms, name, home, lines, now: new Map(), first: new Map(), saved: new Map(), pictures: new Map() });

const sources = new Set(); // of rooms that were shown
const MOST = 500; // changes that can be undone, for the sake of memory
const past = []; // each {text: a snapshot, source}
const future = []; // the same, and {found}, as foundNow was there
let present = null;

export const snapshot = () => JSON.stringify({ room: state.room, locked: state.locked });

// A room is taken up, and saved with others, as it was left.
function keep() {
  const { source, text } = present;
  const { id } = state.room;
  sources.add(source);
  if (!source.first.has(id)) for (const texts of [source.first, source.saved]) texts.set(id, text);
  source.now.set(id, text);
}

// What marks rooms as saved as they are now, whatever is edited until that is done; `but` those of some ids.
export function marks(source, ids) {
  const texts = ids.map((id) => [id, source.now.get(id)]);
  return (but = []) => texts.forEach(([id, text]) => but.includes(id) || source.saved.set(id, text));
}

export const unsaved = ({ now, saved }) => [...now].some(([id, text]) => text !== saved.get(id));

export const anyUnsaved = () => state.draft.length > 0 || [...sources].some(unsaved);

// Keep nothing of a source that was read anew: undo does not come back to it.
export function forget(source) {
  sources.delete(source);
  for (const texts of [past, future]) texts.splice(0, Infinity, ...texts.filter((entry) => entry.source !== source));
}

// Keep how things are now, so that undo comes back here.
export function commit() {
  const now = { text: snapshot(), source: state.source };
  if (now.text === present?.text && now.source === present.source) return;
  if (present) past.push(present);
  if (past.length > MOST) past.shift();
  present = now;
  future.length = 0;
  keep();
}

// The room before, or after, with what was found of it when it was left for one before; false if there is none.
export function travel(back) {
  const [from, to] = back ? [past, future] : [future, past];
  if (!from.length) return false;
  to.push(back ? { ...present, found: foundNow() } : present);
  const { text, source, found } = from.pop();
  present = { text, source };
  Object.assign(state, JSON.parse(text), { source }, outdated, found);
  keep();
  const { selected, room } = state;
  if (selected?.kind === "item" && selected.index >= room.furniture.length) state.selected = null;
  if (selected?.kind === "opening" && selected.index >= openings(room).length) state.selected = null;
  return true;
}

// The furniture of a choice, but for what is locked, which stays where it is.
export const withLocked = ({ furniture }) =>
  furniture.map((entry, k) => (state.locked[k] ? state.room.furniture[k] : entry));

// What was found, of furniture or walls that are others now.
export const outdated = { choices: [], chosen: 0, lines: [] };

// What is `outdated` where furniture is another: to have it back.
export const foundNow = () => Object.fromEntries(Object.keys(outdated).map((name) => [name, state[name]]));

export const canTravel = (back) => (back ? past : future).length > 0;

export const openings = (room) => [
  ...room.doors.map((door) => ({ kind: "door", ...door })),
  ...room.windows.map((window) => ({ kind: "window", ...window })),
];

export const item = () => (state.selected?.kind === "item" ? state.room.furniture[state.selected.index] : null);

// Which way each key goes.
export const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export const words = (category) => category.replaceAll("_", " ");

// A link holds the room in its fragment, which browsers send nowhere.
const through = async (bytes, stream) =>
  new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());

export async function packed(text) {
  const bytes = await through(new TextEncoder().encode(text), new CompressionStream("deflate-raw"));
  const letters = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return letters.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

export async function unpacked(letters) {
  const bytes = Uint8Array.from(atob(letters.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
  return new TextDecoder().decode(await through(bytes, new DecompressionStream("deflate-raw")));
}
