// Furnishing: the moves as they were made, the choices, and what the agent thinks of an item.

import { ask } from "./api.js";
import { $, become, changed, element, idle, judged, latest, plan, render, say } from "./page.js";
import { item, outdated, state, withLocked } from "./store.js";

const MOVE = 450; // milliseconds, of a move; less where there are many
const ALL = 9000; // milliseconds, of all moves at most
const CHOICES = 3;
const STEP = 0.15; // metres between the places of a heat map
let asked = 0; // how often: each time others may be found
let skip = null;
let more = null; // what the server says last of other choices: it furnishes one room after the other

async function furnish(chosen) {
  const focus = document.activeElement;
  await judged();
  const { selected } = state;
  const movable = chosen().filter((k) => !state.locked[k]);
  if (!idle()) return;
  Object.assign(state, { mode: "edit", thoughts: null, notice: "", lines: [] });
  become("asking");
  render();
  say("Looking for places …", false);
  try {
    await more; // who waits there, and not here, may be told to ask again
    const about = { room: structuredClone(state.room), movable, seed: asked++ };
    const { lines, choices } = await ask("furnish", { ...about, choices: 1 });
    Object.assign(state, { lines, choices });
    if (choices.length) {
      const without = ({ message }) => ({ choices: [], lines: [...lines, `No other choices: ${message}`] });
      more = ask("furnish", about).catch(without);
      offerMore(choices);
      say("Placing …", false);
      await play(0, movable);
    } else state.notice = "No place was found.";
  } catch (error) {
    Object.assign(state, { notice: error.message, ...outdated });
  }
  become("idle");
  state.selected = selected;
  if (state.choices.length) await changed();
  think();
  if (document.activeElement === document.body) focus.focus({ preventScroll: true }); // else it is elsewhere by now
}

// Offer other choices beside the first. They are found while that is played and looked at; by then, they may be outdated.
async function offerMore(choices) {
  $("choices").setAttribute("aria-busy", "true");
  const first = JSON.stringify(choices[0].furniture);
  const { choices: found, lines } = await more;
  const others = found.filter(({ furniture }) => JSON.stringify(furniture) !== first);
  $("choices").setAttribute("aria-busy", "false");
  choices.push(...others.slice(0, CHOICES - 1)); // also of what was undone: it may be done again
  if (state.choices !== choices) return;
  state.lines = lines; // what was said with the first choice, or why there are no others
  render();
}

// Show how a choice came to be, move by move; its end is what it is.
async function play(index, movable) {
  const { path, furniture } = state.choices[index];
  state.chosen = index;
  state.selected = null;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (!still) {
    become("playing");
    $("skip").hidden = false;
    const stopped = new Promise((resolve) => { skip = resolve; }).then(() => true);
    state.look.gaps = [];
    state.look.faults = [];
    const goes = new Set(path.map(([k]) => k));
    for (const k of movable) if (goes.has(k) || !furniture[k].center) delete state.room.furniture[k].center;
    for (const [k, center, degrees] of path) {
      const seconds = Math.min(MOVE, ALL / path.length) * Number($("speed").value);
      if (await Promise.race([stopped, moved(state.room.furniture[k], center, degrees, seconds)])) break;
    }
    $("skip").hidden = true;
    skip = null;
  }
  state.room.furniture = structuredClone(furniture);
}

// Move an item to a pose in so many milliseconds.
function moved(entry, center, degrees, milliseconds) {
  const from = entry.center ?? state.look.middle;
  const first = entry.center ? (entry.rotation ?? degrees) : degrees;
  const turn = ((degrees - first + 540) % 360) - 180;
  const began = performance.now();
  return new Promise((resolve) => {
    const frame = (now) => {
      if (!skip) return resolve(false);
      const share = Math.min(Math.max((now - began) / milliseconds, 0), 1);
      const eased = share * share * (3 - 2 * share);
      entry.center = from.map((value, axis) => value + (center[axis] - value) * eased);
      entry.rotation = first + turn * eased;
      render();
      if (share < 1) requestAnimationFrame(frame);
      else resolve(false);
    };
    requestAnimationFrame(frame);
  });
}

$("furnish").onclick = () => furnish(() => [...state.room.furniture.keys()]);
$("only").onclick = () => furnish(() => (item() ? [state.selected.index] : []));
$("skip").onclick = () => skip?.();

document.addEventListener("take", async ({ detail }) => {
  await judged();
  if (!idle() || !state.choices[detail]) return;
  state.chosen = detail;
  state.room.furniture = structuredClone(withLocked(state.choices[detail]));
  changed();
  think();
});

// What the agent thinks of the chosen item.
function think() {
  $("scale").hidden = true;
  $("moves").replaceChildren();
  state.thoughts = null;
  return thinking();
}

const thinking = latest(async (stale) => {
  const chosen = item();
  const [heat, arrows] = [$("heat").checked, $("arrows").checked];
  if (chosen?.center && (heat || arrows)) {
    const about = { room: structuredClone(state.room), item: state.selected.index };
    plan.dataset.thinking = "true";
    try {
      const values = heat ? await ask("values", { ...about, step: STEP }) : null;
      const moves = arrows && !stale() ? (await ask("moves", about)).moves : [];
      if (stale() || item() !== chosen) return;
      state.thoughts = { values, moves, step: STEP };
      if (values?.values.length) {
        $("scale").hidden = false;
        $("low").textContent = Math.min(...values.values).toFixed(1);
        $("high").textContent = Math.max(...values.values).toFixed(1);
      }
      $("moves").replaceChildren(...moves.map(({ name, value }) => element("li", { textContent: `${name}: ${value.toFixed(1)}` })));
    } catch (error) {
      state.notice = error.message;
    } finally {
      delete plan.dataset.thinking;
    }
  }
  render();
});

document.addEventListener("choose", think);
$("heat").onchange = think;
$("arrows").onchange = think;
