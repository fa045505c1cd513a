/* Draws panes with WebGL 2. */

const VERTEX = `#version 300 es
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  gl_Position = vec4(4.0 * corner - 1.0, 0.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D actual, expected, table;
uniform ivec2 size;
uniform vec2 origin;      // Of the image, in device pixels from the canvas's lower left corner.
uniform float zoom, gain, smallest;
uniform int channels, metric, channel, tone, scale;
out vec4 color;

vec3 fetch(sampler2D image, ivec2 at) {
  vec3 value = texelFetch(image, at, 0).rgb;
  return channels == 1 ? value.rrr : value;
}

float apart(float a, float b) {
  // By their bits: a driver may take NaN for a number.
  uint bits = floatBitsToUint(a), others = floatBitsToUint(b);
  const uint infinite = 0x7f800000u;
  if (bits == others || ((bits & ~0x80000000u) > infinite && (others & ~0x80000000u) > infinite)) return 0.0;
  float d = a - b;
  return metric == 1 ? d : metric == 2 ? abs(d) : d / max(b, smallest);
}

vec3 valueAt(ivec2 at) {
  vec3 a = fetch(actual, at);
  if (metric == 0) return a;
  vec3 b = fetch(expected, at);
  return vec3(apart(a.r, b.r), apart(a.g, b.g), apart(a.b, b.b));
}

float curve(float v) {
  if (tone == 4) v = v * (1.0 + v / ${WHITE ** 2}.0) / (1.0 + v);
  if (tone == 1) return pow(v, 1.0 / 2.2);
  return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1.0 / 2.4) - 0.055;
}

bool finite(float v) {
  return (floatBitsToUint(v) & 0x7f800000u) != 0x7f800000u;
}

void main() {
  vec2 place = vec2(gl_FragCoord.x - origin.x, origin.y - gl_FragCoord.y) / zoom;
  // An image is at least one pixel of the screen wide and high.
  if (any(lessThan(place, vec2(0.0))) || any(greaterThanEqual(place, max(vec2(size), 1.0 / zoom)))) discard;
  // What is smaller than a pixel of the screen is averaged, so that noise does not flicker.
  int steps = int(clamp(ceil(1.0 / zoom), 1.0, 8.0));
  vec3 value = vec3(0.0);
  bool bad = false;
  for (int j = 0; j < steps; j++) for (int i = 0; i < steps; i++) {
    vec2 offset = (vec2(i, j) + 0.5) / float(steps) - 0.5;
    vec3 one = valueAt(clamp(ivec2(floor(place + (steps > 1 ? offset / zoom : vec2(0.0)))), ivec2(0), size - 1));
    bad = bad || !(finite(one.r) && finite(one.g) && finite(one.b));
    value += one;
  }
  value /= float(steps * steps);
  color = vec4(1.0, 0.0, 1.0, 1.0);
  if (bad) return;
  float single = channel == 1 ? value.r : channel == 2 ? value.g : channel == 3 ? value.b : (value.r + value.g + value.b) / 3.0;
  if (channel == 0 && metric != 0) {
    single = value.r;
    if (abs(value.g) > abs(single)) single = value.g;
    if (abs(value.b) > abs(single)) single = value.b;
  }
  if (tone == 2 || tone == 3) {
    float at = single * gain;
    if (tone == 3) at = 0.5 + 0.5 * at;
    else if (scale == 1) at = 0.5 + log2(max(at, 1e-9)) / ${LOG_RANGE}.0;
    color = texture(table, vec2((clamp(at, 0.0, 1.0) * 255.0 + 0.5) / 256.0, 0.5));
    return;
  }
  vec3 shown = clamp((channel == 0 ? value : vec3(single)) * gain, 0.0, tone == 4 ? ${WHITE}.0 : 1.0);
  color = vec4(curve(shown.r), curve(shown.g), curve(shown.b), 1.0);
}`;

class GlPainter {
  /** Nothing where the browser has no WebGL 2. */
  static make(canvas) {
    const gl = canvas.getContext("webgl2", { alpha: true, antialias: false, preserveDrawingBuffer: true });
    if (!gl) return null;
    try {
      return new GlPainter(gl);
    } catch (error) {
      console.warn(error);
      return null;
    }
  }

  constructor(gl) {
    this.gl = gl;
    this.canvas = gl.canvas;
    this.name = "WebGL 2";
    this.largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) {
      throw new Error(`the viewer's shader: ${gl.getProgramInfoLog(this.program)}`);
    }
    gl.useProgram(this.program);
    this.places = {};
    for (let i = 0; i < gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS); i++) {
      const { name } = gl.getActiveUniform(this.program, i);
      this.places[name] = gl.getUniformLocation(this.program, name);
    }
    this.textures = new Map();
    this.tables = [VIRIDIS, DIVERGING].map((map) =>
      this.texture([gl.RGBA8, 256, 1, gl.RGBA, gl.UNSIGNED_BYTE], colorTable(map)));
    ["actual", "expected", "table"].forEach((name, unit) => gl.uniform1i(this.places[name], unit));
  }

  /** Whether an image fits into a texture. */
  holds(image) {
    return Math.max(image.width, image.height) <= this.largest;
  }

  texture([format, width, height, layout, type], data) {
    const gl = this.gl;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, layout, type, data);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
    }
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, wrap, gl.CLAMP_TO_EDGE);
    return texture;
  }

  textureOf(image) {
    const gl = this.gl;
    if (!this.textures.has(image)) {
      const [format, layout] = image.channels === 1 ? [gl.R32F, gl.RED] : [gl.RGB32F, gl.RGB];
      const texture = this.texture([format, image.width, image.height, layout, gl.FLOAT], image.values);
      this.textures.set(image, texture);
    }
    return this.textures.get(image);
  }

  begin(width, height) {
    const gl = this.gl;
    gl.canvas.width = width;
    gl.canvas.height = height;
    this.height = height;
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.viewport(0, 0, width, height);
  }

  /** Draws a layer into a box of device pixels; `origin` is the image's upper left corner on the canvas. */
  pane({ box, origin, zoom, layer, settings }) {
    const { gl, places, height } = this;
    gl.scissor(box.x, height - box.y - box.height, box.width, box.height);
    const other = layer.other ?? layer.image;
    [this.textureOf(layer.image), this.textureOf(other), this.tables[settings.tone === "signed" ? 1 : 0]]
      .forEach((texture, unit) => {
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, texture);
      });
    gl.uniform2i(places.size, layer.image.width, layer.image.height);
    gl.uniform2f(places.origin, origin.x, height - origin.y);
    gl.uniform1f(places.zoom, zoom);
    gl.uniform1f(places.gain, 2 ** settings.exposure);
    gl.uniform1f(places.smallest, layer.floor ?? 1);
    gl.uniform1i(places.channels, layer.image.channels);
    gl.uniform1i(places.metric, layer.kind === "difference" ? 1 + METRICS.indexOf(settings.metric) : 0);
    gl.uniform1i(places.channel, CHANNELS.indexOf(settings.channel));
    gl.uniform1i(places.tone, TONES.indexOf(settings.tone));
    gl.uniform1i(places.scale, layer.kind === "excess" ? 1 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
