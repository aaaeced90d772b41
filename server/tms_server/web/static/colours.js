// One colour per label, the same on every page and for as long as the label lives.
//
// Hues follow Okabe and Ito's palette, which colour-blind people tell apart: a cabinet has a hue of its own, its labels
// are shades of it; the floor is orange, tables are yellow, a robot's hand is pink, people are white as in the paper.

import { agentOf } from "./model.js";

const CABINETS = [
  ["#0b63b5", "#5aa9e6", "#063f78", "#8fc7f2", "#2f86d1", "#b7dcf7"],
  ["#00775b", "#4cbf9f", "#004a38", "#86d9c2", "#1f9c7c", "#b5e8da"],
  ["#7b4ab0", "#b48fdb", "#4d2a78", "#cdb3ea", "#9569c7", "#e0d0f3"],
  ["#6b5a2a", "#a8934f", "#443814", "#c7b67d", "#8a763c", "#ded2aa"],
  ["#a03050", "#d77a95", "#6b1a32", "#e8a9bb", "#bd5573", "#f3ced8"],
];
const FLOOR = ["#d55e00", "#f39a52", "#9c4400", "#ffbf8a", "#b85000", "#ffd7b5"];
const TABLE = ["#edbe00", "#b58f00", "#ffe066", "#8a6d00", "#d4aa00", "#fff0a8"];
const HAND = ["#d0438f", "#ea8fbe", "#96205f", "#f5bfd9"];
const PEOPLE = ["#ffffff", "#e6dfd0", "#d6e1ea", "#eadbe2"];
const ROBOTS = ["#c3ccd6", "#a9b6c4"];
export const OUTSIDE = "#8b929a";

export class Colours {
  constructor() {
    this._given = new Map();
    this._cabinets = new Map();
  }

  /** Give the cabinets of a room their hues, in the order in which the room lists them. */
  furnish(room) {
    for (const one of room.furniture) if (one.agent) this._hueOf(one.agent);
  }

  /** Forget labels that are gone and give the new ones colours; call before drawing. */
  update(model) {
    const live = new Set([...model.labels.keys(), ...model.movers.keys()]);
    for (const label of this._given.keys()) if (!live.has(label)) this._given.delete(label);
    const labels = [...model.labels.values()].sort((a, b) => number(a.label) - number(b.label));
    for (const label of labels) this._give(label.label, this._shades(label));
    for (const mover of model.people()) this._give(mover.label, PEOPLE);
    for (const mover of model.robots()) this._give(mover.label, ROBOTS);
  }

  of(label) {
    return label === "OUT" ? OUTSIDE : this._given.get(label) ?? OUTSIDE;
  }

  /** The label's number picks the shade, the next free one where another label has it. */
  _give(label, shades) {
    if (this._given.has(label)) return;
    const taken = new Set(this._given.values());
    const first = (number(label) + shades.length - 1) % shades.length;
    const order = shades.map((_, i) => shades[(first + i) % shades.length]);
    this._given.set(label, order.find((shade) => !taken.has(shade)) ?? order[0]);
  }

  _shades(label) {
    if (label.kind === "floor") return FLOOR;
    if (label.kind === "table") return TABLE;
    if (label.kind === "robot") return HAND;
    return CABINETS[this._hueOf(agentOf(label.label)) % CABINETS.length];
  }

  _hueOf(agent) {
    if (!this._cabinets.has(agent)) this._cabinets.set(agent, this._cabinets.size);
    return this._cabinets.get(agent);
  }
}

function number(label) {
  return Number.parseInt(label.slice(label.lastIndexOf("/") + 1), 10) || 0;
}
