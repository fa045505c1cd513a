/* What can be said of values: exposure, histogram, words. */

/** At most so many pixels are looked at for an exposure or a histogram. */
const SAMPLES = 120000;

/** Calls back with the values of pixels spread evenly over a layer. */
function forSamples(layer, settings, see) {
  const { width, height } = layer.image;
  const step = Math.max(1, Math.ceil(Math.sqrt((width * height) / SAMPLES)));
  for (let y = 0; y < height; y += step) {
    for (let x = 0; x < width; x += step) see(layerValues(layer, x, y, settings), x, y);
  }
}

/** The exposure that brings all but the brightest 1 % below the white of the screen. */
function autoExposure(layer, settings) {
  if (layer.kind === "excess" || layer.kind === "regions") return 0;
  const sizes = [];
  const flat = settings.tone === "false" || settings.tone === "signed";
  forSamples(layer, settings, (values) => {
    const size = Math.abs(flat ? pick(values, settings.channel) : Math.max(...values));
    if (Number.isFinite(size) && size > 0) sizes.push(size);
  });
  if (sizes.length === 0) return 0;
  const sorted = Float64Array.from(sizes).sort();
  const bright = sorted[Math.min(sorted.length - 1, Math.floor(0.99 * sorted.length))];
  return clamp(Math.round(-10 * Math.log2(bright)) / 10, EXPOSURES);
}

/** Counts of values in bins over what the screen shows, and facts on all of them. */
function histogram(layer, settings, bins) {
  const limit = 2 ** -settings.exposure;
  const signed = settings.tone === "signed";
  const counts = Array.from({ length: 3 }, () => new Float64Array(bins));
  const facts = { least: Infinity, most: -Infinity, sum: 0, count: 0, bad: 0 };
  const log = layer.kind === "excess";
  forSamples(layer, settings, (values) => {
    if (!values.every(Number.isFinite)) {
      facts.bad++;
      return;
    }
    const shown = settings.channel === "rgb" ? values : [pick(values, settings.channel)];
    shown.forEach((value, c) => {
      let at = signed ? 0.5 + (0.5 * value) / limit : value / limit;
      if (log) at = 0.5 + Math.log2(Math.max(at, 1e-9)) / LOG_RANGE;
      counts[c][Math.round(clamp(at, [0, 1]) * (bins - 1))]++;
      facts.least = Math.min(facts.least, value);
      facts.most = Math.max(facts.most, value);
      facts.sum += value;
      facts.count++;
    });
  });
  return { counts: counts.slice(0, settings.channel === "rgb" ? layer.image.channels : 1), ...facts };
}

/** A value with so many digits, as short as it can be. */
function digits(value, count = 4) {
  if (!Number.isFinite(value)) return String(value).replace("Infinity", "inf");
  if (value === 0) return Object.is(value, -0) ? "-0" : "0";
  const size = Math.abs(value);
  return size < 1e-3 || size >= 10 ** (count + 1)
    ? value.toExponential(count - 2)
    : String(Number(value.toPrecision(count)));
}

/** The pixel of two images that differs most; a value that is not finite differs most of all. */
function worstPixel(layer) {
  const { width, height } = layer.image;
  let worst = null;
  let size = 0;
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const values = layerValues(layer, x, y, { metric: "absolute" });
      const own = Math.max(...values.map((v) => (Number.isFinite(v) ? v : Infinity)));
      if (own > size) {
        size = own;
        worst = { x, y };
        if (own === Infinity) return worst;
      }
    }
  }
  return worst;
}
