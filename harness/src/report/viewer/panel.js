/* The panel beside the images: what is selected, how it is shown, what the numbers are. */

const get = (id) => document.getElementById(id);

function element(name, attributes = {}, ...children) {
  const made = Object.assign(document.createElement(name), attributes);
  made.append(...children);
  return made;
}

/** Fills the controls once; `change` redraws. */
function makePanel(change) {
  const choose = (id, values, names, set) => {
    const select = get(id);
    select.replaceChildren(...values.map((value) => element("option", { value, textContent: names(value) })));
    select.addEventListener("change", () => change(() => set(select.value)));
  };
  for (const control of document.querySelectorAll("header select, aside select, aside input")) returnKeys(control);
  choose("metric", METRICS, (name) => name, (value) => { state.metric = value; toneOfMetric(); });
  choose("channel", CHANNELS, (name) => (name === "mean" ? "mean of R, G, B" : name.toUpperCase()), (value) => { state.channel = value; });
  choose("tone", TONES, (name) => TONE_NAMES[name], (value) => { lookNow().tone = value; });
  get("exposure").addEventListener("input", () => change(() => { lookNow().exposure = Number(get("exposure").value); }));
  get("auto").addEventListener("click", () => change(() => { lookNow().exposure = null; }));
}

/** Gives the keys back to the images once the mouse has changed a control. Who came to it by keys stays there. */
function returnKeys(control) {
  let byPointer = false;
  control.addEventListener("pointerdown", () => { byPointer = true; });
  control.addEventListener("keydown", () => { byPointer = false; });
  control.addEventListener("change", () => {
    if (byPointer) get("stage").focus({ preventScroll: true });
    byPointer = false;
  });
}

/** The look of the layer that is shown. */
function lookNow() {
  return state.look[stage.layers[state.layer].kind];
}

/** A difference with a sign has colors for both sides. */
function toneOfMetric() {
  Object.assign(state.look.difference, { tone: state.metric === "absolute" ? "false" : "signed", exposure: null });
}

/** The list of layers: each can be shown, or held against the one shown. */
function fillLayers(change) {
  get("layers").replaceChildren(...stage.layers.map((layer, index) => {
    const show = element("button", { type: "button", className: "show", title: `Show (${index + 1})` },
      element("kbd", { textContent: index + 1 }), ` ${layer.name}`);
    show.addEventListener("click", (event) => change(() => {
      if (event.shiftKey) state.reference = index;
      else state.layer = index;
    }));
    const against = element("button", { type: "button", className: "against", textContent: "vs", title: `Hold against it (Shift+${index + 1})` });
    against.setAttribute("aria-label", `vs ${layer.name}`);
    against.addEventListener("click", () => change(() => { state.reference = index; }));
    return element("li", {}, show, against);
  }));
}

/** Brings every control to the state. */
function showState() {
  const layer = stage.layers[state.layer];
  const settings = settingsOf(layer);
  for (const [index, item] of [...get("layers").children].entries()) {
    item.firstChild.setAttribute("aria-pressed", index === state.layer);
    item.lastChild.setAttribute("aria-pressed", index === state.reference);
  }
  for (const mode of MODES) get(`mode-${mode}`).setAttribute("aria-pressed", mode === state.mode);
  get("metric").value = state.metric;
  get("channel").value = state.channel;
  get("tone").value = settings.tone;
  get("exposure").value = settings.exposure;
  get("exposure-value").textContent = `${settings.exposure > 0 ? "+" : ""}${short(settings.exposure)} stops`;
  get("auto").setAttribute("aria-pressed", lookNow().exposure === null);
  for (const id of ["exposure", "auto", "tone", "channel"]) get(id).disabled = layer.kind === "regions";
  for (const mode of ["side", "wipe"]) get(`mode-${mode}`).disabled = stage.layers.length < 2;
  get("metric").disabled = !stage.layers.some((one) => one.kind === "difference");
  get("zoom").textContent = `${Math.round(100 * view().zoom)} %`;
  get("painter").textContent = stage.painter === stage.plain
    ? `${stage.gl ? "An image is too large for the graphics card" : "Without WebGL"}: zoomed out, pixels are left out instead of averaged.` : "";
  showLegend(layer, settings);
  showHistogram(layer, settings);
  showProbe();
}

