// What every page does: addresses without a reload, figures, work with its progress, forms, and the line to the server.
import { ahead, draw, drawAll, forget, repaint } from "./figure.js";
import { listen, start } from "./events.js";

const main = () => document.getElementById("main");
let boot = document.body.dataset.boot, going = null, pressed = null;

// what lies under a pressed pointer is not replaced: the press would be lost
document.addEventListener("pointerdown", () => {
  pressed = new Promise((resolve) => {
    for (const kind of ["pointerup", "pointercancel"]) document.addEventListener(kind, () => setTimeout(() => { pressed = null; resolve(); }), { once: true, capture: true });
  });
}, { capture: true });

export async function go(address, { push = true, part = "", focus = false, renews = false, keep = false } = {}) {
  if (renews && going && !going.renews) return;  // a page that the user requested is loading
  going?.abort();
  const now = (going = Object.assign(new AbortController(), { renews }));
  let answer, text;
  try {
    answer = await fetch(address, { headers: { accept: "text/html", "x-part": part }, signal: now.signal });
    text = await answer.text();
  } catch (problem) {
    if (problem.name !== "AbortError") lost(true);
    return;
  } finally {
    if (going === now) going = null;
  }
  if (renews && pressed) {
    await pressed;
    if (going) return;  // the press has led elsewhere
  }
  const page = new DOMParser().parseFromString(text, "text/html");
  if (push) history.pushState(null, "", answer.redirected ? answer.url : address);
  if (page.title) document.title = page.title;  // a part of a page has none
  const wanted = part ? [...document.querySelectorAll(`[data-swap="${CSS.escape(part)}"]`)] : [];
  const fresh = part ? [...page.querySelectorAll(`[data-swap="${CSS.escape(part)}"]`)] : [];
  const place = held();
  if (part && wanted.length && wanted.length === fresh.length) {
    wanted.forEach((old, k) => { forget(old); old.replaceWith(document.adoptNode(fresh[k])); });
    if (place && !document.contains(place.element)) regain(place);
    const line = page.querySelector(".command"), shown = main().querySelector(".command");
    if (line && shown) shown.replaceWith(document.adoptNode(line));
  } else {
    const next = page.getElementById("main");
    if (!next) { location.assign(address); return; }
    forget(main());
    const kept = renews ? entered() : [];
    main().replaceWith(document.adoptNode(next));
    enter(kept);
    for (const link of document.querySelectorAll(".bar nav a")) {
      if (link.pathname === location.pathname) link.setAttribute("aria-current", "page"); else link.removeAttribute("aria-current");
    }
    if (push && !keep && !place?.submits) window.scrollTo(0, 0);
    if (place && (renews || place.submits)) regain(place); else if (focus) main().focus({ preventScroll: true });
  }
  arrived();
}

// The keyboard stays where it was: at the same field or button of the new content, at the question of a station, else at the top
// of the content. Never at the answer itself: the Enter of a scanner would give it.
function held() {
  const element = document.activeElement;
  if (!element || !main().contains(element) || element === main()) return null;
  const names = ["name", "id", "data-act", "data-answer", "data-add", "data-name", "data-finding", "href"].filter((one) => element.hasAttribute(one));
  const form = element.form?.dataset.get;
  const selector = element.tagName.toLowerCase() + names.map((one) => `[${one}="${CSS.escape(element.getAttribute(one))}"]`).join("");
  return { element, selector: names.length ? (form ? `form[data-get="${CSS.escape(form)}"] ${selector}` : selector) : "", submits: element.matches("[data-submit]") };
}

function regain({ selector }) {
  const place = document.querySelector(".question") ?? ((selector && main().querySelector(selector)) || main());
  place.focus({ preventScroll: place === main() });
}

// a page that comes anew by itself keeps what a person has entered in its fields
const FIELDS = "input:not([type=hidden]):not([type=file]), textarea";
function entered() {
  return [...main().querySelectorAll(FIELDS)].map((field, k) => ({ k, name: field.name, value: field.value, typed: field.value !== field.defaultValue, focused: field === document.activeElement }))
    .filter((one) => one.typed || one.focused);
}

