// The live connection: frames as they come, reconnecting by cursor for as long as the page is open.

const LONGEST_PAUSE_MS = 10_000;
const CODES_OF_KEYS = new Set([4401, 4403]);

/**
 * Follow one room. `on.frame(frame)` for snapshots and states, `on.state(name, detail)` with name "connecting", "live",
 * "lost" or "refused". Returns a function that ends it.
 */
export function follow(room, on) {
  let socket = null;
  let timer = null;
  let cursor = null;
  let failures = 0;
  let ended = false;

  function connect() {
    on.state(failures === 0 ? "connecting" : "lost");
    const query = new URLSearchParams({ room, with_events: "false" });
    if (cursor !== null) query.set("cursor", cursor);
    const scheme = window.location.protocol === "https:" ? "wss" : "ws";
    let refusal = null;
    socket = new WebSocket(`${scheme}://${window.location.host}/v1/live?${query}`);
    socket.onmessage = (message) => {
      const frame = JSON.parse(message.data);
      if (frame.type === "error") {
        refusal = frame;
        return;
      }
      if (frame.type !== "snapshot" && frame.type !== "state") return;
      cursor = frame.cursor;
      failures = 0;
      on.state("live");
      on.frame(frame);
    };
    socket.onclose = (close) => {
      if (ended) return;
      failures += 1;
      if (CODES_OF_KEYS.has(close.code) || refusal?.status === 401 || refusal?.status === 403) {
        on.state("refused", refusal?.detail ?? close.reason);
        return;
      }
      on.state("lost", refusal?.detail);
      const pause = Math.min(LONGEST_PAUSE_MS, 250 * 2 ** Math.min(failures, 6));
      timer = setTimeout(connect, pause * (0.5 + Math.random() / 2));
    };
  }

  connect();
  return () => {
    ended = true;
    clearTimeout(timer);
    socket.close();
  };
}
