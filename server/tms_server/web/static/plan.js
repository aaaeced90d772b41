// The floor plan: walls, furniture, labels as marks, movers as icons. Metres become centimetres, y grows downwards.

import { mark, person, robot } from "./marks.js";
import { html, keyed, set, svg, text } from "./svg.js";
import { mover as moverInWords, percent } from "./words.js";

const MARGIN = 22;
/** Names are written beside labels of these kinds; in a cabinet they would cover each other. */
const NAMED = new Set(["floor", "table", "robot"]);

export class Plan {
  constructor(root, legend, on) {
    this._root = root;
    this._on = on;
    this._ground = svg("g");
    this._labels = svg("g");
    this._movers = svg("g");
    this._names = svg("g");
    root.replaceChildren(this._ground, this._labels, this._movers, this._names);
    for (const [kind, words] of [
      ["cabinet", "in a cabinet"], ["floor", "on the floor"],
      ["robot", "in the robot's hand"], ["table", "put down by the robot"],
    ]) {
      const picture = svg("svg", { viewBox: "-14 -14 28 28", "aria-hidden": "true" }, mark(kind, "currentColor"));
      legend.append(html("li", {}, picture, words));
    }
  }

  /** Draw what stands still. */
  furnish(room) {
    const xs = room.outline.map(([x]) => 100 * x);
    const ys = room.outline.map(([, y]) => -100 * y);
    const [x0, y0] = [Math.min(...xs) - MARGIN, Math.min(...ys) - MARGIN];
    set(this._root, {
      viewBox: `${x0} ${y0} ${Math.max(...xs) + MARGIN - x0} ${Math.max(...ys) + MARGIN - y0}`,
      "aria-label": `Floor plan of ${room.name}`,
    });
    this._ground.replaceChildren(svg("polygon", { class: "walls", points: points(room.outline) }));
    for (const one of room.furniture) this._ground.append(furniture(one));
    for (const group of [this._labels, this._movers, this._names]) group.replaceChildren();
  }

  /** Draw what moves. */
  draw(model, colours) {
    const labels = [...model.labels.values()].sort((a, b) => (a.label < b.label ? -1 : 1));
    keyed(this._labels, labels, (one) => `${one.label} ${one.kind} ${colours.of(one.label)}`,
      (one) => this._newLabel(one, colours.of(one.label)), (node, one) => updateLabel(node, one, model));
    const movers = [...model.people(), ...model.robots()];
    keyed(this._movers, movers, (one) => `${one.label} ${one.theta ?? ""}`,
      (one) => newMover(one, model, colours.of(one.label)), (node, one) => updateMover(node, one, model));
    const named = labels.filter((one) => NAMED.has(one.kind) && contents(one, model).length > 0);
    keyed(this._names, named, (one) => one.label, () => svg("text", { class: "thing" }),
      (node, one) => updateName(node, one, model));
  }

  /** Point out the labels where an object may be; null for none. */
  point(distribution) {
    const p = new Map((distribution ?? []).map((slice) => [slice.label, slice.p]));
    this._root.classList.toggle("pointing", distribution !== null);
    for (const node of [...this._labels.children, ...this._movers.children]) {
      node.classList.toggle("pointed", (p.get(node.dataset.label) ?? 0) >= 0.005);
    }
  }

  _newLabel(one, colour) {
    const title = svg("title");
    const node = svg("g", { class: "label", "data-label": one.label, "data-kind": one.kind, role: "img" }, title,
      mark(one.kind, colour, one.put_by_robot));
    node.addEventListener("pointerenter", () => this._on.label(one.label));
    node.addEventListener("pointerleave", () => this._on.label(null));
    return node;
  }
}

function furniture(one) {
  const xs = one.polygon.map(([x]) => 100 * x);
  const ys = one.polygon.map(([, y]) => -100 * y);
  const [width, height] = [Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys)];
  const [cx, cy] = [(Math.max(...xs) + Math.min(...xs)) / 2, (Math.max(...ys) + Math.min(...ys)) / 2];
  const upright = height > 1.8 * width;
  // Marks of a cabinet are on its middle line; its name stands beside that.
  const [dx, dy] = !one.agent ? [0, 0] : upright ? [-width / 2 - 9, 0] : [0, height / 2 + 15];
  const turn = upright && one.agent ? ` rotate(-90)` : "";
  return svg("g", { class: one.agent ? "furniture smart" : "furniture", "data-furniture": one.id },
    svg("polygon", { points: points(one.polygon) }),
    svg("text", { transform: `translate(${cx + dx} ${cy + dy})${turn}` }, one.name));
}

function updateLabel(node, one, model) {
  move(node, one.xy);
  node.classList.toggle("stale", one.stale);
  node.classList.toggle("ghost", one.ghost);
  const held = contents(one, model).map(({ name, p }) => `${name} ${percent(p)}`).join(", ") || "nothing known";
  const state = one.ghost ? " (hidden)" : one.stale ? " (its sensor is silent)" : "";
  text(node.firstElementChild, `${one.label}${state}: ${held}`);
  set(node, { "aria-label": `${one.label}${state}: ${held}` });
}

function newMover(one, model, colour) {
  const kind = model.isRobot(one) ? "robot" : "person";
  return svg("g", { class: "mover", "data-label": one.label, "data-mover": kind, role: "img" },
    svg("title"),
    kind === "robot" ? robot(colour, one.theta) : person(colour),
    svg("g", { class: "count", transform: "translate(0 -44)" },
      svg("rect", { x: -17, y: -15, width: 34, height: 28, rx: 9 }), svg("text", { y: 7 })));
}

function updateMover(node, one, model) {
  move(node, one.xy);
  node.classList.toggle("stale", one.stale);
  const count = one.expected_objects;
  const words = `${moverInWords(model, one.label)} has ${count.toFixed(1)} objects`;
  text(node.querySelector("title"), words);
  text(node.querySelector(".count text"), String(Math.round(count)));
  node.classList.toggle("empty", Math.round(count) === 0);
  set(node, { "aria-label": words, "data-count": Math.round(count) });
}

function updateName(node, one, model) {
  const east = Math.max(...model.room.outline.map(([x]) => x));
  const likely = contents(one, model).slice(0, 3);
  const lines = likely.map(({ name, p }) => (p >= 0.95 ? name : `${name} ${percent(p)}`));
  const key = lines.join("\n");
  if (node.dataset.lines !== key) {
    node.dataset.lines = key;
    node.replaceChildren(...lines.map((line, i) => svg("tspan", { x: 0, dy: i === 0 ? 0 : 16 }, line)));
  }
  // Beside the mark, away from a near east wall; below a gripper, whose robot stands beside it.
  const below = one.kind === "robot";
  const west = !below && one.xy[0] > east - 1.6;
  node.style.textAnchor = below ? "middle" : west ? "end" : "start";
  const [dx, dy] = below ? [0, 30] : [west ? -17 : 17, 5 - 8 * (lines.length - 1)];
  node.style.transform = `translate(${100 * one.xy[0] + dx}px, ${-100 * one.xy[1] + dy}px)`;
}

function contents(one, model) {
  return Object.entries(one.contents)
    .filter(([, p]) => p >= 0.02)
    .map(([tag, p]) => ({ name: model.objects.get(tag)?.name ?? tag, p }))
    .sort((a, b) => b.p - a.p || (a.name < b.name ? -1 : 1));
}

function move(node, [x, y]) {
  node.style.transform = `translate(${100 * x}px, ${-100 * y}px)`;
}

function points(polygon) {
  return polygon.map(([x, y]) => `${100 * x},${-100 * y}`).join(" ");
}
