/* Draws panes where there is no WebGL 2, pixel by pixel. */

class CanvasPainter {
  constructor(canvas) {
    this.context = canvas.getContext("2d");
    this.name = "plain canvas";
  }

  holds() {
    return true;
  }

  begin(width, height) {
    this.context.canvas.width = width;
    this.context.canvas.height = height;
  }

  pane({ box, origin, zoom, layer, settings }) {
    const { width, height } = layer.image;
    const left = Math.max(box.x, Math.ceil(origin.x - 0.5));
    const right = Math.min(box.x + box.width, Math.ceil(origin.x + width * zoom - 0.5));
    const top = Math.max(box.y, Math.ceil(origin.y - 0.5));
    const bottom = Math.min(box.y + box.height, Math.ceil(origin.y + height * zoom - 0.5));
    if (right <= left || bottom <= top) return;
    const picture = this.context.createImageData(right - left, bottom - top);
    const column = (x) => Math.min(Math.max(Math.floor((x + 0.5 - origin.x) / zoom), 0), width - 1);
    const row = (y) => Math.min(Math.max(Math.floor((y + 0.5 - origin.y) / zoom), 0), height - 1);
    let at = 0;
    for (let y = top; y < bottom; y++) {
      for (let x = left; x < right; x++, at += 4) {
        picture.data.set(shade(layerValues(layer, column(x), row(y), settings), layer, settings), at);
        picture.data[at + 3] = 255;
      }
    }
    this.context.putImageData(picture, left, top);
  }
}
