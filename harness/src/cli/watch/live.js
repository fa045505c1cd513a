"use strict";
/* The live view: a camera that mouse, fingers and keys move, a realtime picture that follows it at once, and an offline
   picture that follows when it rests. Pixels come as 16-bit floats; exposure is applied here. */

const live = {
  /** Tells this page from others of the same watch. */
  viewer: crypto.getRandomValues(new Uint32Array(1))[0],
  panel: document.getElementById("live"),
  scenes: [],
  camera: null,
  /** What each picture shows, and how its questions stand. */
  views: {},
  libraries: 0,
  /** Whether a save is being checked, which needs the cores. */
  checking: true,
  /** Bytes of the screen by the bits of a half, for red and blue, and for green. */
  tables: [new Uint8Array(65536), new Uint8Array(65536)],
};
const control = (name) => document.getElementById(name);
/** Questions on their way at a time: while one picture travels, the next is drawn. */
const REALTIME_AT_A_TIME = 2;
/** The camera comes so many times nearer than the scene's, and goes so many times further away. */
const FAR = 100;
/** So long after the last move the offline picture begins [ms]. */
const REST = 200;
/** Samples per pixel of one offline picture after the other. */
const SAMPLES = [1, 4, 16, 64];

for (const path of ["realtime", "offline"]) {
  const figure = document.getElementById(path);
  const canvas = figure.querySelector("canvas");
  live.views[path] = {
    figure, canvas, context: canvas.getContext("2d"), problem: figure.querySelector(".problem"), about: figure.querySelector("span"),
    picture: null, stopped: false, asked: 0, answered: 0, under: 0, dirty: false, times: [], abort: null,
  };
}

/* ---- vectors */
const sub = (a, b) => a.map((x, i) => x - b[i]);
const add = (a, b) => a.map((x, i) => x + b[i]);
const scale = (a, s) => a.map((x) => x * s);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = (a) => scale(a, 1 / (Math.hypot(...a) || 1));
/** Turns `v` about the unit vector `axis` (Rodrigues). */
const turn = (v, axis, angle) => {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(scale(v, c), scale(cross(axis, v), s)), scale(axis, dot(axis, v) * (1 - c)));
};

/* ---- the camera */
function orbit(dx, dy) {
  const { eye, at, up } = live.camera;
  const pole = unit(up);
  let offset = turn(sub(eye, at), pole, -dx);
  const right = unit(cross(pole, offset));
  // Not over the pole, where right and left would change places.
  const height = Math.acos(Math.min(1, Math.max(-1, dot(unit(offset), pole))));
  const angle = Math.min(Math.PI - 0.05, Math.max(0.05, height - dy)) - height;
  offset = turn(offset, right, angle);
  live.camera.eye = add(at, offset);
  moved();
}

/** Moves by shares of the picture's height. */
function pan(dx, dy) {
  const { eye, at, up, fov_y_deg: fov } = live.camera;
  const forward = sub(at, eye);
  const right = unit(cross(forward, up));
  const above = unit(cross(right, forward));
  const height = 2 * Math.hypot(...forward) * Math.tan(fov * Math.PI / 360);
  const by = add(scale(right, -dx * height), scale(above, dy * height));
  Object.assign(live.camera, { eye: add(eye, by), at: add(at, by) });
  moved();
}

/** Comes nearer or goes away, within what a camera can be: too near, eye and target are the same number. */
function zoom(factor) {
  const { eye, at } = live.camera;
  const own = sceneNow().camera;
  const usual = Math.hypot(...sub(own.eye, own.at));
  const offset = sub(eye, at);
  const now = Math.hypot(...offset);
  const wanted = Math.min(Math.max(now * factor, usual / FAR), usual * FAR);
  live.camera.eye = add(at, scale(offset, wanted / now));
  moved();
}

function reset() {
  const scene = sceneNow();
  if (!scene) return;
  live.camera = structuredClone(scene.camera);
  again();
}

const sceneNow = () => live.scenes.find((scene) => scene.name === control("scene").value);

