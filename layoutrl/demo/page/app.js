// The page begins.

import { begin } from "./api.js";
import "./building.js";
import { offerKinds } from "./building.js";
import "./edit.js";
import "./furnish.js";
import { $, complain, known, plan, render, say } from "./page.js";
import { fromLink, offer, offerUnits, shown } from "./saving.js";
import { sourceOf, state } from "./store.js";

const FIRST = "bedroom";

$("past-rooms").onclick = () => plan.focus();

try {
  const said = await begin();
  Object.assign(known, said);
  for (const name of ["fronts", "raised", "oddities"]) known[name] = new Set(said[name]);
  offerKinds();
  offerUnits();
  const gallery = sourceOf(known.gallery);
  offer(gallery);
  const first = known.gallery.find(({ room }) => room.room_type === FIRST);
  await fromLink();
  if (!state.room) {
    const wrong = $("verdict").textContent; // with the link
    await shown(first, gallery);
    if (wrong) complain(wrong);
  }
} catch (error) {
  say(error.message);
}

addEventListener("resize", render);
