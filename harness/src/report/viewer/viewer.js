/* Starts the viewer: reads what there is, loads what is shown, and draws when something changed. */

const manifest = JSON.parse(get("manifest").textContent);

/** Does something to the state, then draws once. */
function change(what) {
  if (!stage.about) return;
  say("");
  what();
  const count = stage.layers.length;
  state.layer = clamp(Math.floor(state.layer), [0, count - 1]);
  state.reference = clamp(Math.floor(state.reference), [0, count - 1]);
  stage.pending ??= requestAnimationFrame(() => {
    stage.pending = null;
    if (!stage.about) return;
    paint();
    showState();
    clearTimeout(stage.addressing);
    stage.addressing = setTimeout(() => keepAddress(), 150);
  });
}

function keepAddress() {
  const address = `#${writeAddress()}`;
  if (address === location.hash) return;
  stage.ownAddress = address;
  try {
    history.replaceState(null, "", address);
  } catch {
    location.replace(address);
  }
}

/** The color of a region in the picture of regions; each round of colors is darker. */
function regionColor(index) {
  const shade = 0.6 ** Math.floor((index - 1) / CATEGORIES.length);
  return index === 0 ? [40, 40, 40] : CATEGORIES[(index - 1) % CATEGORIES.length].map((level) => Math.round(shade * level));
}

/** A picture of which region each pixel belongs to. */
function pictureOfRegions(mask) {
  const linear = (level) => {
    const v = level / 255;
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  };
  const picture = new FloatImage({ ...mask, channels: 3, type: "float" }, new Uint32Array(3 * mask.raw.length));
  mask.raw.forEach((value, i) => {
    let color = regionColor(value & REGION);
    if (value & EMITTER) color = [0, 0, 0];
    else if (value & EDGE) color = color.map((level) => (level + 128) / 2);
    else if (value & HIGHLIGHT) color = color.map((level) => (level + 255) / 2);
    color.forEach((level, c) => { picture.values[3 * i + c] = linear(level); });
  });
  return picture;
}

/** Loads a case; whether it is still the one that is wanted by then. */
async function openCase(about) {
  stage.about = null;
  say("loading the images …");
  const layers = await Promise.all(about.layers.map(async ({ name, kind, image, against }) => {
    const [own, other] = await Promise.all([loadImage(image), against && loadImage(against)]);
    return { name, kind, image: kind === "regions" ? pictureOfRegions(own) : own, other, floor: about.floor ?? 1e-3 };
  }));
  const imageOf = (kind) => about.layers.find((layer) => layer.kind === kind)?.image;
  const loaded = (kind) => imageOf(kind) ? loadImage(imageOf(kind)) : null;
  const [mask, excess] = await Promise.all([loaded("regions"), loaded("excess")]);
  if (stage.wanted !== about) return false;
  Object.assign(stage, { layers, about, mask, excess, auto: new Map(), marks: [], hover: null });
  choosePainter();
  say("");
  return true;
}

function say(words) {
  get("message").textContent = words;
  get("message").hidden = words === "";
}

/** Draws with WebGL where there is one and it holds all images, else on the plain canvas. */
function choosePainter() {
  const fits = stage.gl && stage.layers.every(({ image }) => stage.gl.holds(image));
  if (!fits) stage.plain ??= new CanvasPainter(element("canvas"));
  const painter = fits ? stage.gl : stage.plain;
  if (painter === stage.painter) return;
  stage.painter = painter;
  const old = get("images");
  for (const { name, value } of old.attributes) painter.canvas.setAttribute(name, value);
  old.replaceWith(painter.canvas);
  measureStage();
}

/** Shows what the address says. */
async function goToAddress() {
  // Going back to an address of before is a choice, too.
  stage.ownAddress = null;
  const wanted = new URLSearchParams(location.hash.slice(1)).get("case");
  const about = manifest.cases.find(({ id }) => id === wanted) ?? manifest.cases[0];
  if (state.case !== about.id || !stage.about) {
    // The last choice wins, whichever is loaded first.
    stage.wanted = about;
    clearTimeout(stage.addressing);
    state.case = about.id;
    state.look = initialLook(about);
    Object.assign(state, { layer: 0, reference: Math.min(1, about.layers.length - 1) });
    try {
      if (!await openCase(about)) return;
    } catch (error) {
      if (stage.wanted === about) say(`These images cannot be shown: ${error.message}`);
      return;
    }
    fillLayers(change);
    get("case").value = about.id;
    get("note").textContent = about.note ?? "";
    get("block").hidden = !about.area;
    get("worst").hidden = !about.worst && !stage.layers.some(({ kind }) => kind === "difference");
  }
  readAddress(location.hash);
  if (state.pin) stage.marks = [state.pin];
  change(() => {});
}

function measureStage() {
  const { clientWidth, clientHeight } = get("stage");
  stage.width = clientWidth;
  stage.height = clientHeight;
  stage.ratio = stage.painter instanceof CanvasPainter ? 1 : window.devicePixelRatio || 1;
}

function start() {
  get("nojs").remove();
  const plain = new URLSearchParams(location.search).has("plain");
  stage.over = get("over");
  stage.gl = plain ? null : GlPainter.make(get("images"));
  stage.painter = stage.gl;
  choosePainter();
  // A driver that was reset, or a computer that slept.
  stage.gl?.canvas.addEventListener("webglcontextlost", () => {
    stage.gl = null;
    choosePainter();
    if (stage.about) change(() => {});
  });
  get("keys").replaceChildren(...KEYS.flatMap(([keys, what]) => [
    element("dt", {}, element("kbd", { textContent: keys })), element("dd", { textContent: what })]));
  get("case").replaceChildren(...manifest.cases.map(({ id, title }) => element("option", { value: id, textContent: title })));
  get("case").addEventListener("change", () => { location.hash = `case=${encodeURIComponent(get("case").value)}`; });
  const on = (id, what) => get(id).addEventListener("click", () => stage.about && change(what));
  for (const bar of document.querySelectorAll("header, aside")) {
    // Of a click by the mouse: the space bar is for the images again. Buttons of layers come later.
    bar.addEventListener("click", ({ detail, target }) => {
      const button = target.closest("button");
      if (detail > 0 && button && button !== get("help-button")) get("stage").focus({ preventScroll: true });
    });
  }
  for (const mode of MODES) on(`mode-${mode}`, () => { state.mode = mode; });
  on("fit", () => { state.view = null; });
  on("pixels", () => { state.view = { ...view(), zoom: 1 / stage.ratio }; });
  on("worst", goToWorst);
  on("block", goToBlock);
  get("help-button").addEventListener("click", () => get("help").showModal());
  makePanel(change);
  listen(change);
  measureStage();
  new ResizeObserver(() => {
    measureStage();
    if (stage.about) change(() => {});
  }).observe(get("stage"));
  addEventListener("hashchange", () => {
    if (location.hash !== stage.ownAddress) goToAddress();
  });
  goToAddress();
}

start();
