/* Where panes lie, and what is painted into them. */

/** Below this size of a pixel, in CSS pixels, no values are written into it. */
const TEXT_ZOOM = 44;
const GRID_ZOOM = 14;

const stage = { width: 0, height: 0, ratio: 1, layers: [], about: null, painter: null, marks: [], auto: new Map() };

const sizeOf = () => stage.layers[0].image;

/** The layers that are visible now. While a key is held, the reference is alone. */
function panes() {
  const whole = { x: 0, y: 0, width: stage.width, height: stage.height };
  const at = (index) => stage.layers[index];
  if (stage.held) return [{ index: state.reference, layer: at(state.reference), box: whole, clip: whole }];
  if (state.mode === "wipe" && stage.layers.length > 1) {
    const edge = Math.round(state.wipe * whole.width);
    return [
      { index: state.layer, layer: at(state.layer), box: whole, clip: { ...whole, width: edge } },
      { index: state.reference, layer: at(state.reference), box: whole, clip: { ...whole, x: edge, width: whole.width - edge } },
    ];
  }
  if (state.mode === "side" && stage.layers.length > 1) return grid(sideBySide());
  return [{ index: state.layer, layer: at(state.layer), box: whole, clip: whole }];
}

/** The layers side by side: at most four, the one selected and its reference always. */
function sideBySide() {
  const all = stage.layers.map((_, index) => index);
  const first = [state.layer, state.reference];
  const others = all.filter((index) => !first.includes(index) && stage.layers[index].kind !== "regions");
  return [...new Set([...first, ...others])].slice(0, 4).sort((a, b) => a - b);
}

/** Boxes of equal size, in as many columns as make the image largest. */
function grid(indices) {
  const { width, height } = sizeOf();
  const gap = 4;
  let best = { fit: 0 };
  for (let columns = 1; columns <= indices.length; columns++) {
    const rows = Math.ceil(indices.length / columns);
    const w = Math.floor((stage.width - gap * (columns - 1)) / columns);
    const h = Math.floor((stage.height - gap * (rows - 1)) / rows);
    const fit = Math.min(w / width, h / height);
    if (fit > best.fit) best = { fit, columns, w, h };
  }
  return indices.map((index, i) => {
    const box = { x: (i % best.columns) * (best.w + gap), y: Math.floor(i / best.columns) * (best.h + gap), width: best.w, height: best.h };
    return { index, layer: stage.layers[index], box, clip: box };
  });
}

/** The pixel in the middle of each pane and the zoom, also where the image is fitted in. */
function view() {
  if (state.view) return state.view;
  const { width, height } = sizeOf();
  const box = panes()[0].box;
  return { x: width / 2, y: height / 2, zoom: Math.min(box.width / width, box.height / height) };
}

/** The upper left corner of the image in a pane, in CSS pixels that are whole device pixels. */
function originOf(box) {
  const { x, y, zoom } = view();
  const whole = (value) => Math.round(value * stage.ratio) / stage.ratio;
  return { x: whole(box.x + box.width / 2 - x * zoom), y: whole(box.y + box.height / 2 - y * zoom) };
}

/** The pane at a place on the stage. */
function paneAt(place) {
  const inside = ({ clip }) =>
    place.x >= clip.x && place.x < clip.x + clip.width && place.y >= clip.y && place.y < clip.y + clip.height;
  return panes().find(inside) ?? panes()[0];
}

/** The image's coordinates at a place on the stage. */
function imageAt(place) {
  const origin = originOf(paneAt(place).box);
  const { zoom } = view();
  return { x: (place.x - origin.x) / zoom, y: (place.y - origin.y) / zoom };
}

/** The pixel at a place, or null beside the image. */
function pixelAt(place) {
  const { x, y } = imageAt(place);
  const { width, height } = sizeOf();
  return x >= 0 && y >= 0 && x < width && y < height ? { x: Math.floor(x), y: Math.floor(y) } : null;
}

/** How a layer is shown. */
function settingsOf(layer) {
  const look = state.look[layer.kind];
  const settings = { metric: state.metric, channel: state.channel, tone: look.tone };
  if (layer.kind === "regions") return { ...settings, channel: "rgb", exposure: 0 };
  if (look.exposure !== null) return { ...settings, exposure: look.exposure };
  const key = [layer.kind, look.tone, state.metric, state.channel].join();
  if (!stage.auto.has(key)) stage.auto.set(key, autoExposure(layer.kind, settings));
  return { ...settings, exposure: stage.auto.get(key) };
}

