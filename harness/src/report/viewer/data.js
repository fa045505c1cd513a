"use strict";
/*
 * Image data. Each image is a script of its own, `umbraImage("name", "base64")`, because a page that was
 * opened from the file system may load scripts but read no files. docs/decisions tells of the packing.
 */

/** What waits for a data file, by the file's own name. */
const waiting = new Map();
/** Images that were asked for, by the file's name: a promise of each. */
const images = new Map();

/** A data file's own name: a shared one lies in another folder than it says. */
const nameOf = (file) => file.split("/").pop();

window.umbraImage = (file, packed) => waiting.get(nameOf(file))?.(packed);

/** The image of a description (`ImageFile` in harness/src/viewer); loaded and unpacked once. */
function loadImage(about) {
  if (!images.has(about.file)) {
    images.set(about.file, loadScript(about.file).then((packed) => unpack(about, packed)));
  }
  return images.get(about.file);
}

function loadScript(file) {
  return new Promise((resolve, reject) => {
    const script = document.createElement("script");
    const end = (how, what) => {
      waiting.delete(nameOf(file));
      script.remove();
      how(what);
    };
    waiting.set(nameOf(file), (packed) => end(resolve, packed));
    script.addEventListener("error", () => end(reject, new Error(`${file} is missing beside this page`)));
    script.addEventListener("load", () => waiting.has(nameOf(file)) && end(reject, new Error(`${file} holds no image`)));
    script.src = file.split("/").map(encodeURIComponent).join("/");
    document.head.append(script);
  });
}

/** Bytes of the samples per type. */
const SAMPLE_BYTES = { half: 2, float: 4, uint16: 2 };

/**
 * Undoes the packing: base64 of zlib of byte planes, the highest first, of differences between
 * successive samples (as unsigned integers), channel by channel, row by row.
 */
async function unpack(about, packed) {
  const { width, height, channels, type } = about;
  const planes = await inflate(fromBase64(packed));
  const samples = width * height * channels;
  const bytes = SAMPLE_BYTES[type];
  if (planes.length !== samples * bytes) {
    throw new Error(`${about.file} holds ${planes.length} bytes, expected ${samples * bytes}`);
  }
  const raw = bytes === 2 ? new Uint16Array(samples) : new Uint32Array(samples);
  // Two loops, and a table below: of an image of 8K each sample counts.
  let last = 0;
  if (bytes === 2) {
    for (let i = 0; i < samples; i++) {
      last = (last + ((planes[i] << 8) | planes[samples + i])) & 0xffff;
      raw[i] = last;
    }
  } else {
    for (let i = 0; i < samples; i++) {
      const high = (planes[i] << 8) | planes[samples + i];
      const low = (planes[2 * samples + i] << 8) | planes[3 * samples + i];
      last = (last + ((high << 16) | low)) | 0;
      raw[i] = last;
    }
  }
  return new FloatImage(about, raw);
}

async function inflate(bytes) {
  if (typeof DecompressionStream === "undefined") {
    throw new Error("this browser is too old: it has no DecompressionStream (2023)");
  }
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

/** The bits of a 32-bit float with the value of a half's bits; NaN keeps its payload. */
function floatBitsOfHalf(half) {
  const sign = (half & 0x8000) << 16;
  const exponent = (half >> 10) & 31;
  const fraction = half & 0x3ff;
  if (exponent === 31) return (sign | 0x7f800000 | (fraction << 13)) >>> 0;
  if (exponent > 0) return (sign | ((exponent + 112) << 23) | (fraction << 13)) >>> 0;
  if (fraction === 0) return sign >>> 0;
  const shift = Math.clz32(fraction) - 21;
  return (sign | ((113 - shift) << 23) | (((fraction << shift) & 0x3ff) << 13)) >>> 0;
}

/** The same for all halves, made when it is first needed. */
let floatBits = null;

/** An image as floats, channels interleaved; row 0 is on top. */
class FloatImage {
  constructor({ width, height, channels, type }, raw) {
    Object.assign(this, { width, height, channels, type });
    if (type === "uint16") {
      this.raw = raw;
      return;
    }
    const pixels = width * height;
    /** The bits of `values`. A number that is not a number would lose some of its bits. */
    const bits = new Uint32Array(pixels * channels);
    const table = type === "half" ? (floatBits ??= Uint32Array.from({ length: 65536 }, (_, half) => floatBitsOfHalf(half))) : null;
    for (let c = 0, from = 0; c < channels; c++) {
      for (let to = c; to < bits.length; to += channels, from++) bits[to] = table ? table[raw[from]] : raw[from];
    }
    this.bits = bits;
    this.values = new Float32Array(this.bits.buffer);
  }

  /** The values of a pixel. */
  at(x, y) {
    const start = (y * this.width + x) * this.channels;
    return this.values.subarray(start, start + this.channels);
  }
}
