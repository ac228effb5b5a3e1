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

  // The numbers of a column: planes of bytes from `at`, the lowest first. 2 r stands for r, and -2 r - 1 for a negative one.
  function signed(n, bytes, at, width, out) {
    const [p0, p1, p2] = [0, 1, 2].map(k => bytes.subarray(at + k * n, at + (k + 1) * n));
    if (width === 0) out.fill(0);
    else if (width === 1) for (let i = 0; i < n; i++) out[i] = (p0[i] >>> 1) ^ -(p0[i] & 1);
    else if (width === 2) for (let i = 0; i < n; i++) out[i] = ((p0[i] | (p1[i] << 8)) >>> 1) ^ -(p0[i] & 1);
    else if (width === 3) for (let i = 0; i < n; i++) out[i] = ((p0[i] | (p1[i] << 8) | (p2[i] << 16)) >>> 1) ^ -(p0[i] & 1);
    else
      for (let i = 0; i < n; i++) {
        let z = 0;
        for (let k = width - 1; k >= 0; k--) z = 256 * z + bytes[at + k * n + i];
        out[i] = z % 2 ? -(z + 1) / 2 : z / 2;
      }
  }

  // The column j of whole numbers. Sums are integers in float64: exact, also beyond the range of int32. Each loop does one
  // thing: a page opens before the browser has compiled much of it.
  function undifference(out, j, {n, c}, bytes, at, width, order, values) {
    signed(n, bytes, at, width, values);
    for (let k = 0; k < order; k++) for (let i = 0, sum = 0; i < n; i++) values[i] = sum += values[i];
    for (let i = 0, o = j; i < n; i++, o += c) out[o] = values[i];
  }

  // (n, c) values in steps `q`, row by row; `plus` are arrays whose values are added. Numbers of things are an Int32Array.
  function quantised(spec, bytes, plus) {
    const {n, c, q, order, width} = spec,
      m = n * c,
      steps = Math.round(1 / q), // a power of ten: dividing by it gives the double nearest the decimal value
      out = steps > 1 || plus.length || spec.wide ? new Float64Array(m) : new Int32Array(m);
    const values = new Float64Array(n);
    for (let j = 0, at = spec.off; j < c; at += width[j++] * n) undifference(out, j, spec, bytes, at, width[j], order[j], values);
    for (const other of plus) for (let k = 0; k < m; k++) out[k] += Math.round(other[k] * steps);
    if (steps > 1) for (let k = 0; k < m; k++) out[k] /= steps;
    return out;
  }

  // n values by knots at some rows, straight between them over x; where x rests they are those of the knot before.
  function straight(n, at, knots, x) {
    const out = new Float64Array(n);
    for (let k = 0; k + 1 < at.length; k++) {
      const [a, b] = [at[k], at[k + 1]],
        span = x(b) - x(a);
      for (let i = a; i < b; i++) out[i] = knots[k] + (span > 0 ? (x(i) - x(a)) / span : 0) * (knots[k + 1] - knots[k]);
    }
    if (n) out[n - 1] = knots[at.length - 1];
    return out;
  }

  // (n) lengths along a path of whole steps of size q, in steps.
  function lengths(P, q) {
    const steps = Math.round(1 / q),
      n = P.length / 3,
      out = new Float64Array(n);
    for (let i = 1, k = 3, sum = 0; i < n; i++, k += 3) {
      const x = Math.round(P[k] * steps) - Math.round(P[k - 3] * steps),
        y = Math.round(P[k + 1] * steps) - Math.round(P[k - 2] * steps),
        z = Math.round(P[k + 2] * steps) - Math.round(P[k - 1] * steps);
      out[i] = sum += Math.sqrt(x * x + y * y + z * z);
    }
    return out;
  }

  // Values in steps that are almost straight over the length of a path: `rest` is what they are beyond that.
  function along({n, q}, at, knots, rest, length) {
    const out = straight(n, at, knots, i => length[i]),
      steps = Math.round(1 / q);
    for (let i = 0; i < n; i++) out[i] = (Math.floor(out[i] + 0.5) + rest[i]) / steps;
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

  // Lines of a text by their templates and numbers. A number is what is stored of it and what the positions of samples
  // predict: the sum of the arrays `of`, in whole steps of 1 nm.
  class Coded {
    constructor(arrays, spec) {
      Object.assign(this, {n: spec.n, spec, known: new Map()});
      [this.templates, this.template, this.rest] = [spec.templates, spec.template, spec.rest].map(name => arrays.get(name));
      this.at = spec.at === null ? null : arrays.get(spec.at);
      this.of = spec.of.map(name => arrays.get(name));
    }

    line(i) {
      if (i < 0 || i >= this.n) return "";
      const [first, ...parts] = this.parts(this.template[i]);
      return parts.reduce((text, [style, part]) => text + this.number(i, style) + part, first);
    }

    // The text of a template before its first number; and for each number its style and the text after it.
    parts(k) {
      if (!this.known.has(k)) {
        const [first, ...parts] = this.templates.line(k).split(this.spec.mark);
        this.known.set(k, [first, ...parts.map(part => [this.spec.styles[part.charCodeAt(0) - this.spec.first], part.slice(1)])]);
      }
      return this.known.get(k);
    }

    number(i, [k, decimals, least, trim, point]) {
      const {columns} = this.spec,
        column = columns[k],
        value = this.rest[i * columns.length + k] + (column.axis === null ? 0 : this.predicted(i, column)),
        digits = String(Math.abs(value)).padStart(column.decimals + 1, "0"),
        before = digits.length - column.decimals;
      let whole = digits.slice(0, before),
        end = before + decimals;
      if (trim) while (end > before && digits[end - 1] === "0") end--;
      if (whole === "0" && !least && end > before) whole = "";
      else if (whole.length < least) whole = whole.padStart(least, "0");
      return (value < 0 ? "-" : "") + whole + (end > before || point ? "." : "") + digits.slice(before, end);
    }

    predicted(i, {axis, nm, relative}) {
      const here = this.position(i, axis);
      return Math.floor((relative ? here - this.position(Math.max(0, i - 1), axis) : here) / nm + 0.5);
    }

    position(i, axis) {
      return this.of.reduce((sum, values) => sum + Math.round(values[3 * this.at[i] + axis] * 1e6), 0);
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
    length(path) {
      const key = path + "\n"; // no array has such a name
      if (!this.known.has(key)) this.known.set(key, lengths(this.get(path), this.specs[path].q));
      return this.known.get(key);
    }
    decode(spec) {
      if (spec.enc === "qd")
        return quantised(
          spec,
          this.bytes,
          (spec.plus ?? []).map(name => this.get(name)),
        );
      if (spec.enc === "raw") return new TYPES[spec.dtype](this.bytes.buffer, this.bytes.byteOffset + spec.off, spec.n * spec.c);
      if (spec.enc === "bent") return straight(spec.n, this.get(spec.at), this.get(spec.knots), i => i);
      if (spec.enc === "along")
        return along(spec, this.get(spec.at), this.get(spec.knots), this.get(spec.rest), this.length(spec.path));
      if (spec.enc === "lines") return new Coded(this, spec);
      if (spec.enc === "text") return new Lines(this.bytes.subarray(spec.off, spec.off + spec.bytes), spec.n);
      throw new Error(`unknown encoding ${spec.enc}`);
    }
  }

  OLP.unpack = async (manifest, text) => {
    if (manifest.schema !== "olp-review-1") throw new Error(`this page reads olp-review-1, not ${manifest.schema}`);
    return new Arrays(manifest.arrays, await inflate(text));
  };
})();
