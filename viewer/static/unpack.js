"use strict";
// The packed arrays of the page: base64 -> inflate -> arrays decoded when first asked for.
(() => {
  const TYPES = {f4: Float32Array, u4: Uint32Array, u1: Uint8Array};

  async function inflate(text) {
    let bytes;
    if (Uint8Array.fromBase64) bytes = Uint8Array.fromBase64(text);
    else {
      const raw = atob(text);
      bytes = new Uint8Array(raw.length);
      for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    }
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  // Quantised, differenced along each column, byte planes; `plus` are arrays whose values are added. Sums are integers in
  // float64: exact, also beyond the range of int32.
  function undifference({n, c, q, off}, bytes, plus) {
    const m = n * c,
      out = new Float64Array(m);
    const p0 = bytes.subarray(off, off + m),
      p1 = bytes.subarray(off + m, off + 2 * m);
    const p2 = bytes.subarray(off + 2 * m, off + 3 * m),
      p3 = bytes.subarray(off + 3 * m, off + 4 * m);
    const steps = Math.round(1 / q); // a power of ten: dividing by it gives the double nearest the decimal value
    for (let j = 0, k = 0; j < c; j++) {
      let sum = 0;
      for (let i = 0, o = j; i < n; i++, k++, o += c) {
        sum += p0[k] | (p1[k] << 8) | (p2[k] << 16) | (p3[k] << 24);
        let whole = sum;
        for (const other of plus) whole += Math.round(other[o] * steps);
        out[o] = whole / steps;
      }
    }
    return out;
  }

  // Lines of a text, decoded one at a time: a listing of a million lines never becomes a million strings.
  class Lines {
    constructor(bytes, n) {
      this.bytes = bytes;
      this.n = n;
      this.starts = new Uint32Array(n + 1);
      let row = 1;
      for (let at = bytes.indexOf(10); at >= 0 && row < n; at = bytes.indexOf(10, at + 1)) this.starts[row++] = at + 1;
      this.starts.fill(bytes.length + 1, row);
      this.decoder = new TextDecoder();
    }
    line(i) {
      return i < 0 || i >= this.n ? "" : this.decoder.decode(this.bytes.subarray(this.starts[i], this.starts[i + 1] - 1));
    }
  }

  const points = text => (/[\ud800-\udfff]/.test(text) ? Array.from(text) : text);
  const joined = part => (typeof part === "string" ? part : part.join(""));

  // Lines of a second text as changes to the lines of a first.
  class Patch {
    constructor(arrays, spec) {
      this.n = spec.n;
      this.base = arrays.get(spec.of);
      [this.from, this.prefix, this.suffix, this.middle] = [spec.from, spec.prefix, spec.suffix, spec.middle].map(a =>
        arrays.get(a),
      );
    }
    line(i) {
      if (i < 0 || i >= this.n) return "";
      if (this.from[i] < 0) return this.middle.line(i);
      const old = points(this.base.line(this.from[i]));
      return joined(old.slice(0, this.prefix[i])) + this.middle.line(i) + joined(old.slice(old.length - this.suffix[i]));
    }
  }

  class Arrays {
    constructor(specs, bytes) {
      this.specs = specs;
      this.bytes = bytes;
      this.known = new Map();
    }
    has(name) {
      return name != null && Object.hasOwn(this.specs, name);
    }
    get(name) {
      if (!this.has(name)) throw new Error(`no array ${name} in this page`);
      if (!this.known.has(name)) this.known.set(name, this.decode(this.specs[name]));
      return this.known.get(name);
    }
    decode(spec) {
      if (spec.enc === "qd")
        return undifference(
          spec,
          this.bytes,
          (spec.plus ?? []).map(name => this.get(name)),
        );
      if (spec.enc === "raw") return new TYPES[spec.dtype](this.bytes.buffer, this.bytes.byteOffset + spec.off, spec.n * spec.c);
      if (spec.enc === "patch") return new Patch(this, spec);
      if (spec.enc === "text") return new Lines(this.bytes.subarray(spec.off, spec.off + spec.bytes), spec.n);
      throw new Error(`unknown encoding ${spec.enc}`);
    }
  }

  OLP.unpack = async (manifest, text) => {
    if (manifest.schema !== "olp-review-1") throw new Error(`this page reads olp-review-1, not ${manifest.schema}`);
    return new Arrays(manifest.arrays, await inflate(text));
  };
})();
