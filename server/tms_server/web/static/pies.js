// One card per object: its name, its pie in the labels' colours, and the same in words.

import { html, keyed, set, svg, text } from "./svg.js";
import { percent, place, placeName, places, sentence } from "./words.js";

export class Pies {
  /** `on.object(tag or null)`: somebody points at this object. */
  constructor(list, empty, on) {
    this._list = list;
    this._empty = empty;
    this._on = on;
  }

  draw(model, colours) {
    const objects = [...model.objects.values()].sort((a, b) => (a.tag < b.tag ? -1 : 1));
    keyed(this._list, objects, (one) => one.tag, (one) => this._card(one),
      (card, one) => update(card, one, model, colours));
    this._empty.hidden = objects.length > 0;
  }

  /** Point out the cards of objects that may be at a label; null for none. */
  point(model, label) {
    for (const card of this._list.children) {
      const pie = model.objects.get(card.dataset.object)?.distribution ?? [];
      card.classList.toggle("pointed", label !== null && pie.some((slice) => slice.label === label && slice.p >= 0.005));
    }
  }

  /** Bring the card of an object into view and point it out. */
  show(tag) {
    const card = [...this._list.children].find((one) => one.dataset.object === tag);
    card?.scrollIntoView({ block: "nearest" });
    card?.focus();
  }

  _card(one) {
    const card = html("li", { "data-object": one.tag, tabindex: "0" },
      svg("svg", { class: "pie", viewBox: "-52 -52 104 104", role: "img" }),
      html("div", { class: "names" }, html("h2"), html("p", { class: "synonym" })),
      html("ul", { class: "places" }));
    for (const event of ["pointerenter", "focus"]) card.addEventListener(event, () => this._on.object(one.tag));
    for (const event of ["pointerleave", "blur"]) card.addEventListener(event, () => this._on.object(null));
    return card;
  }
}

function update(card, one, model, colours) {
  text(card.querySelector("h2"), one.name);
  text(card.querySelector(".synonym"), model.synonyms.get(one.tag) ?? "");
  const words = sentence(model, one.distribution);
  set(card, { "data-places": words, "aria-label": `${one.name}: ${words}` });
  const look = one.distribution.map(({ label, p }) => `${label} ${p} ${colours.of(label)}`).join("|");
  if (card.dataset.look !== look + words) {
    card.dataset.look = look + words;
    const pie = card.querySelector(".pie");
    set(pie, { "aria-label": `${one.name}: ${words}` });
    pie.replaceChildren(...slices(one, model, colours));
  }
  const shown = places(model, one.distribution, placeName).filter(({ p }) => p >= 0.02).slice(0, 3);
  keyed(card.querySelector(".places"), shown, (item) => item.words, () => line(), (node, item) => {
    set(node.querySelector("rect"), { fill: colours.of(item.label) });
    text(node.querySelector(".where"), item.words);
    text(node.querySelector(".p"), percent(item.p));
  });
}

function line() {
  return html("li", {},
    svg("svg", { class: "swatch", viewBox: "0 0 10 10", "aria-hidden": "true" },
      svg("rect", { x: 0.5, y: 0.5, width: 9, height: 9, rx: 2 })),
    html("span", { class: "where" }), html("span", { class: "p" }));
}

/** Slices clockwise from the top, the largest first. What is below one per cent would only be a line: it is left out. */
function slices(one, model, colours) {
  const shown = one.distribution.filter(({ p }) => p >= 0.01)
    .sort((a, b) => b.p - a.p || (a.label < b.label ? -1 : 1));
  const whole = shown.reduce((sum, { p }) => sum + p, 0);
  const nodes = [svg("circle", { class: "pie-ground", r: 50 })];
  let turn = 0;
  for (const slice of shown) {
    const fill = colours.of(slice.label);
    const shape = shown.length === 1
      ? svg("circle", { class: "slice", r: 50, fill })
      : svg("path", { class: "slice", d: wedge(turn, turn + slice.p / whole), fill });
    turn += slice.p / whole;
    set(shape, { "data-label": slice.label, "data-p": slice.p.toFixed(4) });
    shape.append(svg("title", {}, `${place(model, slice)} ${percent(slice.p)}`));
    nodes.push(shape);
  }
  nodes.push(svg("circle", { class: "pie-edge", r: 50, fill: "none" }));
  return nodes;
}

function wedge(from, to) {
  const at = (turn) => `${(50 * Math.sin(2 * Math.PI * turn)).toFixed(2)} ${(-50 * Math.cos(2 * Math.PI * turn)).toFixed(2)}`;
  return `M0 0L${at(from)}A50 50 0 ${to - from > 0.5 ? 1 : 0} 1 ${at(to)}Z`;
}
