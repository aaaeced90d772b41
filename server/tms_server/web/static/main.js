// The page: choose a room, follow it, draw the newest state once per display frame.

import * as api from "./api.js";
import { Colours } from "./colours.js";
import { follow } from "./live.js";
import { Model } from "./model.js";
import { Pies } from "./pies.js";
import { Plan } from "./plan.js";
import { answer } from "./search.js";
import { html, text } from "./svg.js";
import { clock, duration } from "./words.js";

const byId = (id) => document.getElementById(id);
const colours = new Colours();
let model = null;
let end = () => {};
let drawing = false;
let lostAt = null;

const plan = new Plan(byId("plan"), byId("legend"), { label: (label) => model && pies.point(model, label) });
const pies = new Pies(byId("pies"), byId("empty"), {
  object: (tag) => plan.point(tag === null ? null : model?.objects.get(tag)?.distribution ?? null),
});

async function start() {
  end();
  let rooms;
  try {
    rooms = await api.rooms();
  } catch (error) {
    if (error.status === 401) return askForKey();
    connection("lost", error.message);
    return setTimeout(start, 2000);
  }
  if (rooms.length === 0) {
    connection("connecting", "no room yet");
    return setTimeout(start, 2000);
  }
  const wanted = new URLSearchParams(window.location.search).get("room");
  const select = byId("room");
  select.replaceChildren(...rooms.map((one) => html("option", { value: one.id }, one.name)));
  select.value = rooms.some((one) => one.id === wanted) ? wanted : rooms[0].id;
  byId("chooser").hidden = rooms.length < 2;
  return enter(rooms.find((one) => one.id === select.value));
}

function enter(room) {
  end();
  model = new Model(room);
  text(byId("room-name"), room.name);
  document.title = `${room.name}: where things are`;
  colours.furnish(room);
  plan.furnish(room);
  chart();
  end = follow(room.id, {
    frame(frame) {
      const names = [...model.objects.keys()].length;
      model.apply(frame);
      if (frame.type === "snapshot" || model.objects.size !== names) learnNames(model);
      draw();
    },
    state: connection,
  });
}

/** What robots have mapped of the room, now. */
async function chart() {
  const of = model;
  if (of === null) return;
  try {
    const maps = await api.maps(of.room.id);
    if (of === model) plan.chart(maps);
  } catch {
    // the page lives without maps
  }
}

/** The second language of the names comes from the object database, once. */
async function learnNames(of) {
  try {
    for (const one of await api.objects(of.room.id)) of.synonyms.set(one.tag, one.synonyms[0] ?? "");
    draw();
  } catch {
    // the page lives without synonyms
  }
}

function draw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    colours.update(model);
    plan.draw(model, colours);
    pies.draw(model, colours);
    status();
  });
}

function connection(state, detail) {
  const lamp = byId("connection");
  if (state === "refused") {
    askForKey(detail);
    state = "lost";
  }
  if (state !== "live" && lostAt === null && model?.at) lostAt = Date.now();
  if (state === "live") lostAt = null;
  lamp.dataset.state = state;
  lamp.dataset.detail = detail ?? "";
  status();
}

function status() {
  const { state, detail } = byId("connection").dataset;
  const asOf = model?.at ? ` as of ${clock(model.at)}` : "";
  const words = {
    live: `live${asOf}`,
    connecting: detail || "connecting",
    lost: lostAt === null ? `no connection${detail ? `: ${detail}` : ""}`
      : `stale since ${clock(lostAt)} (${duration((Date.now() - lostAt) / 1000)}), reconnecting`,
  };
  text(byId("connection-text"), words[state]);
  document.body.classList.toggle("is-stale", state === "lost");
}

function askForKey(detail) {
  text(byId("login-error"), detail ?? "");
  if (!byId("login").open) byId("login").showModal();
}

byId("login").addEventListener("cancel", (event) => event.preventDefault());
byId("login-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  try {
    await api.login(byId("key").value);
    byId("key").value = "";
    byId("login").close();
    await start();
  } catch (error) {
    text(byId("login-error"), error.message);
  }
});

byId("room").addEventListener("change", () => {
  const url = new URL(window.location);
  url.searchParams.set("room", byId("room").value);
  window.history.replaceState(null, "", url);
  start();
});

byId("search").addEventListener("submit", async (event) => {
  event.preventDefault();
  const words = byId("query").value.trim().replace(/[?？]+$/, "");
  if (words === "" || model === null) return;
  byId("answer").hidden = false;
  try {
    await answer(words, byId("answer-text"), model, (tag) => pies.show(tag));
  } catch (error) {
    byId("answer-text").replaceChildren(html("p", {}, error.message));
  }
});
byId("answer-close").addEventListener("click", () => {
  byId("answer").hidden = true;
  byId("query").focus();
});

setInterval(status, 1000);
setInterval(chart, 15_000);
start();