/** Which number stands for a pixel of several channels, where colors show only one. */
function numberOf(layer, settings) {
  if (layer.image.channels === 1 || settings.channel !== "rgb" || !["false", "signed"].includes(settings.tone)) return "";
  return layer.kind === "difference" ? "; of the channel that differs most" : "; mean of R, G, B";
}

/** What a layer's values are, with their unit. */
function unitOf(layer) {
  const unit = stage.about.unit || "value";
  if (layer.kind === "excess") return "difference over its bound (1: the bound)";
  if (layer.kind !== "difference") return unit;
  if (state.metric === "relative") return "difference relative to what is expected (0.01: 1 %)";
  return `${state.metric === "absolute" ? "size of the difference" : "difference"}, ${unit}`;
}

function showLegend(layer, settings) {
  const canvas = get("legend");
  const context = canvas.getContext("2d");
  const { width, height } = canvas;
  const white = whiteOf(settings.tone);
  const limit = white * 2 ** -settings.exposure;
  let ends = [0, limit / 2, limit];
  const color = (at) => {
    if (settings.tone === "signed") return colorAt(DIVERGING, at);
    if (settings.tone === "false") return colorAt(VIRIDIS, at);
    return [0, 1, 2].map(() => 255 * CURVES[settings.tone](white * at));
  };
  if (settings.tone === "signed") ends = [-limit, 0, limit];
  else if (layer.kind === "excess" && settings.tone === "false") ends = [-1, 0, 1].map((t) => limit * 2 ** ((t * LOG_RANGE) / 2));
  for (let x = 0; x < width; x++) {
    context.fillStyle = `rgb(${color(x / (width - 1)).join(",")})`;
    context.fillRect(x, 0, 1, height);
  }
  const regions = layer.kind === "regions";
  get("legend-box").hidden = regions;
  get("region-names").hidden = !regions;
  if (regions) {
    get("region-names").replaceChildren(...stage.about.regions.map((name, index) => {
      const swatch = element("i");
      swatch.style.background = `rgb(${regionColor(index).join(",")})`;
      return element("li", {}, swatch, ` ${name}`);
    }), element("li", { textContent: "half gray: edges; half white: highlights; black: the light source, not compared" }));
  }
  ends.forEach((value, i) => { get(`legend-${i}`).textContent = digits(value, 3); });
  get("unit").textContent = `${unitOf(layer)}${numberOf(layer, settings)}`;
}

/** Bars of the histogram that is drawn; the number of bins is a multiple. */
const BARS = 48;

function showHistogram(layer, settings) {
  const regions = layer.kind === "regions";
  const counts = regions ? null : kept(layer, settings, ["metric", "channel", "tone", "exposure"], histogram);
  // Moving the image changes none of it.
  if (counts === stage.histogram) return;
  stage.histogram = counts;
  const canvas = get("histogram");
  const context = canvas.getContext("2d");
  const { width, height } = canvas;
  context.clearRect(0, 0, width, height);
  get("facts").textContent = "";
  for (const end of [0, 1, 2]) get(`axis-${end}`).textContent = "";
  if (regions) return;
  // Few bins are wide bars that touch: narrow ones of half floats are lone strokes.
  const bars = counts.map((bins) => Array.from({ length: BARS }, (_, bar) => {
    const of = bins.length / BARS;
    return bins.slice(bar * of, (bar + 1) * of).reduce((sum, n) => sum + n, 0);
  }));
  // Black pixels are many: the second largest bar sets the height.
  const highest = Math.max(...bars.map((own) => [...own].sort((a, b) => b - a)[1])) || 1;
  const colors = counts.length === 3 ? ["#e0453a", "#2fa84f", "#3b7de0"] : ["#8a93a3"];
  // Added up, three colors would be white, which a light page does not show.
  context.globalAlpha = counts.length === 3 ? 0.6 : 1;
  bars.forEach((own, c) => {
    context.fillStyle = colors[c];
    own.forEach((n, i) => {
      // What is there is seen, however little it is.
      const h = n > 0 ? Math.max(2, Math.min(1, n / highest) * height) : 0;
      context.fillRect((i * width) / BARS, height - h, width / BARS, h);
    });
  });
  const limit = whiteOf(settings.tone) * 2 ** -settings.exposure;
  let ends = settings.tone === "signed" ? [-limit, 0, limit] : [0, limit / 2, limit];
  if (layer.kind === "excess") ends = [-1, 0, 1].map((t) => limit * 2 ** ((t * LOG_RANGE) / 2));
  ends.forEach((value, i) => { get(`axis-${i}`).textContent = digits(value, 3); });
  const { least, most, sum, count, bad } = kept(layer, settings, ["metric", "channel"], factsOf);
  const words = count ? [`least ${digits(least)}`, `mean ${digits(sum / count)}`, `most ${digits(most)}`] : [];
  if (bad) words.push(`${bad} pixel${bad > 1 ? "s" : ""} not finite`);
  get("facts").textContent = words.join(" · ");
}

