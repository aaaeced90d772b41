// The floor plan: walls, furniture, labels as marks, movers as icons. Metres become centimetres, y grows downwards.

import { mark, person, robot } from "./marks.js";
import { html, keyed, set, svg, text } from "./svg.js";
import { mover as moverInWords, percent } from "./words.js";

const MARGIN = 34;
/** Names are written beside labels of these kinds; in a cabinet they would cover each other. */
const NAMED = new Set(["floor", "table", "robot"]);

export class Plan {
  constructor(root, legend, on) {
    this._root = root;
    this._on = on;
    this._ground = svg("g");
    this._maps = svg("g");
    this._labels = svg("g");
    this._movers = svg("g");
    this._names = svg("g");
    root.replaceChildren(this._ground, this._maps, this._labels, this._movers, this._names);
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
    const { x0, y0, x1, y1 } = box(room.outline);
    set(this._root, {
      viewBox: `${x0 - MARGIN} ${y0 - MARGIN} ${x1 - x0 + 2 * MARGIN} ${y1 - y0 + 2 * MARGIN}`,
      "aria-label": `Floor plan of ${room.name}`,
    });
    this._ground.replaceChildren(svg("polygon", { class: "walls", points: points(room.outline) }));
    for (const one of room.furniture) this._ground.append(furniture(one, room));
    for (const group of [this._maps, this._labels, this._movers, this._names]) group.replaceChildren();
  }

  /** Lay what robots have mapped over the ground; the pictures are in cells of the maps, their rows go down. */
  chart(maps) {
    keyed(this._maps, maps.filter((one) => one.bounds), (one) => one.picture, mapPicture, () => {});
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

function mapPicture({ id, picture, bounds: [x0, y0, x1, y1], resolution, origin, map_to_room: [x, y, theta] }) {
  const cell = 100 * resolution;
  return svg("image", {
    class: "map", "data-map": id, href: picture, width: x1 - x0, height: y1 - y0, preserveAspectRatio: "none",
    transform: `translate(${100 * x} ${-100 * y}) rotate(${(-180 / Math.PI) * theta}) `
      + `translate(${100 * origin[0] + cell * x0} ${-100 * origin[1] - cell * y1}) scale(${cell})`,
  });
}

function furniture(one, room) {
  const transform = one.agent ? besideWall(box(one.polygon), box(room.outline)) : middle(box(one.polygon));
  return svg("g", { class: one.agent ? "furniture smart" : "furniture", "data-furniture": one.id },
    svg("polygon", { points: points(one.polygon) }), svg("text", { transform }, one.name));
}

/** Marks lie on a cabinet and people stand before it: its name goes to the other side of the wall, if it has one. */
function besideWall(own, room) {
  const gaps = { top: own.y0 - room.y0, right: room.x1 - own.x1, bottom: room.y1 - own.y1, left: own.x0 - room.x0 };
  const wide = own.x1 - own.x0 >= own.y1 - own.y0;
  const sides = wide ? ["top", "bottom", "right", "left"] : ["right", "left", "top", "bottom"];
  const side = sides.find((name) => gaps[name] < 40);
  const [cx, cy] = [(own.x0 + own.x1) / 2, (own.y0 + own.y1) / 2];
  const off = 17;
  switch (side) {
    case "top": return `translate(${cx} ${room.y0 - off})`;
    case "bottom": return `translate(${cx} ${room.y1 + off})`;
    case "right": return `translate(${room.x1 + off} ${cy}) rotate(90)`;
    case "left": return `translate(${room.x0 - off} ${cy}) rotate(-90)`;
    default: return `translate(${cx} ${own.y1 + 15})`;
  }
}

function middle(own) {
  return `translate(${(own.x0 + own.x1) / 2} ${(own.y0 + own.y1) / 2})`;
}

function box(polygon) {
  const xs = polygon.map(([x]) => 100 * x);
  const ys = polygon.map(([, y]) => -100 * y);
  return { x0: Math.min(...xs), x1: Math.max(...xs), y0: Math.min(...ys), y1: Math.max(...ys) };
}

function updateLabel(node, one, model) {
  move(node, one.xy);
  node.classList.toggle("stale", one.stale);
  node.classList.toggle("ghost", one.ghost);
  const held = contents(one, model).map(({ name, p }) => `${name} ${percent(p)}`).join(", ") || "nothing known";
  const weight = one.weight_g == null ? "" : `, ${Math.round(one.weight_g)} g`;
  const state = one.ghost ? " (hidden)" : one.stale ? " (its sensor is silent)" : "";
  text(node.firstElementChild, `${one.label}${weight}${state}: ${held}`);
  set(node, { "aria-label": `${one.label}${weight}${state}: ${held}` });
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
