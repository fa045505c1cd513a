/* Mouse, touch and keyboard. */

/** What the keys do; tev's where it has one. */
const KEYS = [
  ["1…9", "show the image with this number"],
  ["Shift+1…9", "hold it against the image shown"],
  ["Down, Up or S, W", "next, previous image"],
  ["Shift (hold) or Space (hold)", "flicker to the image held against"],
  ["M", "one image, side by side, wipe"],
  ["V, Shift+V", "the wipe's edge to the right, left"],
  ["E, Shift+E", "more, less exposure by half a stop"],
  ["N", "exposure found from the values"],
  ["R", "reset everything"],
  ["Shift+Right, Shift+Left", "next, previous way from values to colors"],
  ["Right, Left or D, A or ], [", "next, previous channels"],
  ["Ctrl+Right, Ctrl+Left or X", "signed, absolute, relative difference"],
  ["+, - or wheel", "zoom"],
  ["H, J, K, L or drag", "move"],
  ["click or tap", "keep the probe on a pixel"],
  ["F; 0", "fit into the window; pixel by pixel"],
  ["P", "go to the pixel that is furthest off"],
  ["B", "go to the largest block of failing pixels"],
  ["C", "copy the address of this view"],
  ["?", "this help"],
];

const next = (all, value, step) => all[(all.indexOf(value) + step + all.length) % all.length];

/** Zooms so that the image's point at a place of the stage stays there. */
function zoomAt(place, factor) {
  const pane = paneAt(place).box;
  const fixed = imageAt(place);
  const zoom = clamp(view().zoom * factor, ZOOMS);
  state.view = {
    x: fixed.x - (place.x - pane.x - pane.width / 2) / zoom,
    y: fixed.y - (place.y - pane.y - pane.height / 2) / zoom,
    zoom,
  };
}

function move(dx, dy) {
  const { x, y, zoom } = view();
  state.view = { x: x - dx / zoom, y: y - dy / zoom, zoom };
}

/** Goes to an area and marks it. */
function goTo({ x, y, width = 1, height = 1 }) {
  const box = panes()[0].box;
  const zoom = clamp(Math.min(box.width / (3 * width + 8), box.height / (3 * height + 8)), [1, 64]);
  state.view = { x: x + width / 2, y: y + height / 2, zoom };
  state.pin = { x: Math.floor(x + width / 2), y: Math.floor(y + height / 2) };
  stage.hover = null;
  stage.marks = [{ x, y, width, height }];
}

function goToWorst() {
  const { about, layers } = stage;
  const differences = layers.filter((layer) => layer.kind === "difference");
  const { image } = layers[state.layer];
  const difference = differences.find((layer) => layer === layers[state.layer])
    ?? differences.find((layer) => layer.image === image || layer.other === image) ?? differences[0];
  const worst = about.worst ? { x: about.worst[0], y: about.worst[1] } : difference && kept(difference, {}, [], worstPixel);
  if (worst) goTo(worst);
  else say(difference ? `${difference.name}: no pixel differs.` : "");
}

function goToBlock() {
  const area = stage.about.area;
  if (area) goTo({ x: area[0], y: area[1], width: area[2], height: area[3] });
}

/** What a key does, or nothing. */
function actionOf(event) {
  const { key, shiftKey, ctrlKey, metaKey, altKey, code } = event;
  if (metaKey || altKey) return null;
  const count = stage.layers.length;
  const digit = /^(?:Digit|Numpad)([1-9])$/.exec(code)?.[1];
  if (digit && !ctrlKey) {
    if (digit > count) return () => {};
    return shiftKey ? () => { state.reference = digit - 1; } : () => { state.layer = digit - 1; };
  }
  const step = (by) => (shiftKey
    ? () => { state.reference = (state.reference + by + count) % count; }
    : () => { state.layer = (state.layer + by + count) % count; });
  const side = (by) => {
    if (ctrlKey) return () => { state.metric = next(METRICS, state.metric, by); toneOfMetric(); };
    if (shiftKey) return () => { lookNow().tone = next(TONES, lookNow().tone, by); };
    return () => { state.channel = next(CHANNELS, state.channel, by); };
  };
  const middle = { x: stage.width / 2, y: stage.height / 2 };
  const far = shiftKey ? 120 : 40;
  if (ctrlKey && !["ArrowRight", "ArrowLeft"].includes(key)) return null;
  switch (key.length === 1 ? key.toLowerCase() : key) {
    case "ArrowDown": case "s": return step(1);
    case "ArrowUp": case "w": return step(-1);
    case "ArrowRight": case "d": case "]": return side(1);
    case "ArrowLeft": case "a": case "[": return side(-1);
    case "Home": return () => { state.layer = 0; };
    case "End": return () => { state.layer = count - 1; };
    case "x": return () => { state.metric = next(METRICS, state.metric, 1); toneOfMetric(); };
    case "m": return () => { state.mode = next(MODES, state.mode, 1); };
    case "v": return () => { state.wipe = clamp(state.wipe + (shiftKey ? -0.05 : 0.05), [0, 1]); };
    case "e": return () => {
      const now = settingsOf(stage.layers[state.layer]).exposure;
      lookNow().exposure = clamp(now + (shiftKey ? -0.5 : 0.5), EXPOSURES);
    };
    case "n": return () => { lookNow().exposure = null; };
    case "r": return reset;
    case "+": case "=": return () => zoomAt(middle, 1.25);
    case "-": case "_": return () => zoomAt(middle, 0.8);
    case "h": return () => move(far, 0);
    case "l": return () => move(-far, 0);
    case "k": return () => move(0, far);
    case "j": return () => move(0, -far);
    case "f": return () => { state.view = null; };
    case "0": return () => { state.view = { ...view(), zoom: 1 / stage.ratio }; };
    case "p": return goToWorst;
    case "b": return goToBlock;
    case "c": return () => navigator.clipboard?.writeText(location.href).catch(() => {});
    case "?": return () => get("help").showModal();
    default: return null;
  }
}

