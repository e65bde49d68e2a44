// Figures: fetched when they come into sight, drawn in the colours of the theme, a click on a point changes the address.
import { arranged, dressed, rearranged, themed } from "./paint.js";

const PLOTLY = "plotly-strict-4.1.1.min.js";
let library = null;

function plotly() {
  library ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = `${document.body.dataset.static}/${PLOTLY}`;
    script.onload = () => resolve(window.Plotly);
    script.onerror = () => { library = null; reject(new Error("the drawing library was not loaded")); };
    document.head.append(script);
  });
  return library;
}

// A figure that a click will need is requested with the page part that shows it, not after it.
const comingFigures = new Map();
const sameFigure = (address) => { const { pathname, searchParams } = new URL(address, location.href); searchParams.sort(); return `${pathname}?${searchParams}`; };
const requested = (address) => fetch(address, { headers: { accept: "application/json" } });

export function ahead(address) {
  plotly().catch(() => {});
  const answer = requested(address);
  answer.catch(() => {});  // the figure asks again and says what is wrong
  comingFigures.clear();
  comingFigures.set(sameFigure(address), answer);
}

function answered(address) {
  const key = sameFigure(address), coming = comingFigures.get(key);
  comingFigures.delete(key);
  return coming ? coming.catch(() => requested(address)) : requested(address);
}

export async function draw(place) {
  if (place.dataset.busy === place.dataset.figure) return;
  place.dataset.busy = place.dataset.figure;
  place.classList.toggle("waiting", !place.dataset.drawn);
  try {
    const [library, answer] = await Promise.all([plotly(), answered(place.dataset.figure)]);
    const content = await answer.json();
    if (!answer.ok) throw new Error(content.problem || "the figure was not made");
    if (!place.isConnected) return;
    if (!place.dataset.drawn) place.replaceChildren();
    place.figure = content;
    await paint(place, library);
  } catch (problem) {
    if (place.dataset.drawn) return;  // what was drawn before stays
    place.replaceChildren(Object.assign(document.createElement("p"), { className: "note", textContent: problem.message }));
    place.style.minHeight = "0";
  } finally {
    place.classList.remove("waiting");
    delete place.dataset.busy;
    if (place.dataset.renew && place.isConnected) setTimeout(() => draw(place), 1000 * Number(place.dataset.renew));
  }
}

async function paint(place, library) {
  const style = getComputedStyle(document.documentElement), { data, config } = place.figure;
  await library.react(place, themed(data, style), dressed(arranged(place.figure), style), config);
  place.dataset.drawn = place.dataset.figure;
  place.style.minHeight = "0";  // the figure is as high as it needs to be
  if (place.dataset.drag && !place.dataset.listens) dragged(place);
  if (place.tabIndex < 0) byKeyboard(place, library);
  if (!place.dataset.pick || place.dataset.listens) return;
  place.dataset.listens = "yes";
  place.on("plotly_click", (event) => {
    const chosen = event.points.map((point) => point.customdata).find((one) => typeof one === "string");
    if (chosen) place.dispatchEvent(new CustomEvent("pick", { bubbles: true, detail: { name: place.dataset.pick, value: chosen, part: place.dataset.swapPart } }));
  });
}

