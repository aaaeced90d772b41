// Calls of the HTTP interface. Every path is written here.

/** An answer that is an error; `status` is that of HTTP, the message the server's own words. */
export class Refused extends Error {
  constructor(status, message) {
    super(message);
    this.status = status;
  }
}

export const rooms = () => pages("/v1/rooms?limit=200");
export const room = (id) => get(`/v1/rooms/${encodeURIComponent(id)}`);
export const objects = (id) => pages(`/v1/objects?limit=200&room=${encodeURIComponent(id)}`);
export const search = async (words) => (await get(`/v1/objects?limit=5&q=${encodeURIComponent(words)}`)).items;
export const location = (tag) => get(`/v1/objects/${encodeURIComponent(tag)}/location`);
/** The newest version of each map of a room whose place in the room is known. */
export async function maps(id) {
  const found = await pages(`/v1/maps?limit=200&room=${encodeURIComponent(id)}`);
  const placed = found.filter((one) => one.version > 0 && one.map_to_room);
  return Promise.all(placed.map(async (one) => {
    const path = `/v1/maps/${encodeURIComponent(one.id)}`;
    const { bounds } = await get(`${path}/versions/${one.version}`);
    return { ...one, bounds, picture: `${path}.png?version=${one.version}` };
  }));
}
export const login = (key) => call("/v1/login", {
  method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ key }),
});

const get = (path) => call(path, {});

async function pages(path) {
  const items = [];
  let cursor = null;
  do {
    const page = await get(cursor === null ? path : `${path}&cursor=${encodeURIComponent(cursor)}`);
    items.push(...page.items);
    cursor = page.next_cursor;
  } while (cursor);
  return items;
}

async function call(path, options) {
  const answer = await fetch(path, { headers: { Accept: "application/json" }, ...options });
  if (answer.ok) return answer.json();
  let words = `${answer.status} ${answer.statusText}`;
  try {
    words = (await answer.json()).detail || words;
  } catch {
    // no problem body: the status must do
  }
  throw new Refused(answer.status, words);
}
