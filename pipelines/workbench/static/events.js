// One stream of events for all tabs of a browser: the tab that holds the lock listens and passes on what it hears.
const channel = "BroadcastChannel" in window ? new BroadcastChannel("tumbleline-workbench") : null;
const listeners = new Set();

export const listen = (listener) => listeners.add(listener);

function pass(message) { for (const one of listeners) one(message); }

function tell(message) { pass(message); channel?.postMessage(message); }

function open() {
  const source = new EventSource("/events");
  source.addEventListener("boot", (event) => tell({ kind: "boot", ...JSON.parse(event.data) }));
  source.addEventListener("job", (event) => tell({ kind: "job", job: JSON.parse(event.data) }));
  source.addEventListener("changed", (event) => tell({ kind: "changed", ...JSON.parse(event.data) }));
  source.onerror = () => {
    tell({ kind: "lost" });
    if (source.readyState === EventSource.CLOSED) { source.close(); setTimeout(open, 1500); }
  };
}

export function start() {
  channel?.addEventListener("message", (event) => pass(event.data));
  if (navigator.locks) navigator.locks.request("tumbleline-events", () => { open(); return new Promise(() => {}); });
  else open();
}
