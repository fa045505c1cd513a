/* What is shown, and the same in the page's address. */

const MODES = ["one", "side", "wipe"];
const EXPOSURES = [-20, 20];
const ZOOMS = [0.02, 256];

/** Everything that the address holds. `look` has one entry for each kind of layer. */
const state = {
  case: "",
  /** The layer that is shown, and the one that it is held against; indices. */
  layer: 0,
  reference: 1,
  mode: "one",
  /** The place of the wipe's edge, 0 to 1. */
  wipe: 0.5,
  metric: "signed",
  channel: "rgb",
  look: {},
  /** The pixel in the middle of a pane, and the size of a pixel in CSS pixels; null fits the image in. */
  view: null,
  /** The pixel that the probe stays on, or null. */
  pin: null,
};

/** The looks that a case begins with: that of the report's pictures, if it is of a report. Exposures that are null are
    found from the values. */
function initialLook(about) {
  return {
    image: { tone: about.exposure === undefined ? "srgb" : "reinhard", exposure: about.exposure ?? null },
    difference: { tone: "signed", exposure: null },
    excess: { tone: "false", exposure: 0 },
    regions: { tone: "srgb", exposure: 0 },
  };
}

const clamp = (value, [least, most]) => Math.min(Math.max(value, least), most);

const short = (value) => String(Number(value.toFixed(3)));

/** The address of what is shown, without `#`. */
function writeAddress() {
  const parts = [
    ["case", state.case],
    ["layer", state.layer + 1],
    ["against", state.reference + 1],
    ["mode", state.mode],
    ["metric", state.metric],
    ["channel", state.channel],
    ["wipe", short(state.wipe)],
  ];
  for (const [kind, { tone, exposure }] of Object.entries(state.look)) {
    if (kind !== "regions") parts.push([kind, `${tone},${exposure === null ? "auto" : short(exposure)}`]);
  }
  if (state.view) parts.push(["view", [state.view.x, state.view.y, state.view.zoom].map(short).join(",")]);
  if (state.pin) parts.push(["pixel", `${state.pin.x},${state.pin.y}`]);
  return parts.map(([name, value]) => `${name}=${encodeURIComponent(value).replaceAll("%2C", ",")}`).join("&");
}

/** Takes over what an address says and makes sense. */
function readAddress(text) {
  const given = new URLSearchParams(text.replace(/^#/, ""));
  const oneOf = (name, all) => (all.includes(given.get(name)) ? given.get(name) : null);
  const numbers = (name, count) => {
    const values = (given.get(name) ?? "").split(",").map(Number);
    return given.has(name) && values.length === count && values.every(Number.isFinite) ? values : null;
  };
  const index = (name) => (numbers(name, 1)?.[0] ?? NaN) - 1;
  state.mode = oneOf("mode", MODES) ?? state.mode;
  state.metric = oneOf("metric", METRICS) ?? state.metric;
  state.channel = oneOf("channel", CHANNELS) ?? state.channel;
  if (Number.isInteger(index("layer"))) state.layer = index("layer");
  if (Number.isInteger(index("against"))) state.reference = index("against");
  const wipe = numbers("wipe", 1);
  if (wipe) state.wipe = clamp(wipe[0], [0, 1]);
  for (const [kind, look] of Object.entries(state.look)) {
    const [tone, exposure] = (given.get(kind) ?? "").split(",");
    if (kind === "regions" || !TONES.includes(tone)) continue;
    look.tone = tone;
    if (exposure === "auto") look.exposure = null;
    else if (Number.isFinite(parseFloat(exposure))) look.exposure = clamp(parseFloat(exposure), EXPOSURES);
  }
  const view = numbers("view", 3);
  state.view = view ? { x: view[0], y: view[1], zoom: clamp(view[2], ZOOMS) } : null;
  const pixel = numbers("pixel", 2);
  state.pin = pixel ? { x: Math.floor(pixel[0]), y: Math.floor(pixel[1]) } : null;
}
