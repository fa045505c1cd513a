/* From numbers to colors. The shader in gl.js does the same. */

/** Stops of viridis (matplotlib, CC0): lightness rises evenly, also for the color-blind. */
const VIRIDIS = stops("440154 482475 414487 355f8d 2a788e 21918c 22a884 44bf70 7ad151 bddf26 fde725");
/** ColorBrewer's RdBu: blue is less, white equal, red more. */
const DIVERGING = stops("0571b0 92c5de f7f7f7 f4a582 ca0020");
/** Colors of regions (Okabe and Ito 2008). */
const CATEGORIES = stops("56b4e9 e69f00 009e73 f0e442 0072b2 d55e00 cc79a7 999999");
/** What is not a number, or infinite. */
const MAGENTA = [255, 0, 255];
/** A logarithmic scale shows so many powers of two, the value 1 in the middle. */
const LOG_RANGE = 8;

function stops(text) {
  return text.split(" ").map((hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16)));
}

/** The color of a position in [0, 1] on a map. */
function colorAt(map, position) {
  const at = Math.min(Math.max(position, 0), 1) * (map.length - 1);
  const below = Math.min(Math.floor(at), map.length - 2);
  return map[below].map((from, c) => Math.round(from + (at - below) * (map[below + 1][c] - from)));
}

/** A map as 256 RGBA pixels. */
function colorTable(map) {
  const table = new Uint8Array(1024);
  for (let i = 0; i < 256; i++) table.set([...colorAt(map, i / 255), 255], 4 * i);
  return table;
}

const srgb = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
/** What Reinhard's curve shows as white, as in the pictures of a report (harness/src/imaging/pictures.rs). */
const WHITE = 8;
const CURVES = {
  srgb,
  gamma: (v) => v ** (1 / 2.2),
  reinhard: (v) => srgb((v * (1 + v / WHITE ** 2)) / (1 + v)),
};
/** What a way to show values has for white. */
const whiteOf = (tone) => (tone === "reinhard" ? WHITE : 1);

/** The channels that can be shown. */
const CHANNELS = ["rgb", "r", "g", "b", "mean"];
/** How a difference is measured. */
const METRICS = ["signed", "absolute", "relative"];
/** How values become colors. */
const TONES = ["srgb", "gamma", "false", "signed", "reinhard"];
const TONE_NAMES = { srgb: "sRGB", gamma: "gamma 2.2", false: "false color", signed: "blue to red", reinhard: "Reinhard curve" };

/** The single number that a layer shows of a pixel: one channel, the mean of all, or of a difference in all channels the
    one that differs most, with its sign, since opposite signs would cancel in a mean. */
function pick(values, channel, kind) {
  if (values.length === 1) return values[0];
  const index = CHANNELS.indexOf(channel) - 1;
  if (index >= 0 && index < 3) return values[index];
  if (kind === "difference" && channel === "rgb") {
    let most = values[0];
    for (const value of values) if (!(Math.abs(value) <= Math.abs(most))) most = value;
    return most;
  }
  return (values[0] + values[1] + values[2]) / 3;
}

/** How far two values are apart; as for `umbra compare`, equal infinities and NaN twice are not. */
function apart(a, b, metric, floor) {
  if (a === b || (a !== a && b !== b)) return 0;
  const d = a - b;
  if (metric === "absolute") return Math.abs(d);
  return metric === "relative" ? d / Math.max(b, floor) : d;
}

/** The values that a layer shows at a pixel. */
function layerValues(layer, x, y, settings) {
  const a = [...layer.image.at(x, y)];
  if (layer.kind !== "difference") return a;
  const b = layer.other.at(x, y);
  return a.map((value, c) => apart(value, b[c], settings.metric, layer.floor));
}

/** The color, 8 bits a channel, of values as a layer shows them. */
function shade(values, layer, settings) {
  if (!values.every(Number.isFinite)) return MAGENTA;
  const gain = 2 ** settings.exposure;
  const tone = settings.tone;
  if (tone === "false" || tone === "signed") {
    const value = pick(values, settings.channel, layer.kind) * gain;
    if (tone === "signed") return colorAt(DIVERGING, 0.5 + 0.5 * value);
    if (layer.kind === "excess") return colorAt(VIRIDIS, 0.5 + Math.log2(Math.max(value, 1e-9)) / LOG_RANGE);
    return colorAt(VIRIDIS, value);
  }
  const one = settings.channel === "rgb" && values.length >= 3 ? null : pick(values, settings.channel, layer.kind);
  return [0, 1, 2].map((c) => {
    const value = Math.min(Math.max((one ?? values[c]) * gain, 0), whiteOf(tone));
    return Math.round(255 * CURVES[tone](value));
  });
}
