// What the page knows of the room, kept up to date by frames.

export class Model {
  constructor(room) {
    this.room = room;
    this.at = null;
    this.objects = new Map();
    this.labels = new Map();
    this.movers = new Map();
    this.furniture = new Map(room.furniture.map((one) => [one.id, one]));
    this.sensors = new Map(room.sensors.map((one) => [one.agent, one]));
    this.synonyms = new Map();
  }

  /** Take a snapshot or state frame. */
  apply(frame) {
    if (frame.type === "snapshot") {
      this.objects.clear();
      this.labels.clear();
      this.movers.clear();
    }
    this.at = frame.at;
    for (const one of frame.objects ?? []) this.objects.set(one.tag, one);
    for (const one of frame.labels ?? []) this.labels.set(one.label, one);
    for (const one of frame.movers ?? []) this.movers.set(one.label, one);
    for (const tag of frame.objects_gone ?? []) this.objects.delete(tag);
    for (const label of frame.labels_gone ?? []) this.labels.delete(label);
    for (const label of frame.movers_gone ?? []) this.movers.delete(label);
  }

  /** True for the body of a robot: the agent that reports it is a robot's. */
  isRobot(mover) {
    const agent = mover.agent ?? agentOf(mover.label);
    return (this.sensors.get(agent)?.kind ?? "").toLowerCase().startsWith("robot");
  }

  /** People and robots in a fixed order, so that "person 2" stays person 2 while both are there. */
  people() {
    return this._sorted((mover) => !this.isRobot(mover));
  }

  robots() {
    return this._sorted((mover) => this.isRobot(mover));
  }

  _sorted(keep) {
    return [...this.movers.values()].filter(keep).sort((a, b) => (a.label < b.label ? -1 : 1));
  }
}

/** The agent in a label's name: labels are `agent/n`. */
export function agentOf(label) {
  return label.slice(0, label.lastIndexOf("/"));
}
