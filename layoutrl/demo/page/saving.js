// Files in and out, and the link that holds the room.

import { ask, home, read } from "./api.js";
import { $, complain, element, judged, known, open, render, say } from "./page.js";
import { thumbnail } from "./plan.js";
import { anyUnsaved, forget, marks, packed, snapshot, sourceOf, state, unpacked, unsaved, words } from "./store.js";

const LARGEST = { home: 50, other: 5 }; // MB that the server takes
const PIXELS = 1600; // of the longer side of a PNG
const PAGE = "page"; // what the page has locked, and nobody else

function download(content, kind, ending, name = state.room.id) {
  const file = `${name.replace(/[^\p{L}\p{M}\p{N}_-]+/gu, "_")}.${ending}`;
  const link = element("a", { href: URL.createObjectURL(new Blob([content], { type: kind })), download: file });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// What JSON says is locked; and, by the page (PAGE), what is fixed in a home, and what stands where other furniture is to
// be placed.
function locks({ furniture }, fixed) {
  const waits = furniture.some(({ center }) => !center);
  return furniture.map(({ center, locked }, k) => locked || ((fixed.includes(k) || (waits && center)) && PAGE));
}

// The room as JSON has it: with what the user has locked of that which stands, or JSON had.
function withLocks({ room, locked }) {
  const held = (item, k) => item.center && locked[k] === true;
  const furniture = room.furniture.map((item, k) => (held(item, k) ? { ...item, locked: true } : item));
  return { ...room, furniture };
}

// Take up a room of the strip as it was left, with what its file says of it, unless that is of another type now. Whether it
// is shown.
export async function shown({ room, fixed = [] }, source) {
  const left = source.now.get(room.id);
  const now = left ? JSON.parse(left) : { room: structuredClone(room), locked: locks(room, fixed) };
  if (!(await open(now.room, now.locked, source))) return false;
  if (now.room.room_type === room.room_type) state.lines = source.lines.filter((line) => line.startsWith(`${room.id}: `));
  render();
  return true;
}

// The name of a room among others of its home, whose name begins all their ids.
const alone = ({ id, group }, { home }) => (home && id.startsWith(`${group}/`) ? id.slice(group.length + 1) : id);

// Show rooms in the strip; those of a file with their names, where it has several.
export function offer(source, before = false) {
  const named = source.name && source.rooms.length > 1;
  const entries = source.rooms.map((entry) => {
    const { room, box } = entry;
    const node = element("button", { type: "button", title: room.id, onclick: () => shown(entry, source) });
    const picture = thumbnail(room, box, known);
    source.pictures.set(room.id, picture);
    node.append(picture, element("span", { textContent: words(room.room_type) }));
    if (named) node.append(element("span", { className: "id", textContent: alone(room, source) }));
    return element("li", {}, node);
  });
  if (before) $("gallery").prepend(...entries);
  else $("gallery").append(...entries);
  return entries;
}

// Take a room that is from no file; the strip keeps it.
export async function openAlone(room, locked) {
  if (!(await open(room, locked))) return false;
  state.source.rooms.push(state.look);
  offer(state.source, true);
  render();
  return true;
}

document.addEventListener("looked", () => {
  const { room, look, source } = state;
  const picture = source.pictures.get(room.id);
  if (!picture) return;
  picture.replaceChildren(...thumbnail(room, look.box, known).children);
  picture.nextElementSibling.textContent = words(room.room_type);
});

export const offerUnits = () => $("unit").append(...known.units.map((unit) => new Option(unit)));

let last = null; // the file that was opened last, the unit, and what was read: its source, and its entries in the strip

async function opened(file, before = { source: null, entries: [] }) {
  if (!file) return;
  const endings = $("file").accept.split(",");
  if (!endings.some((ending) => file.name.toLowerCase().endsWith(ending))) {
    return complain(`${file.name}: expected a file of rooms: ${endings.join(", ")}`);
  }
  const mine = { ...before, file, unit: $("unit").value };
  last = mine;
  state.lines = [];
  render();
  try {
    const most = (await file.slice(0, 2).text()) === "PK" ? LARGEST.home : LARGEST.other; // a home is a ZIP
    if (file.size > most * 1e6) return complain(`${file.name} is larger than ${most} MB.`);
    say(`${file.name} is being read.`, false); // a large home takes seconds
    const content = new Blob([await file.arrayBuffer()]); // which stays as it is, whatever becomes of the file
    const name = file.name.replace(/(?<=.)\.\w+$/, "");
    const { rooms, left_out, home: whole } = await read(content, name, mine.unit);
    const source = sourceOf(rooms, name, whole ? content : null, left_out);
    Object.assign(mine, { source, entries: offer(source, true) });
    if (!(await shown(rooms[0], source))) return;
    before.entries.forEach((entry) => entry.remove());
    forget(before.source);
    state.lines = left_out;
    render();
  } catch (error) {
    complain(`${file.name}: ${error.message}`);
  }
}

// All rooms of the file that the room is from, as they are now; a room by itself where there is no other.
function saveJSON() {
  const { room, source } = state;
  const { name, rooms, now } = source;
  const whole = name && rooms.length > 1;
  const asNow = (read) => (now.has(read.room.id) ? withLocks(JSON.parse(now.get(read.room.id))) : read.room);
  const content = whole ? rooms.map(asNow) : withLocks(state);
  download(`${JSON.stringify(content)}\n`, "application/json", "json", whole ? name : room.id);
  marks(source, whole ? [...now.keys()] : [room.id])();
  if ($("unit").value === "auto") return;
  $("unit").value = "auto"; // to open it again: it is in metres, whatever the file was in
  say("Saved in metres. The unit of what is opened next is auto again.", false);
}

// What a home does not keep of rooms that are saved in it, in a line; and the ids of those that are not whole in it. What
// stands beside a room in a new home is in it.
function unkept(rooms, { home: whole, rooms: read }) {
  const waits = ({ furniture }) => furniture.filter(({ center }) => !center);
  const typeOf = new Map(read.map(({ room: { id, room_type } }) => [id, room_type]));
  const retyped = ({ id, room_type }) => whole && room_type !== typeOf.get(id);
  const names = [...new Set(rooms.flatMap(waits).map(({ category }) => words(category)))].join(", ");
  const where = whole ? "stays there where it stood" : "stands beside the room there";
  const other = rooms.some(retyped) && "the type that you chose is not in it: JSON keeps that";
  const lines = [names && `what has no place ${where}: ${names}`, other].filter(Boolean);
  const lost = rooms.filter((room) => retyped(room) || (whole && waits(room).length));
  return { line: lines.map((line) => `home: saved, but ${line}`).join("; "), ids: lost.map(({ id }) => id) };
}

// The home with this room and all others of it that were changed, as they are now; or a new home.
async function saveHome() {
  const { room, source } = state;
  const changed = [...source.now].filter(([id, text]) => source.home && id !== room.id && text !== source.first.get(id));
  const others = changed.map(([, text]) => JSON.parse(text).room);
  const mark = marks(source, source.home ? [...source.now.keys()] : [room.id]);
  const { content, left, without } = await (source.home ? home(room, others, source.home, source.name) : home(room, []));
  download(content, "application/zip", "sh3d", source.home ? source.name : room.id);
  const lost = unkept([room, ...others.filter((_, k) => !without.includes(k))], source);
  mark([...lost.ids, ...without.map((k) => others[k].id)]);
  if (left || lost.line) complain([left, lost.line].filter(Boolean).join("; "));
}

$("file").onclick = () => { $("file").value = ""; }; // the same file, too, is opened anew
$("file").onchange = () => opened($("file").files[0]);
$("unit").onchange = () => {
  if (!last) return;
  const { file, unit, source } = last;
  const kept = source && unsaved(source) && !confirm(`Read ${file.name} anew? Edits in it that are not saved are lost.`);
  if (kept) $("unit").value = unit;
  else opened(file, last);
};
document.addEventListener("dragover", (event) => event.preventDefault());
document.addEventListener("drop", (event) => {
  event.preventDefault();
  opened(event.dataTransfer.files[0]);
});

// Save, or say why not.
function saving(id, save) {
  $(id).onclick = async () => {
    try {
      await judged();
      await save();
    } catch (error) {
      complain(error.message);
    }
  };
}

const svg = async () => (await ask("svg", { room: state.room })).svg;

saving("save-json", saveJSON);
saving("save-svg", async () => download(await svg(), "image/svg+xml", "svg"));
saving("save-sh3d", saveHome);
saving("save-png", async () => {
  const picture = new Image();
  picture.src = URL.createObjectURL(new Blob([await svg()], { type: "image/svg+xml" }));
  await picture.decode();
  const scale = PIXELS / Math.max(picture.naturalWidth, picture.naturalHeight);
  const [width, height] = [picture.naturalWidth, picture.naturalHeight].map((side) => Math.round(side * scale));
  const canvas = element("canvas", { width, height });
  canvas.getContext("2d").drawImage(picture, 0, 0, width, height);
  URL.revokeObjectURL(picture.src);
  canvas.toBlob((blob) => download(blob, "image/png", "png"), "image/png");
});

saving("share", async () => {
  const mark = marks(state.source, [state.room.id]);
  const text = snapshot();
  history.replaceState(null, "", `#room=${await packed(text)}`);
  state.linked = text;
  mark();
  render();
  $("link").value = location.href;
  $("link").select();
});

// Show the room of the address, if it holds one. Says what is wrong with one that cannot be read.
export async function fromLink() {
  if (!location.hash.startsWith("#room=")) return;
  try {
    const { room, locked } = JSON.parse(await unpacked(location.hash.slice(6)));
    await openAlone(room, locked ?? []);
  } catch {
    complain("The link holds no whole room.");
  }
}

addEventListener("hashchange", fromLink);
addEventListener("beforeunload", (event) => {
  if (anyUnsaved()) event.preventDefault();
});
