/* What can be said of values: exposure, histogram, words. */

/** At most so many pixels are looked at for an exposure or a histogram. */
const SAMPLES = 120000;
/** Bins of a histogram. */
const BINS = 96;

/** Calls back with the values of every `step`th pixel of a layer in rows and columns. The array is the same each time. */
function forPixels(layer, { metric }, step, see) {
  const { width, height, channels, values } = layer.image;
  const others = layer.kind === "difference" ? layer.other.values : null;
  const shown = new Float64Array(channels);
  for (let y = 0; y < height; y += step) {
    for (let x = 0; x < width; x += step) {
      const from = (y * width + x) * channels;
      for (let c = 0; c < channels; c++) {
        const value = values[from + c];
        shown[c] = others ? apart(value, others[from + c], metric, layer.floor) : value;
      }
      see(shown, x, y);
    }
  }
}

/** The step between pixels that are spread evenly over a layer. */
function sampleStep({ width, height }) {
  return Math.max(1, Math.ceil(Math.sqrt((width * height) / SAMPLES)));
}

const areFinite = (values) => {
  for (const value of values) if (!Number.isFinite(value)) return false;
  return true;
};

/**
 * The exposure of all layers of a kind: that of the reference image, so that one that is brighter looks brighter; of
 * differences, that of the largest.
 */
function autoExposure(kind, settings) {
  if (kind === "excess" || kind === "regions") return 0;
  const layers = stage.layers.filter((layer) => layer.kind === kind);
  if (kind === "difference") {
    const all = layers.map((layer) => exposureOf(layer, settings)).filter((stops) => stops !== null);
    return all.length ? Math.min(...all) : 0;
  }
  const reference = stage.layers[stage.about.reference ?? 0];
  for (const layer of [reference, ...layers]) {
    const stops = exposureOf(layer, settings);
    if (stops !== null) return stops;
  }
  return 0;
}

/** The exposure that brings all but the brightest 1 % of a layer below the white of the screen; null of a black one. */
function exposureOf(layer, settings) {
  const sizes = [];
  const flat = settings.tone === "false" || settings.tone === "signed";
  const add = (values) => {
    const size = Math.abs(flat ? pick(values, settings.channel, layer.kind) : Math.max(...values));
    if (Number.isFinite(size) && size > 0) sizes.push(size);
  };
  const step = sampleStep(layer.image);
  forPixels(layer, settings, step, add);
  // A few pixels that differ may lie between those.
  if (sizes.length === 0 && step > 1) forPixels(layer, settings, 1, add);
  if (sizes.length === 0) return null;
  const sorted = Float64Array.from(sizes).sort();
  const bright = sorted[Math.min(sorted.length - 1, Math.floor(0.99 * sorted.length))];
  return clamp(Math.round(10 * Math.log2(whiteOf(settings.tone) / bright)) / 10, EXPOSURES);
}

/** Counts of values in bins over what the screen shows, of pixels spread evenly over the layer. */
function histogram(layer, settings) {
  const limit = whiteOf(settings.tone) * 2 ** -settings.exposure;
  const signed = settings.tone === "signed";
  const log = layer.kind === "excess";
  const all = settings.channel === "rgb";
  const counts = Array.from({ length: all ? layer.image.channels : 1 }, () => new Float64Array(BINS));
  forPixels(layer, settings, sampleStep(layer.image), (values) => {
    if (!areFinite(values)) return;
    for (let c = 0; c < counts.length; c++) {
      const value = all ? values[c] : pick(values, settings.channel, layer.kind);
      let at = signed ? 0.5 + (0.5 * value) / limit : value / limit;
      if (log) at = 0.5 + Math.log2(Math.max(at, 1e-9)) / LOG_RANGE;
      counts[c][Math.round(Math.min(Math.max(at, 0), 1) * (BINS - 1))]++;
    }
  });
  return counts;
}

/** Least, mean and most of all finite values that a layer shows, and how many pixels hold others. */
function factsOf(layer, settings) {
  const facts = { least: Infinity, most: -Infinity, sum: 0, count: 0, bad: 0 };
  const all = settings.channel === "rgb";
  forPixels(layer, settings, 1, (values) => {
    if (!areFinite(values)) facts.bad++;
    const count = all ? values.length : 1;
    for (let c = 0; c < count; c++) {
      const value = all ? values[c] : pick(values, settings.channel, layer.kind);
      if (!Number.isFinite(value)) continue;
      if (value < facts.least) facts.least = value;
      if (value > facts.most) facts.most = value;
      facts.sum += value;
      facts.count++;
    }
  });
  return facts;
}

/** What `make` finds out about a layer shown so; found out once. */
function kept(layer, settings, names, make) {
  const key = [make.name, ...names.map((name) => settings[name])].join();
  layer.kept ??= new Map();
  if (!layer.kept.has(key)) {
    // An exposure that is dragged makes many.
    if (layer.kept.size > 64) layer.kept.clear();
    layer.kept.set(key, make(layer, settings));
  }
  return layer.kept.get(key);
}

/** A value with so many digits, as short as it can be; of an integer, all of them. */
function digits(value, count = 4) {
  if (!Number.isFinite(value)) return String(value).replace("Infinity", "inf");
  if (value === 0) return Object.is(value, -0) ? "-0" : "0";
  const size = Math.abs(value);
  if (Number.isInteger(value) && size < 1e7) return String(value);
  return size < 1e-3 || size >= 10 ** count
    ? value.toExponential(count - 2)
    : String(Number(value.toPrecision(count)));
}

const LARGEST_HALF = 65504;

/** The half nearest to a number, even ones first. */
function roundToHalf(value) {
  const unit = 2 ** (Math.max(Math.floor(Math.log2(Math.abs(value))), -14) - 10);
  const steps = value / unit;
  const whole = Math.round(steps);
  const even = Math.abs(steps - Math.trunc(steps)) === 0.5 ? 2 * Math.round(steps / 2) : whole;
  const rounded = even * unit;
  return Math.abs(rounded) > LARGEST_HALF ? Math.sign(value) * Infinity : rounded;
}

/** The fewest digits that give the same float, or half, back; of an integer below 1e9, all of them. */
function exact(value, type) {
  if (!Number.isFinite(value) || value === 0) return digits(value);
  const size = Math.abs(value);
  if (Number.isInteger(value) && size < 1e9) return String(value);
  const round = type === "half" ? roundToHalf : Math.fround;
  let count = 1;
  while (count < 9 && round(Number(value.toPrecision(count))) !== value) count++;
  return size < 1e-4 || size >= 1e9 ? value.toExponential(count - 1) : String(Number(value.toPrecision(count)));
}

const FLOAT_MAX = 3.4028234663852886e38;

/** The first pixel of those of two images that differ most; a value that only one holds finite differs most of all. Null
    when the images are equal. As `umbra compare` measures it, in 32 bits. */
function worstPixel(layer) {
  let worst = null;
  let size = 0;
  forPixels(layer, { metric: "absolute" }, 1, (values, x, y) => {
    for (const value of values) {
      const rounded = Math.fround(value);
      const own = Number.isNaN(value) ? Infinity : rounded >= FLOAT_MAX ? value : rounded;
      if (own > size) {
        size = own;
        worst = { x, y };
      }
    }
  });
  return worst;
}
