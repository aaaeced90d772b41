// The marks of the paper's figure 8, on the plan and in the legend. One unit is a centimetre.
//
// filled circle: in a cabinet; square: on the floor; small circle: held by a robot; hollow circle: put down by a robot.

import { svg } from "./svg.js";

/** The shape of a label of this kind in this colour, centred on the origin. */
export function mark(kind, colour, putByRobot = false) {
  if (kind === "floor") return svg("rect", { class: "mark", x: -11, y: -11, width: 22, height: 22, fill: colour });
  if (kind === "robot") return svg("circle", { class: "mark", r: 8, fill: colour });
  if (kind === "table" || putByRobot) {
    // The outline is drawn below the coloured ring so that light colours are seen on light ground.
    return svg("g", {},
      svg("circle", { class: "ring-edge", r: 10.5, fill: "none" }),
      svg("circle", { class: "ring", r: 10.5, fill: "none", stroke: colour }));
  }
  return svg("circle", { class: "mark", r: 11, fill: colour });
}

/** A person seen from the front: head and shoulders on a disc in the person's colour. */
export function person(colour) {
  return svg("g", { class: "icon" },
    svg("circle", { class: "disc", r: 26, fill: colour }),
    svg("circle", { class: "figure", cy: -8, r: 8 }),
    svg("path", { class: "figure", d: "M-15 16c0-12 6-16 15-16s15 4 15 16z" }));
}

/** A robot: its head with two eyes on a disc; `theta` (radians, counter-clockwise) shows where it looks. */
export function robot(colour, theta) {
  const icon = svg("g", { class: "icon" });
  if (theta !== null && theta !== undefined) {
    icon.append(svg("path", {
      class: "heading", d: "M34 0l-12-8v16z", transform: `rotate(${(-theta * 180) / Math.PI})`,
    }));
  }
  icon.append(
    svg("circle", { class: "disc", r: 26, fill: colour }),
    svg("path", { class: "antenna", d: "M0-12v-8" }),
    svg("circle", { class: "figure", cy: -20, r: 2.6 }),
    svg("rect", { class: "figure", x: -15, y: -12, width: 30, height: 22, rx: 6 }),
    svg("circle", { class: "eye", cx: -6, cy: -3, r: 3.2 }),
    svg("circle", { class: "eye", cx: 6, cy: -3, r: 3.2 }),
    svg("rect", { class: "figure", x: -10, y: 13, width: 20, height: 5, rx: 2.5 }));
  return icon;
}