function reset() {
  state.look = initialLook(stage.about);
  Object.assign(state, { view: null, pin: null, metric: "signed", channel: "rgb", wipe: 0.5 });
  stage.marks = [];
}

function listen(change) {
  /** Whether a control needs a key itself: a list takes letters too. */
  const needs = (target, { key }) => target instanceof HTMLElement && (target.matches("select, input:not([type=range])")
    || (target.matches("input") && /^(Arrow|Page|Home$|End$)/.test(key)));
  const holds = ({ key }) => key === "Shift" || key === " ";
  addEventListener("keydown", (event) => {
    if (!stage.about || get("help").open || needs(event.target, event)) return;
    // A button keeps its space bar.
    if (event.key === " " && event.target instanceof HTMLButtonElement) return;
    if (holds(event)) {
      if (!event.repeat && stage.layers.length > 1) change(() => { stage.held = true; });
      if (event.key === " ") event.preventDefault();
      return;
    }
    const action = actionOf(event);
    if (!action) return;
    event.preventDefault();
    change(() => { stage.held = false; action(); });
  });
  const release = () => stage.held && change(() => { stage.held = false; });
  addEventListener("keyup", (event) => holds(event) && release());
  addEventListener("blur", release);
  listenToPointers(change);
}

function listenToPointers(change) {
  const target = get("stage");
  const pointers = new Map();
  let drags = null;
  /** Where a click or tap began; null once it is a drag. */
  let tapped = null;
  const placeOf = (event) => {
    const { left, top } = target.getBoundingClientRect();
    return { x: event.clientX - left, y: event.clientY - top };
  };
  const nearEdge = (place, touch) =>
    state.mode === "wipe" && Math.abs(place.x - state.wipe * stage.width) < (touch ? 28 : 12);
  target.addEventListener("pointerdown", (event) => {
    if (!stage.about) return;
    const place = placeOf(event);
    pointers.set(event.pointerId, place);
    target.setPointerCapture(event.pointerId);
    tapped = pointers.size === 1 ? place : null;
    if (pointers.size === 1) drags = nearEdge(place, event.pointerType === "touch") ? "wipe" : "image";
    else drags = "image";
    change(() => { stage.hover = pixelAt(place); });
  });
  target.addEventListener("pointermove", (event) => {
    if (!stage.about) return;
    const place = placeOf(event);
    const before = pointers.get(event.pointerId);
    target.style.cursor = nearEdge(place) ? "ew-resize" : "crosshair";
    if (!before) {
      stage.hover = pixelAt(place);
      showProbe();
      return;
    }
    if (tapped && Math.hypot(place.x - tapped.x, place.y - tapped.y) > 4) tapped = null;
    change(() => {
      if (drags === "wipe") state.wipe = clamp(place.x / stage.width, [0, 1]);
      else if (pointers.size === 1) move(place.x - before.x, place.y - before.y);
      else pinch(event.pointerId, before, place);
      pointers.set(event.pointerId, place);
      stage.hover = pixelAt(place);
    });
  });
  const pinch = (id, before, place) => {
    const [, other] = [...pointers].find(([pointer]) => pointer !== id);
    const apart = (p) => Math.hypot(p.x - other.x, p.y - other.y) || 1;
    zoomAt({ x: (place.x + other.x) / 2, y: (place.y + other.y) / 2 }, apart(place) / apart(before));
    move((place.x - before.x) / 2, (place.y - before.y) / 2);
  };
  for (const name of ["pointerup", "pointercancel"]) {
    target.addEventListener(name, (event) => {
      pointers.delete(event.pointerId);
      // The probe stays on a pixel that was clicked: a finger does not hover.
      if (tapped && name === "pointerup" && drags === "image") change(() => { state.pin = pixelAt(tapped); });
      if (pointers.size === 0) drags = null;
    });
  }
  target.addEventListener("pointerleave", () => {
    stage.hover = null;
    if (stage.about) showProbe();
  });
  target.addEventListener("dblclick", () => change(() => { state.view = null; }));
  target.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (!stage.about) return;
    const lines = event.deltaMode === 1 ? 30 : 1;
    change(() => zoomAt(placeOf(event), 2 ** (-(event.deltaY * lines) / 300)));
  }, { passive: false });
}