// Arrow keys go from point to point in the order of their places, Enter chooses the one that is pointed at, Escape lets it go.
function byKeyboard(place, library) {
  let at = -1;
  place.tabIndex = 0;
  const heard = Object.assign(document.createElement("span"), { className: "hidden" });
  heard.setAttribute("role", "status");
  place.after(heard);
  const points = () => place._fullData.flatMap((trace, curveNumber) => (trace.mode ?? "").includes("markers") && trace.visible === true
    ? Array.from(trace.x, (x, pointNumber) => ({ curveNumber, pointNumber, x, y: trace.y[pointNumber], trace })) : [])
    .filter((one) => Number.isFinite(Number(one.y))).sort((a, b) => a.trace.xaxis.localeCompare(b.trace.xaxis) || a.x - b.x);
  place.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (event.key === "Escape") { library.Fx.unhover(place); heard.textContent = ""; }
    if (event.target !== place || (!step && event.key !== "Enter")) return;
    const all = points();
    if (!all.length) return;
    event.preventDefault();
    if (step) at = (at + step + all.length) % all.length;
    const one = all[Math.max(at, 0)], name = [one.trace.customdata?.[one.pointNumber]].find((text) => typeof text === "string");
    if (step) {
      library.Fx.hover(place, [{ curveNumber: one.curveNumber, pointNumber: one.pointNumber }], [one.trace.xaxis + one.trace.yaxis]);
      heard.textContent = one.trace.text?.[one.pointNumber] ?? `${one.trace.name}: ${Number(one.x).toPrecision(4)}, ${Number(one.y).toPrecision(4)}`;
    } else if (name && place.dataset.pick) place.dispatchEvent(new CustomEvent("pick", { bubbles: true, detail: { name: place.dataset.pick, value: name, part: place.dataset.swapPart } }));
  });
}

// A point that carries a name is taken along by the pointer; where it is dropped goes out as an event, in the plot's coordinates.
const NEAR_PX = 14;
function dragged(place) {
  place.dataset.listens = "yes";
  const axes = () => { const l = place._fullLayout, r = place.getBoundingClientRect(); return { x: l.xaxis, y: l.yaxis, left: r.left + l.xaxis._offset, top: r.top + l.yaxis._offset }; };
  const nearest = (event) => {
    const a = axes();
    let best = null, least = NEAR_PX;
    for (const trace of place._fullData) for (let k = 0; trace.customdata && k < trace.customdata.length; k += 1) {
      const far = Math.hypot(a.left + a.x.l2p(trace.x[k]) - event.clientX, a.top + a.y.l2p(trace.y[k]) - event.clientY);
      if (far < least) { least = far; best = trace.customdata[k]; }
    }
    return best;
  };
  let name = null, ring = null;
  place.addEventListener("pointermove", (event) => {
    if (name === null) { place.classList.toggle("grab", nearest(event) !== null); return; }
    const r = place.getBoundingClientRect();
    ring.style.translate = `${event.clientX - r.left}px ${event.clientY - r.top}px`;
  }, { capture: true });
  place.addEventListener("pointerdown", (event) => {
    name = event.button === 0 ? nearest(event) : null;
    if (name === null) return;
    event.preventDefault(); event.stopPropagation();
    place.setPointerCapture(event.pointerId);
    ring = Object.assign(document.createElement("span"), { className: "ring", textContent: name });
    const r = place.getBoundingClientRect();
    ring.style.translate = `${event.clientX - r.left}px ${event.clientY - r.top}px`;
    place.append(ring);
  }, { capture: true });
  place.addEventListener("mousedown", (event) => { if (name !== null) { event.preventDefault(); event.stopPropagation(); } }, { capture: true });
  const end = (event) => {
    if (name === null) return;
    const a = axes(), taken = name;
    ring.remove(); name = null;
    if (event.type !== "pointerup") return;
    place.dispatchEvent(new CustomEvent("moved", { bubbles: true, detail: { what: place.dataset.drag, name: taken, x: a.x.p2l(event.clientX - a.left), y: a.y.p2l(event.clientY - a.top) } }));
  };
  place.addEventListener("pointerup", end, { capture: true });
  place.addEventListener("pointercancel", end, { capture: true });
}

const seen = new IntersectionObserver((entries) => {
  for (const one of entries) if (one.isIntersecting) { seen.unobserve(one.target); draw(one.target); }
}, { rootMargin: "200px" });

export function drawAll(root) {
  for (const place of root.querySelectorAll("[data-figure]")) if (!place.dataset.drawn) seen.observe(place);
}

export function forget(root) {
  if (!window.Plotly) return;
  for (const place of root.querySelectorAll("[data-drawn]")) window.Plotly.purge(place);
}

rearranged(repaint);
export async function repaint() {
  if (!library) return;
  const loaded = await library;
  for (const place of document.querySelectorAll("[data-drawn]")) await paint(place, loaded);
}
