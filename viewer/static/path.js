"use strict";
// One path: base + k * deviation. All of it is on the CPU in blocks; the part for the view goes to the drawing buffer.
(() => {
  const BLOCK = 256,
    FLOATS = 16; // floats of one vertex: a0 a1 d0 d1 (3 each), side, scalar, sample, kind
  const RAPID = 1,
    GAP = 2;
  const CHORD = 2; // least length of a drawn segment, px

  class Path {
    // spec: the manifest's layer; P (n,3) mm; D (n,3) mm or null; index (n) nominal samples or null; kind (N) of the segment ending in a sample
    constructor(spec, P, D, index, kind) {
      Object.assign(this, {
        name: spec.name,
        label: spec.label,
        colour: spec.colour,
        width: spec.width || 2,
        P,
        D,
        index,
        kind: kind,
        n: P.length / 3,
      });
      this.visible = spec.visible !== false;
      this.values = null; // scalar of the present metric, or null
      this.blocks = Math.ceil(Math.max(0, this.n - 1) / BLOCK);
      [this.centre, this.radius, this.spread, this.length, this.need] = [3, 1, 1, 1, 1].map(
        c => new Float64Array(c * this.blocks),
      );
      this.bound();
      this.buffer = new Float32Array(0);
      this.drawn = 0;
    }

    bound() {
      const {P, D, n} = this;
      for (let b = 0; b < this.blocks; b++) {
        const first = b * BLOCK,
          last = Math.min(n - 1, first + BLOCK),
          lo = [Infinity, Infinity, Infinity],
          hi = [-Infinity, -Infinity, -Infinity];
        let spread = 0,
          length = 0;
        for (let i = first, k = 3 * first; i <= last; i++, k += 3) {
          for (let j = 0; j < 3; j++) {
            const v = P[k + j];
            if (v < lo[j]) lo[j] = v;
            if (v > hi[j]) hi[j] = v;
          }
          if (D) spread = Math.max(spread, D[k] * D[k] + D[k + 1] * D[k + 1] + D[k + 2] * D[k + 2]);
          if (i > first) length += Math.sqrt((P[k] - P[k - 3]) ** 2 + (P[k + 1] - P[k - 2]) ** 2 + (P[k + 2] - P[k - 1]) ** 2);
        }
        for (let j = 0; j < 3; j++) this.centre[3 * b + j] = (lo[j] + hi[j]) / 2;
        this.radius[b] = Math.hypot(hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]) / 2;
        this.spread[b] = Math.sqrt(spread);
        this.length[b] = length;
      }
    }

    sample(i) {
      return this.index ? this.index[Math.min(i, this.n - 1)] : i;
    }

    // Position of the own index i (may be between two) at exaggeration k, mm.
    at(i, k, out = [0, 0, 0]) {
      const a = Math.max(0, Math.min(this.n - 1, Math.floor(i))),
        b = Math.min(this.n - 1, a + 1),
        f = Math.min(1, Math.max(0, i - a));
      for (let j = 0; j < 3; j++) {
        const p = this.P[3 * a + j] + (this.D ? k * this.D[3 * a + j] : 0),
          q = this.P[3 * b + j] + (this.D ? k * this.D[3 * b + j] : 0);
        out[j] = p + f * (q - p);
      }
      return out;
    }

    // Own index (may be between two) of a nominal sample.
    own(sample) {
      const index = this.index;
      if (!index) return Math.min(sample, this.n - 1);
      const i = OLP.find(index, sample),
        j = Math.min(this.n - 1, i + 1),
        span = index[j] - index[i];
      return i + (span > 0 ? Math.min(1, Math.max(0, (sample - index[i]) / span)) : 0);
    }

    // Segments wanted by block for the view {clip, w, h, scale, k, ortho}; returns their sum.
    demand({clip: e, w, h, scale, k, ortho}) {
      let total = 0;
      for (let b = 0; b < this.blocks; b++) {
        const X = this.centre[3 * b],
          Y = this.centre[3 * b + 1],
          Z = this.centre[3 * b + 2];
        const W = e[3] * X + e[7] * Y + e[11] * Z + e[15],
          x = e[0] * X + e[4] * Y + e[8] * Z + e[12],
          y = e[1] * X + e[5] * Y + e[9] * Z + e[13];
        const reach = this.radius[b] + k * this.spread[b],
          depth = ortho ? 1 : Math.max(W, 1e-5),
          near = ortho ? 1 : Math.max(W - reach * 0.001, depth * 0.05);
        this.need[b] = 0;
        if (!ortho && W < -reach * 0.001) continue;
        if (Math.abs(x) > depth + ((reach * scale) / w) * 2 || Math.abs(y) > depth + ((reach * scale) / h) * 2) continue;
        const count = Math.min(BLOCK, this.n - 1 - b * BLOCK);
        this.need[b] = Math.min(count, Math.max(1, ((this.length[b] + 2 * k * this.spread[b]) * scale) / near / CHORD));
        total += this.need[b];
      }
      return total;
    }

    // Fills the buffer with at most `cap` segments; positions are minus `origin`, so that float32 suffices at any zoom.
    // A run of skipped samples never crosses a change of kind or an end of the selection, and keeps its largest value.
    fill(cap, total, origin, selection) {
      const {P, D, kind, index, values, n, need} = this,
        thin = total > cap ? total / (cap * 0.92) : 1;
      this.reserve(Math.min(cap, n - 1));
      const out = this.buffer,
        room = out.length / (4 * FLOATS),
        [s0, s1] = selection;
      let c = 0;
      for (let b = 0; b < this.blocks && c < room; b++) {
        if (!need[b]) continue;
        const first = b * BLOCK,
          last = Math.min(n - 1, first + BLOCK),
          stride = Math.max(1, Math.ceil((last - first) / Math.max(1, need[b] / thin)));
        for (let i = first; i < last && c < room;) {
          const sample = index ? index[i] : i,
            what = kind ? kind[index ? index[i + 1] : i + 1] : 0,
            end = Math.min(last, i + stride);
          const stop = sample < s0 ? s0 : sample < s1 ? s1 : Infinity;
          let j = i + 1,
            value = values ? values[j] : 0;
          for (; j < end; j++) {
            const s = index ? index[j] : j;
            if (s >= stop || (kind && kind[index ? index[j + 1] : j + 1] !== what)) break;
            if (values && !(Math.abs(values[j + 1]) <= Math.abs(value)))
              value = Number.isNaN(values[j + 1]) ? value : values[j + 1];
          }
          if (what !== GAP) this.put(c++, i, j, value, sample, what, origin);
          i = j;
        }
      }
      this.drawn = c;
      this.thin = thin;
    }

    reserve(count) {
      if (this.buffer.length < count * 4 * FLOATS) this.buffer = new Float32Array(Math.max(64, count) * 4 * FLOATS);
    }

    put(c, i, j, value, sample, what, origin) {
      const {P, D, buffer: out} = this,
        a = 3 * i,
        z = 3 * j,
        [ox, oy, oz] = origin;
      for (let v = 0, o = c * 4 * FLOATS; v < 4; v++, o += FLOATS) {
        out[o] = P[a] - ox;
        out[o + 1] = P[a + 1] - oy;
        out[o + 2] = P[a + 2] - oz;
        out[o + 3] = P[z] - ox;
        out[o + 4] = P[z + 1] - oy;
        out[o + 5] = P[z + 2] - oz;
        if (D) {
          out[o + 6] = D[a];
          out[o + 7] = D[a + 1];
          out[o + 8] = D[a + 2];
          out[o + 9] = D[z];
          out[o + 10] = D[z + 1];
          out[o + 11] = D[z + 2];
        }
        out[o + 12] = v < 2 ? (v ? 1 : -1) : v === 3 ? 2 : -2;
        out[o + 13] = value;
        out[o + 14] = sample;
        out[o + 15] = what;
      }
    }

    // Nearest drawn point to the pixel (px, py) of the pane within `limit` pixels: {layer, at, distance} or null. Exact for any k.
    pick(view, px, py, limit, cut, rapids) {
      const {clip: e, w, h, scale, k, ortho} = view,
        {P, D, kind, index, n} = this;
      let best = null,
        nearest = limit * limit;
      for (let b = 0; b < this.blocks; b++) {
        const X = this.centre[3 * b],
          Y = this.centre[3 * b + 1],
          Z = this.centre[3 * b + 2],
          W = e[3] * X + e[7] * Y + e[11] * Z + e[15],
          reach = this.radius[b] + k * this.spread[b];
        const depth = ortho ? 1 : W - reach * 0.001;
        if (depth > 0) {
          const r = (reach * scale) / depth + Math.sqrt(nearest),
            x = (((e[0] * X + e[4] * Y + e[8] * Z + e[12]) / W + 1) / 2) * w - px,
            y = ((1 - (e[1] * X + e[5] * Y + e[9] * Z + e[13]) / W) / 2) * h - py;
          if (x * x + y * y > r * r * 1.1) continue;
        }
        const last = Math.min(n - 1, (b + 1) * BLOCK);
        for (let i = b * BLOCK, j = 3 * i, px0 = 0, py0 = 0, joined = false; i <= last; i++, j += 3) {
          const s = index ? index[i] : i,
            x = P[j] + (D ? k * D[j] : 0),
            y = P[j + 1] + (D ? k * D[j + 1] : 0),
            z = P[j + 2] + (D ? k * D[j + 2] : 0);
          const v = e[3] * x + e[7] * y + e[11] * z + e[15];
          if (v < 1e-6) {
            joined = false;
            continue;
          }
          const sx = (((e[0] * x + e[4] * y + e[8] * z + e[12]) / v + 1) / 2) * w,
            sy = ((1 - (e[1] * x + e[5] * y + e[9] * z + e[13]) / v) / 2) * h,
            what = kind ? kind[s] : 0;
          if (joined && what !== GAP && (rapids || what !== RAPID) && s <= cut) {
            const dx = sx - px0,
              dy = sy - py0,
              q = dx * dx + dy * dy,
              u = q > 0 ? Math.min(1, Math.max(0, ((px - px0) * dx + (py - py0) * dy) / q)) : 0;
            const d = (px0 + u * dx - px) ** 2 + (py0 + u * dy - py) ** 2;
            if (d < nearest) {
              nearest = d;
              best = {layer: this.name, at: i - 1 + u, distance: Math.sqrt(d)};
            }
          }
          px0 = sx;
          py0 = sy;
          joined = true;
        }
      }
      return best;
    }
  }

  // Last index whose value is not above x, in an ascending array.
  OLP.find = (array, x) => {
    let lo = 0,
      hi = array.length - 1;
    while (hi - lo > 1) {
      const mid = (lo + hi) >> 1;
      if (array[mid] <= x) lo = mid;
      else hi = mid;
    }
    return hi > lo && array[hi] <= x ? hi : lo;
  };
  Object.assign(OLP, {Path, BLOCK, FLOATS, RAPID, GAP});
})();
