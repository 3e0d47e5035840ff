// The page begins.

import { begin } from "./api.js";
import "./building.js";
import { offerKinds } from "./building.js";
import "./edit.js";
import "./furnish.js";
import { known, open, render, say } from "./page.js";
import { fromLink, offer } from "./saving.js";

const FIRST = "bedroom";

try {
  const said = await begin();
  Object.assign(known, said, { fronts: new Set(said.fronts), raised: new Set(said.raised) });
  offerKinds();
  offer(known.gallery);
  const first = known.gallery.find(({ room }) => room.room_type === FIRST);
  const wrong = location.hash && !(await fromLink()) ? document.getElementById("verdict").textContent : "";
  if (!location.hash || wrong) await open(structuredClone(first.room));
  if (wrong) say(wrong);
} catch (error) {
  say(error.message);
}

addEventListener("resize", render);
