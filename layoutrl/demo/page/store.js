// What the page holds: a room, what is locked in it, what is chosen, and how it was before.

export const state = {
  room: null, // as in its JSON
  locked: [], // of each piece of furniture
  home: null, // that the room is of: {file, rooms: by their ids, snapshots of those that were shown; read: their first ones}
  look: null, // what the server last said of the room
  problem: "", // why the server refuses the room as it is
  notice: "", // what else is to be said, until something changes
  selected: null, // {kind: "item" | "opening", index}
  mode: "edit", // or "draw", "door", "window"
  draft: [], // corners of an outline that is being drawn
  cursor: [1, 1], // where the keyboard would put the next
  choices: [],
  chosen: 0,
  thoughts: null, // {values, moves} of the chosen item
};

const past = []; // each {text: a snapshot, home}
const future = [];
let present = null;

export const snapshot = () => JSON.stringify({ room: state.room, locked: state.locked });

// A home is saved with all its rooms as they are now, whichever of them is shown.
function keep() {
  const { home, text } = present;
  const { id } = state.room;
  if (!home) return;
  if (!home.read.has(id)) home.read.set(id, text);
  home.rooms.set(id, text);
}

// Keep how things are now, so that undo comes back here.
export function commit() {
  const now = { text: snapshot(), home: state.home };
  if (now.text === present?.text && now.home === present.home) return;
  if (present) past.push(present);
  present = now;
  future.length = 0;
  keep();
}

// The room before, or after; nothing if there is none.
export function travel(back) {
  const [from, to] = back ? [past, future] : [future, past];
  if (!from.length) return false;
  to.push(present);
  present = from.pop();
  Object.assign(state, JSON.parse(present.text), { home: present.home });
  keep();
  const { selected, room } = state;
  if (selected?.kind === "item" && selected.index >= room.furniture.length) state.selected = null;
  if (selected?.kind === "opening" && selected.index >= openings(room).length) state.selected = null;
  return true;
}

export const canTravel = (back) => (back ? past : future).length > 0;

export const openings = (room) => [
  ...room.doors.map((door) => ({ kind: "door", ...door })),
  ...room.windows.map((window) => ({ kind: "window", ...window })),
];

export const item = () => (state.selected?.kind === "item" ? state.room.furniture[state.selected.index] : null);

export const words = (category) => category.replaceAll("_", " ");

// A link holds the room in its fragment, which browsers send nowhere.
const through = async (bytes, stream) =>
  new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());

export async function packed(text) {
  const bytes = await through(new TextEncoder().encode(text), new CompressionStream("deflate-raw"));
  const letters = btoa(String.fromCharCode(...bytes));
  return letters.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

export async function unpacked(letters) {
  const bytes = Uint8Array.from(atob(letters.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
  return new TextDecoder().decode(await through(bytes, new DecompressionStream("deflate-raw")));
}
