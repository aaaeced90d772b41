// Places and probabilities in plain words.

/** The slices of a pie as [{words, p, label}], the largest first; slices that `say` calls the same are one. */
export function places(model, distribution, say = place) {
  const sums = new Map();
  for (const slice of [...distribution].sort((a, b) => b.p - a.p)) {
    const words = say(model, slice);
    const known = sums.get(words);
    if (known) known.p += slice.p;
    else sums.set(words, { words, p: slice.p, label: slice.label });
  }
  return [...sums.values()].sort((a, b) => b.p - a.p);
}

/** "in Cabinet A", "on the floor", "held by the person", ... */
export function place(model, slice) {
  const furniture = model.furniture.get(slice.furniture ?? "")?.name;
  const hidden = slice.ghost ? ", hidden" : "";
  switch (slice.kind) {
    case "cabinet": return `in ${furniture ?? slice.label}${hidden}`;
    case "floor": return `on the floor${hidden}`;
    case "table": return `${furniture ? `on ${furniture}` : "put down by a robot"}${hidden}`;
    case "robot": return "in the robot's hand";
    case "mover": return `with ${mover(model, slice.label)}`;
    default: return "outside";
  }
}

/** The same as a name: "Cabinet A", "floor", "person", ... */
export function placeName(model, slice) {
  const furniture = model.furniture.get(slice.furniture ?? "")?.name;
  const hidden = slice.ghost ? " (hidden)" : "";
  switch (slice.kind) {
    case "cabinet": return `${furniture ?? slice.label}${hidden}`;
    case "floor": return `floor${hidden}`;
    case "table": return `${furniture ?? "put down"}${hidden}`;
    case "robot": return "robot's hand";
    case "mover": return mover(model, slice.label).replace("the ", "");
    default: return "outside";
  }
}

/** "the person", or "person 2" where there are several. */
export function mover(model, label) {
  const held = model.movers.get(label);
  if (held === undefined) return "somebody";
  const robot = model.isRobot(held);
  const kin = robot ? model.robots() : model.people();
  const kind = robot ? "robot" : "person";
  return kin.length === 1 ? `the ${kind}` : `${kind} ${kin.indexOf(held) + 1}`;
}

/** "50 %", "> 99 %", "< 1 %". */
export function percent(p) {
  if (p >= 0.995) return p > 0.99995 ? "100 %" : "> 99 %";
  if (p < 0.005) return "< 1 %";
  return `${Math.round(100 * p)} %`;
}

/** The pie of one object in one sentence. */
export function sentence(model, distribution) {
  const named = places(model, distribution).filter(({ p }) => p >= 0.005);
  if (named.length === 0) return "nowhere known";
  return named.map(({ words, p }) => `${words} ${percent(p)}`).join(", ");
}

/** "12 seconds", "5 minutes", "3 hours". */
export function duration(seconds) {
  for (const [unit, size] of [["day", 86400], ["hour", 3600], ["minute", 60]]) {
    if (seconds >= 2 * size) return `${Math.floor(seconds / size)} ${unit}s`;
  }
  const whole = Math.max(0, Math.round(seconds));
  return `${whole} second${whole === 1 ? "" : "s"}`;
}

/** Time of day of an RFC 3339 time, as the viewer's clock shows it. */
export function clock(time) {
  return new Date(time).toLocaleTimeString(undefined, { hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" });
}