/** So many images are probed at most, unless they are looked at. */
const PROBED = 8;

/** The values at the probed pixel, in every layer, and which rule counts it. */
function showProbe() {
  const at = stage.hover ?? state.pin;
  const { width, height } = sizeOf();
  const rows = [];
  // Beside floats, a half has the digits of the very value: else both may read the same and still differ.
  const halves = stage.layers.every(({ kind, image }) => kind !== "image" || image.type === "half");
  if (at && at.x >= 0 && at.y >= 0 && at.x < width && at.y < height) {
    // Of many images, those that are looked at.
    const few = stage.layers.length <= PROBED;
    const looked = new Set([...panes().map(({ index }) => index), state.layer, state.reference]);
    for (const [index, layer] of stage.layers.entries()) {
      if (layer.kind === "regions" || !(few || looked.has(index))) continue;
      const values = layerValues(layer, at.x, at.y, settingsOf(layer));
      const difference = layer.kind === "difference";
      const name = difference ? `${state.metric} ${layer.name}` : layer.name;
      // A difference as 32 bits hold it, like its values.
      const words = (value) => (difference && Number.isFinite(Math.fround(value))
        ? exact(Math.fround(value), "float") : exact(value, layer.kind === "image" && !halves ? "float" : layer.image.type));
      rows.push(element("tr", {}, element("th", { scope: "rowgroup", colSpan: 3, textContent: name })),
        element("tr", {}, ...[...values].map((value) => element("td", { colSpan: values.length === 1 ? 3 : 1, textContent: words(value) }))));
    }
    get("probe-place").textContent = `(${at.x}, ${at.y})`;
    get("probe-rule").textContent = ruleAt(at);
  } else {
    get("probe-place").textContent = "none: point at the image";
    get("probe-rule").textContent = "";
  }
  get("probe").replaceChildren(...rows);
}

/** Mask flags, as harness/imaging/src/reference.rs has them. */
const EDGE = 0x8000, EMITTER = 0x4000, HIGHLIGHT = 0x2000, REGION = 0x1fff;

/** What a pixel counts for, in words. */
function ruleAt({ x, y }) {
  const { mask, excess } = stage;
  if (!mask) return "";
  const value = mask.raw[y * mask.width + x];
  if (value & EMITTER) return "The light source: not compared.";
  const region = stage.about.regions[value & REGION] ?? "";
  const words = [`${region}${value & HIGHLIGHT ? ", highlight" : ""}.`];
  if (excess) {
    const over = excess.at(x, y)[0];
    const difference = stage.layers.find((layer) => layer.kind === "difference");
    let bound = "";
    // What is further off is kept as the largest half.
    const most = over >= LARGEST_HALF;
    if (difference && over > 0 && !most) {
      const size = Math.max(...layerValues(difference, x, y, { metric: "absolute" }));
      bound = ` The bound here is about ${digits(size / over, 3)}.`;
    }
    const rule = value & EDGE ? "edge (a few percent of edges may)" : "interior and blob";
    const times = most ? `More than ${LARGEST_HALF}` : digits(over, 3);
    words.push(over <= 1 ? `Within the bound.${bound}` : `${times} times its bound: counts in ${rule}.${bound}`);
  }
  return words.join(" ");
}