/* ---- questions */
function address(path, spp) {
  const { eye, at, up, fov_y_deg: fov } = live.camera;
  const shadows = control(path === "realtime" ? "map" : "shadows").checked ? 1 : 0;
  const camera = [...eye, ...at, ...up, fov].map((value) => Number(value.toPrecision(7))).join(",");
  return `frame?path=${path}&scene=${control("scene").value}&shadows=${shadows}&spp=${spp}&viewer=${live.viewer}&camera=${camera}`;
}

/** Asks for a picture and shows it, or why there is none; whether there is one. The newest answer wins. */
async function ask(view, path, spp, signal) {
  const number = ++view.asked;
  const answer = await fetch(address(path, spp), { signal });
  if (answer.status === 409) {
    const words = await answer.text();
    if (signal.aborted || number < view.answered) return false;
    view.answered = number;
    view.stopped = true;
    view.problem.textContent = words;
    view.problem.hidden = false;
    view.about.textContent = "";
    return false;
  }
  // Given up, though it is still wanted here: it is asked again.
  if (answer.status === 204 && !signal.aborted) {
    if (path === "realtime") view.dirty = true;
    else restLater();
  }
  if (answer.status !== 200) return false;
  const bytes = await answer.arrayBuffer();
  if (signal.aborted || number < view.answered) return false;
  view.answered = number;
  view.stopped = false;
  const head = new DataView(bytes);
  view.picture = {
    width: head.getUint32(0, true), height: head.getUint32(4, true), seconds: head.getFloat32(8, true), halves: new Uint16Array(bytes, 12),
  };
  view.problem.hidden = true;
  paint(view);
  return true;
}

/** The realtime picture: the next is asked for as soon as there is room, if the camera is elsewhere by then. */
function draw() {
  const view = live.views.realtime;
  if (!view.dirty || view.stopped || view.under >= REALTIME_AT_A_TIME || !live.panel.open) return;
  view.dirty = false;
  view.under++;
  const { signal } = view.abort ??= new AbortController();
  ask(view, "realtime", 1, signal).then((shown) => { if (shown) tellRate(view); }).catch(gone).finally(() => {
    // Of a question that was given up, nothing is under way any more.
    if (signal.aborted) return;
    view.under--;
    draw();
  });
}

/** The offline picture, better and better once nothing is being checked. */
async function refine() {
  const view = live.views.offline;
  view.abort?.abort();
  if (view.stopped || !live.panel.open || !live.camera) return;
  const abort = view.abort = new AbortController();
  const samples = SAMPLES.slice(0, live.checking ? 1 : Number(control("spp").value) + 1);
  for (const spp of samples) {
    if (!view.picture) view.about.textContent = "first picture";
    if (!await ask(view, "offline", spp, abort.signal)) return;
    view.about.textContent = `${spp} sample${spp > 1 ? "s" : ""} per pixel, ${view.picture.seconds.toFixed(2)} s`;
    view.figure.dataset.spp = spp;
  }
}

const gone = () => {}; // `watch.js` says that the watch has ended; a question that was given up is no error.

let rest = 0;
function moved() {
  if (!live.camera) return;
  live.views.realtime.dirty = true;
  draw();
  live.views.offline.abort?.abort();
  restLater();
}

function restLater() {
  clearTimeout(rest);
  rest = setTimeout(() => refine().catch(gone), REST);
}

/** Something other than the camera changed: answers to what was asked before are nothing, and who had failed is asked
    again. */
function again() {
  for (const view of Object.values(live.views)) {
    view.abort?.abort();
    Object.assign(view, { stopped: false, under: 0, abort: null });
  }
  moved();
}

/** Is told by `watch.js` what goes on. */
function tellLive({ stage, libraries, fresh }) {
  const changed = live.checking !== (stage === "running");
  live.checking = stage === "running";
  for (const { figure } of Object.values(live.views)) figure.classList.toggle("earlier", !fresh);
  // A new question ends the one before: a check has the cores for itself.
  if (changed) refine().catch(gone);
  if (libraries === live.libraries) return;
  live.libraries = libraries;
  again();
}