function paint() {
  const { painter, ratio } = stage;
  painter.begin(Math.round(stage.width * ratio), Math.round(stage.height * ratio));
  const device = ({ x, y, width, height }) => {
    const [left, top] = [Math.round(x * ratio), Math.round(y * ratio)];
    return { x: left, y: top, width: Math.round((x + width) * ratio) - left, height: Math.round((y + height) * ratio) - top };
  };
  const all = panes();
  for (const { layer, box, clip } of all) {
    const origin = originOf(box);
    painter.pane({
      box: device(clip),
      origin: { x: origin.x * ratio, y: origin.y * ratio },
      zoom: view().zoom * ratio,
      layer,
      settings: settingsOf(layer),
    });
  }
  paintOver(all);
}

/** Values, grid, marks and names, over the images. */
function paintOver(all) {
  const canvas = stage.over;
  canvas.width = Math.round(stage.width * stage.ratio);
  canvas.height = Math.round(stage.height * stage.ratio);
  const context = canvas.getContext("2d");
  context.scale(stage.ratio, stage.ratio);
  const { zoom } = view();
  const { width, height } = sizeOf();
  for (const { layer, index, box, clip } of all) {
    const origin = originOf(box);
    context.save();
    context.beginPath();
    context.rect(clip.x, clip.y, clip.width, clip.height);
    context.clip();
    const range = (from, size, start, count) => [
      Math.max(0, Math.floor((from - start) / zoom)), Math.min(count, Math.ceil((from + size - start) / zoom))];
    const [left, right] = range(clip.x, clip.width, origin.x, width);
    const [top, bottom] = range(clip.y, clip.height, origin.y, height);
    if (zoom >= GRID_ZOOM) paintGrid(context, origin, zoom, [left, right, top, bottom]);
    if (zoom >= TEXT_ZOOM) {
      for (let y = top; y < bottom; y++) {
        for (let x = left; x < right; x++) paintValues(context, layer, x, y, origin, zoom);
      }
    }
    for (const { x, y, width: w = 1, height: h = 1 } of stage.marks) {
      const grow = Math.max(2, (14 - w * zoom) / 2);
      for (const [color, line] of [["#000", 4], ["#fff", 1.5]]) {
        context.strokeStyle = color;
        context.lineWidth = line;
        context.strokeRect(origin.x + x * zoom - grow, origin.y + y * zoom - grow, w * zoom + 2 * grow, h * zoom + 2 * grow);
      }
    }
    paintName(context, `${index + 1} ${layer.name}`, clip, stage.held || (state.mode === "wipe" && index === state.reference));
    context.restore();
  }
  if (state.mode === "wipe" && all.length === 2) {
    context.fillStyle = "#fff";
    context.fillRect(all[1].clip.x - 1, 0, 2, stage.height);
    context.beginPath();
    context.arc(all[1].clip.x, stage.height / 2, 9, 0, 7);
    context.fill();
  }
}

function paintGrid(context, origin, zoom, [left, right, top, bottom]) {
  context.strokeStyle = "rgba(128, 128, 128, 0.5)";
  context.lineWidth = 1;
  context.beginPath();
  for (let x = left; x <= right; x++) {
    context.moveTo(origin.x + x * zoom, origin.y + top * zoom);
    context.lineTo(origin.x + x * zoom, origin.y + bottom * zoom);
  }
  for (let y = top; y <= bottom; y++) {
    context.moveTo(origin.x + left * zoom, origin.y + y * zoom);
    context.lineTo(origin.x + right * zoom, origin.y + y * zoom);
  }
  context.stroke();
}

/** Writes the values of a pixel into it. */
function paintValues(context, layer, x, y, origin, zoom) {
  const settings = settingsOf(layer);
  const values = layer.kind === "regions" ? [] : layerValues(layer, x, y, settings);
  const lines = layer.kind === "regions" ? [] : values.map((value) => digits(value));
  const size = Math.min(18, zoom / 6, (0.8 * zoom) / Math.max(lines.length, 1));
  const [r, g, b] = shade(values.length ? values : [0], layer, settings);
  context.font = `${size}px ui-monospace, Menlo, Consolas, "Liberation Mono", monospace`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = 0.3 * r + 0.59 * g + 0.11 * b > 127 ? "#000" : "#fff";
  lines.forEach((line, i) => {
    const row = y + 0.5 + ((i - (lines.length - 1) / 2) * size * 1.25) / zoom;
    context.fillText(line, origin.x + (x + 0.5) * zoom, origin.y + row * zoom);
  });
}

function paintName(context, name, clip, right) {
  context.font = '600 12px system-ui, "Liberation Sans", sans-serif';
  context.textBaseline = "middle";
  context.textAlign = "left";
  const width = context.measureText(name).width + 12;
  const x = right ? clip.x + clip.width - width - 6 : clip.x + 6;
  context.fillStyle = "rgba(0, 0, 0, 0.65)";
  context.fillRect(x, clip.y + 6, width, 20);
  context.fillStyle = "#fff";
  context.fillText(name, x + 6, clip.y + 16);
}