function enter(kept) {
  const fields = [...main().querySelectorAll(FIELDS)];
  for (const one of kept) {
    const field = fields[one.k];
    if (!field || field.name !== one.name) continue;
    if (one.typed) field.value = one.value;
    if (one.focused) field.focus();
  }
}

function arrived() {
  drawAll(document);
  for (const place of document.querySelectorAll("[data-job-kind]")) {
    begin(place);
    if (["waiting", "running"].includes(place.dataset.jobState)) look(place.dataset.job);  // it may have ended while the page came
  }
  document.querySelector("[data-scan-field]")?.focus();
  bell();
  document.body.dataset.ready = location.pathname + location.search;
}

// --- changes -----------------------------------------------------------------------------------------------------------
// the storage belongs to this origin with its port; the cookie, which other ports get too, is not enough for a change
const PROOF = "tumbleline-change-proof";
const entering = location.hash.match(/^#change=([0-9a-f]{64})$/);
if (entering) {
  localStorage.setItem(PROOF, entering[1]);
  history.replaceState(null, "", location.pathname + location.search);
}

async function change(address, content, method = "POST") {
  const body = method === "PUT" ? content : JSON.stringify(content ?? {});
  const headers = method === "PUT" ? {} : { "content-type": "application/json" };
  const proof = localStorage.getItem(PROOF);
  if (proof) headers["x-change-proof"] = proof;
  const answer = await fetch(address, { method, body, headers });
  const text = await answer.text();
  let found = {};
  try { found = JSON.parse(text); } catch { found = { problem: text }; }
  if (!answer.ok) throw Object.assign(new Error(found.problem || text || "not done"), { status: answer.status });
  return found;
}

function say(element, text) {
  if (!element) return;
  element.textContent = text;
  element.hidden = !text;
}

// --- work --------------------------------------------------------------------------------------------------------------
async function begin(place, pressed = false) {
  const state = place.dataset.jobState;
  if (!pressed && (place.dataset.start !== "yes" || place.dataset.begun || ["failed", "stopped", "interrupted", "waiting", "running"].includes(state))) return;
  place.dataset.begun = "yes";
  try {
    const job = await change("/jobs", { kind: place.dataset.jobKind, address: place.dataset.jobAddress });
    place.dataset.job = job.id;
    if (pressed && !place.querySelector("progress")) { go(location.href, { push: false }); return; }
    jobChanged(job);
    if (["waiting", "running"].includes(job.state)) look(job.id);  // its end may have been told before its name was known here
  } catch (problem) {
    say(place.querySelector("[data-job-problem]"), problem.message);
  }
}

function jobChanged(job) {
  for (const place of document.querySelectorAll(`[data-job="${CSS.escape(job.id)}"]`)) {
    place.dataset.jobState = job.state;
    if (["done", "failed", "stopped"].includes(job.state)) { go(location.href, { push: false, renews: true }); return; }
    const bar = place.querySelector("progress"), note = place.querySelector("[data-job-note]");
    if (bar) { bar.max = job.total || 4; bar.value = job.done; }
    if (note) note.textContent = `${job.note}${job.seconds > 1 ? `, ${Math.round(job.seconds)} s` : ""}`;
  }
}

// --- the line to the server --------------------------------------------------------------------------------------------
function lost(is) { document.querySelector("[data-lost]").hidden = !is; }

listen((message) => {
  if (message.kind === "lost") lost(true);
  if (message.kind === "boot") {
    lost(false);
    if (message.boot !== boot) { boot = message.boot; go(location.href, { push: false, renews: true }); } else {
      for (const place of document.querySelectorAll("[data-job]")) if (["waiting", "running"].includes(place.dataset.jobState)) look(place.dataset.job);
    }
  }
  if (message.kind === "job") jobChanged(message.job);
  if (message.kind === "changed" && document.querySelector(`[data-live="${CSS.escape(message.what)}"]`)) {
    const had = Boolean(document.querySelector("[data-phase]"));
    if (had || !document.activeElement?.matches("input")) go(location.href, { push: false, part: had ? message.what : "", renews: true });
  }
});

async function look(id) {
  const answer = await fetch(`/jobs/${encodeURIComponent(id)}`);
  if (answer.ok) jobChanged(await answer.json()); else go(location.href, { push: false, renews: true });
}

// --- what is pressed ---------------------------------------------------------------------------------------------------
document.addEventListener("click", async (event) => {
  const one = event.target.closest("a, button, [data-drop]");
  if (!one) return;
  const { dataset } = one;
  if ("themeSwitch" in dataset) {
    const theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    document.documentElement.dataset.theme = theme;
    try { localStorage.setItem("tumbleline-theme", theme); } catch { /* a browser that keeps nothing */ }
    repaint();
  } else if ("copy" in dataset) {
    await navigator.clipboard?.writeText(dataset.copy);
    one.textContent = "Copied";
    setTimeout(() => { one.textContent = "Copy"; }, 1500);
  } else if ("bell" in dataset) {
    localStorage.setItem(BELL, localStorage.getItem(BELL) === "on" ? "off" : "on");
    bell();
    if (localStorage.getItem(BELL) === "on") ring();
  } else if ("jobStart" in dataset) begin(one.closest("[data-job-kind]"), true);
  else if ("jobStop" in dataset) change(`/jobs/${encodeURIComponent(one.closest("[data-job-kind]").dataset.job)}/stop`).then(jobChanged).catch(() => {});
  else if ("act" in dataset) act(one);
  else if ("insert" in dataset) insert(one.closest("form").elements.formula, dataset.insert);
  else if ("drop" in dataset && event.target.tagName !== "INPUT") one.querySelector("[data-file]").click();
  else if (one.tagName === "A" && one.origin === location.origin && !one.hasAttribute("download") && !one.hash && !event.ctrlKey && !event.metaKey && !event.shiftKey && event.button === 0) {
    event.preventDefault();
    go(one.href, { focus: true });
  }
});

async function act(button) {
  const problem = button.closest("section").querySelector("[data-act-problem]");
  button.disabled = true;
  try {
    const { address } = await change(button.dataset.act, { number: button.dataset.number, answer: button.dataset.answer });
    go(address);
  } catch (found) {
    if (found.status === 409) await go(location.href, { push: false });
    say(document.querySelector("[data-act-problem]") ?? problem, found.message);
    button.disabled = false;
  }
}

function insert(field, text) {
  const at = field.selectionStart ?? field.value.length;
  field.setRangeText(text, at, field.selectionEnd ?? at, "end");
  field.focus();
}

document.addEventListener("submit", async (event) => {
  const form = event.target;
  event.preventDefault();
  if (form.dataset.get) { go(addressOf(form), { focus: true }); return; }
  const problem = form.querySelector(".problem"), done = form.querySelector(".done"), button = form.querySelector("button:not([type])");
  say(problem, ""); say(done, "");
  if (button) button.disabled = true;
  try {
    const found = await change(form.dataset.post, Object.fromEntries(new FormData(form)));
    if (found.address) { go(found.address, { keep: location.pathname === new URL(found.address, location.href).pathname }); } else {
      say(done, found.done ?? "");
      if (found.shown && done) done.append(" ", Object.assign(document.createElement("a"), { href: found.shown, textContent: "Show it" }));
    }
  } catch (failed) {
    say(problem, failed.message);
  }
  if (button) button.disabled = false;
});

function addressOf(form) {
  const pairs = [...new FormData(form)].filter(([, value]) => value !== "");
  for (const field of form.querySelectorAll("[data-column]")) if (field.value) pairs.push(["columns", `${field.dataset.column}=${field.value}`]);
  const query = new URLSearchParams(pairs).toString();
  return form.dataset.get + (query ? `?${query}` : "");
}

document.addEventListener("change", (event) => {
  if (event.target.matches("[data-submit]")) event.target.form.requestSubmit();
  if (event.target.matches("[data-angles]")) for (const name of ["outer", "inner"]) event.target.form.elements[name].value = Number(event.target.selectedOptions[0].dataset[name]);
  if (event.target.matches("[data-file]") && event.target.files.length) send(event.target.closest("[data-drop]"), event.target.files[0]);
});

document.addEventListener("keydown", (event) => {
  const field = event.target;
  if (["Enter", " "].includes(event.key) && field.matches("[data-drop]")) { event.preventDefault(); field.querySelector("[data-file]").click(); }
  if (event.key !== "Enter" || !field.matches("[data-scan-field]")) return;
  event.preventDefault();  // a scanner ends each serial number with Enter
  checkScan(field);
});

async function checkScan(field) {
  const fields = [...document.querySelectorAll("[data-scan-field]")], note = field.parentElement.querySelector("[role=alert]");
  try {
    await change("/operator/scan", { ...Object.fromEntries(new FormData(field.form)), slot: field.name.slice(5) });
    say(note, "");
    field.removeAttribute("aria-invalid");
    (fields[fields.indexOf(field) + 1] ?? field.form.querySelector("button")).focus();
  } catch (problem) {
    say(note, problem.message);
    field.setAttribute("aria-invalid", "true");
    field.focus();
    field.select();
  }
}

// --- the bell ----------------------------------------------------------------------------------------------------------
const BELL = "tumbleline-bell";
let sound = null, rung = "";

function bell() {
  const on = localStorage.getItem(BELL) === "on", turn = document.querySelector("[data-turn]")?.dataset.turn ?? "";
  for (const button of document.querySelectorAll("[data-bell]")) { button.setAttribute("aria-pressed", String(on)); button.textContent = on ? "Bell on" : "Bell off"; }
  document.title = document.title.replace(/^Your turn · /, "");
  if (turn) document.title = `Your turn · ${document.title}`;
  if (turn && turn !== rung && on) ring();
  rung = turn;
}

function ring() {
  sound ??= new AudioContext();
  for (const [at, pitch] of [[0, 880], [0.25, 660], [0.5, 880]]) {
    const tone = sound.createOscillator(), loud = sound.createGain(), begin = sound.currentTime + at;
    tone.frequency.value = pitch;
    loud.gain.setValueAtTime(0.3, begin);
    loud.gain.exponentialRampToValueAtTime(0.001, begin + 0.22);
    tone.connect(loud).connect(sound.destination);
    tone.start(begin); tone.stop(begin + 0.23);
  }
  document.body.dataset.rung = String(Number(document.body.dataset.rung ?? 0) + 1);
}

document.addEventListener("pick", (event) => {
  const address = new URL(location.href);
  address.searchParams.set(event.detail.name, event.detail.value);
  if (event.detail.part) ahead(`${address.pathname}/figure/${event.detail.part}.json${address.search}`);
  go(address.pathname + address.search, { part: event.detail.part });
});

document.addEventListener("moved", async (event) => {
  const { what, name, x, y } = event.detail, form = document.querySelector(`form[data-post$="/${CSS.escape(what)}"]`);
  const problem = form.querySelector(".problem");
  say(problem, "");
  try {
    go((await change(form.dataset.post, { address: form.elements.address.value, name, x, y })).address, { keep: true });
  } catch (failed) {
    say(problem, failed.message);
  }
});

// --- files -------------------------------------------------------------------------------------------------------------
for (const kind of ["dragover", "dragleave", "drop"]) {
  document.addEventListener(kind, (event) => {
    const place = event.target.closest?.("[data-drop]");
    if (kind !== "dragleave") event.preventDefault();
    place?.classList.toggle("over", kind === "dragover");
    if (kind === "drop" && place && event.dataTransfer.files.length) send(place, event.dataTransfer.files[0]);
  });
}

async function send(place, file) {
  const problem = place.querySelector(".problem");
  say(problem, "");
  try {
    const { address } = await change(`/upload/file?name=${encodeURIComponent(file.name)}`, file, "PUT");
    go(address);
  } catch (failed) {
    say(problem, failed.message);
  }
}

window.addEventListener("popstate", () => go(location.href, { push: false }));
start();
arrived();
window.tumbleline = { draw };