/* ---- pixels */
function paint(view) {
  const { width, height, halves } = view.picture;
  const { canvas, context } = view;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const [table, green] = live.tables;
  const image = context.createImageData(width, height);
  const { data } = image;
  for (let from = 0, to = 0; from < halves.length; from += 3, to += 4) {
    data[to] = table[halves[from]];
    data[to + 1] = green[halves[from + 1]];
    data[to + 2] = table[halves[from + 2]];
    data[to + 3] = 255;
  }
  context.putImageData(image, 0, 0);
  view.figure.dataset.frames = Number(view.figure.dataset.frames ?? 0) + 1;
}

/** What is no number shows as magenta. */
function expose() {
  const stops = Number(control("exposure").value);
  control("stops").textContent = `${stops > 0 ? "+" : ""}${stops} EV`;
  const gain = 2 ** stops;
  for (let bits = 0; bits < 65536; bits++) {
    const [exponent, mantissa] = [(bits >> 10) & 31, bits & 1023];
    const size = exponent === 0 ? mantissa * 2 ** -24 : exponent === 31 ? (mantissa ? NaN : Infinity) : (1 + mantissa / 1024) * 2 ** (exponent - 15);
    const linear = Math.min(1, (bits & 0x8000 ? 0 : size) * gain);
    const encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
    const nan = exponent === 31 && mantissa !== 0;
    live.tables[0][bits] = nan ? 255 : Math.round(255 * encoded);
    live.tables[1][bits] = nan ? 0 : live.tables[0][bits];
  }
  for (const view of Object.values(live.views)) if (view.picture) paint(view);
}

function tellRate(view) {
  const now = performance.now();
  const { times } = view;
  if (times.length && now - times[times.length - 1] > 500) times.length = 0;
  times.push(now);
  if (times.length > 20) times.shift();
  const rate = times.length > 3 ? `${(1000 * (times.length - 1) / (now - times[0])).toFixed(0)} frames/s, ` : "";
  view.about.textContent = `${rate}${(1000 * view.picture.seconds).toFixed(0)} ms to draw`;
}

/* ---- mouse, fingers, keys */
for (const { canvas } of Object.values(live.views)) {
  const pointers = new Map();
  const middle = () => {
    const all = [...pointers.values()];
    const [a, b] = [all[0], all[all.length - 1]];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!pointers.has(event.pointerId) || !live.camera) return;
    const before = middle();
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const after = middle();
    const height = canvas.clientHeight;
    const [dx, dy] = [(after.x - before.x) / height, (after.y - before.y) / height];
    if (pointers.size > 1 || event.shiftKey || event.buttons & 6) pan(dx, dy);
    else orbit(Math.PI * dx, Math.PI * dy);
    if (before.apart > 0 && after.apart > 0) zoom(before.apart / after.apart);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (live.camera) zoom(Math.exp(event.deltaY * 0.0015));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = arrows[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey || !live.camera) return;
    if (step && event.shiftKey) pan(-0.05 * step[0], -0.05 * step[1]);
    else if (step) orbit(-0.1 * step[0], -0.1 * step[1]);
    else if (event.key === "+" || event.key === "=") zoom(0.9);
    else if (event.key === "-") zoom(1 / 0.9);
    else if (event.key === "r") reset();
    else return;
    event.preventDefault();
  });
}

control("scene").addEventListener("change", reset);
control("map").addEventListener("change", again);
control("shadows").addEventListener("change", again);
control("reset").addEventListener("click", reset);
control("exposure").addEventListener("input", expose);
control("spp").addEventListener("input", () => {
  control("samples").textContent = SAMPLES[Number(control("spp").value)];
  again();
});
live.panel.addEventListener("toggle", again);

expose();
fetch("scenes").then((answer) => answer.json()).then((scenes) => {
  live.scenes = scenes;
  for (const { name } of scenes) control("scene").append(new Option(name));
  reset();
}).catch(gone);
