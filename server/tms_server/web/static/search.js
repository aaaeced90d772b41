// "Where is ...?" answered in words.

import * as api from "./api.js";
import { html } from "./svg.js";
import { duration, percent, places } from "./words.js";

/** Answer a question into `into`; `found(tag)` tells which object was meant. */
export async function answer(words, into, model, found) {
  const objects = await api.search(words);
  if (objects.length === 0) {
    into.replaceChildren(html("p", {}, `No object is called “${words}”.`));
    return;
  }
  const locations = await Promise.all(objects.map((one) => api.location(one.tag)));
  into.replaceChildren(...locations.map((one) => paragraph(one, model)));
  found(objects[0].tag);
}

function paragraph(location, model) {
  const pie = location.distribution;
  const elsewhere = location.room !== null && location.room !== model.room.id;
  const likely = places(model, pie).filter(({ p }) => p >= 0.01).slice(0, 4);
  const list = likely.map(({ words, p }, i) => `${i === 0 && p < 0.95 ? "probably " : ""}${words} (${percent(p)})`);
  let text = list.length === 0 ? " is in no room that is watched." : ` is ${list.join(", or ")}.`;
  if (elsewhere) text = `${text.slice(0, -1)}, in room ${location.room}.`;
  if (location.staleness_s !== null) text += ` Its tag was last read ${duration(location.staleness_s)} ago.`;
  return html("p", {}, html("strong", {}, location.name), text);
}
