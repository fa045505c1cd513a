/* Draws panes where there is no WebGL 2: each image is colored once for each way to show it, then copied. */

class CanvasPainter {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.name = "plain canvas";
    this.colored = new Map();
  }

  holds() {
    return true;
  }

  begin(width, height) {
    this.context.canvas.width = width;
    this.context.canvas.height = height;
  }

  /** The colors of all pixels of a layer, as 32-bit words. */
  colorsOf(layer, settings) {
    const key = Object.values(settings).join();
    const kept = this.colored.get(layer);
    if (kept?.key === key) return kept.words;
    const { width, height } = layer.image;
    const bytes = new Uint8ClampedArray(4 * width * height);
    for (let y = 0, at = 0; y < height; y++) {
      for (let x = 0; x < width; x++, at += 4) {
        bytes.set(shade(layerValues(layer, x, y, settings), layer, settings), at);
        bytes[at + 3] = 255;
      }
    }
    const words = new Uint32Array(bytes.buffer);
    this.colored.set(layer, { key, words });
    return words;
  }

  pane({ box, origin, zoom, layer, settings }) {
    const { width, height } = layer.image;
    // An image is at least one pixel of the screen wide and high.
    const left = Math.max(box.x, Math.ceil(origin.x - 0.5));
    const right = Math.min(box.x + box.width, Math.ceil(origin.x + Math.max(width * zoom, 1) - 0.5));
    const top = Math.max(box.y, Math.ceil(origin.y - 0.5));
    const bottom = Math.min(box.y + box.height, Math.ceil(origin.y + Math.max(height * zoom, 1) - 0.5));
    if (right <= left || bottom <= top) return;
    const colors = this.colorsOf(layer, settings);
    const picture = this.context.createImageData(right - left, bottom - top);
    const words = new Uint32Array(picture.data.buffer);
    const column = (x) => Math.min(Math.max(Math.floor((x + 0.5 - origin.x) / zoom), 0), width - 1);
    const row = (y) => Math.min(Math.max(Math.floor((y + 0.5 - origin.y) / zoom), 0), height - 1);
    const columns = Uint32Array.from({ length: right - left }, (_, i) => column(left + i));
    for (let y = top, at = 0; y < bottom; y++) {
      const start = row(y) * width;
      for (const x of columns) words[at++] = colors[start + x];
    }
    this.context.putImageData(picture, left, top);
  }
}
