"use strict";
// One path: base + k * deviation. All of it is on the CPU in blocks; the part for the view goes to the drawing buffer.
(() => {
  const BLOCK = 256,
    FLOATS = 16, // floats of one vertex: a0 a1 d0 d1 (3 each), side, value, sample, look
    SIDES = [-1, 1, -2, 2]; // of the corners: -1, 1 at the start, -2, 2 at the end
  const RAPID = 1,
    GAP = 2,
    WHISKER = 3,
    DIM = 4, // outside the filter
    CHOSEN = 8; // added to the look of what is selected
  const CHORD = 2; // least length of a drawn segment, px
  const WHISKERS = {apart: 14, most: 2500}; // px between whiskers; of a layer

  const BOXES = new WeakMap(); // of the blocks of a base

  class Path {
    // spec: the manifest's layer; P (n,3) mm; D (n,3) mm or null; index (n) nominal samples or null; kind (n) of the
    // segment that ends in a point. `look` (n) is how that is drawn: its kind, outside the filter, selected.
    constructor(spec, P, D, index, kind) {
      Object.assign(this, {
        name: spec.name,
        label: spec.label,
        width: spec.width || 2,
        dashes: spec.dashes ?? [1, 0],
        P,
        D,
        index,
        kind,
        judged: spec.judged !== false, // of a measured run that is not judged everything is drawn
        n: P.length / 3,
      });
      this.visible = true;
      this.look = null;
      this.values = null; // scalar of the present metric, or null
      this.blocks = Math.ceil(Math.max(0, this.n - 1) / BLOCK);
      [this.spread, this.need] = [0, 1].map(() => new Float64Array(this.blocks));
      this.bound();
      this.buffer = new Float32Array(0);
      this.drawn = 0;
    }

    // Boxes of the blocks and how far deviations go. Layers of one base have the same boxes.
    bound() {
      const {D, n, spread} = this;
      Object.assign(this, this.boxes());
      if (!D) return;
      for (let b = 0; b < this.blocks; b++) {
        const last = Math.min(n - 1, (b + 1) * BLOCK);
        let most = 0;
        for (let k = 3 * b * BLOCK; k <= 3 * last; k += 3) {
          const size = D[k] * D[k] + D[k + 1] * D[k + 1] + D[k + 2] * D[k + 2];
          if (size > most) most = size;
        }
        spread[b] = Math.sqrt(most);
      }
    }

    boxes() {
      const {P, n} = this,
        known = BOXES.get(P);
      if (known) return known;
      const [centre, radius, length] = [3, 1, 1].map(c => new Float64Array(c * this.blocks));
      for (let b = 0; b < this.blocks; b++) {
        const first = b * BLOCK,
          last = Math.min(n - 1, first + BLOCK),
          lo = [Infinity, Infinity, Infinity],
          hi = [-Infinity, -Infinity, -Infinity];
        let way = 0;
        for (let i = first, k = 3 * first; i <= last; i++, k += 3) {
          for (let j = 0; j < 3; j++) {
            const v = P[k + j];
            if (v < lo[j]) lo[j] = v;
            if (v > hi[j]) hi[j] = v;
          }
          if (i > first) way += Math.sqrt((P[k] - P[k - 3]) ** 2 + (P[k + 1] - P[k - 2]) ** 2 + (P[k + 2] - P[k - 1]) ** 2);
        }
        for (let j = 0; j < 3; j++) centre[3 * b + j] = (lo[j] + hi[j]) / 2;
        radius[b] = Math.hypot(hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]) / 2;
        length[b] = way;
      }
      BOXES.set(P, {centre, radius, length});
      return BOXES.get(P);
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

    // Whether the layer is known at a nominal sample: a measured one within its run, and not in a gap of it.
    knows(sample) {
      const {index} = this;
      if (!index) return true;
      if (!(sample >= index[0] && sample <= index[this.n - 1])) return false;
      const i = OLP.find(index, sample),
        j = Math.min(this.n - 1, i + 1);
      return !(this.judged && index[i] < sample && this.kind?.[j]);
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
    // A run of skipped samples never crosses a change of look, and keeps its largest value. Whiskers lead from the nominal
    // path to the drawn one, `apart` mm from each other.
    fill(cap, total, origin, apart) {
      const {D, look, index, values, n, need} = this,
        thin = total > cap ? total / (cap * 0.92) : 1,
        spare = D && apart ? Math.min(WHISKERS.most, n) : 0;
      this.reserve(Math.min(cap, n - 1) + spare);
      const out = this.buffer,
        room = out.length / (4 * FLOATS) - spare,
        whiskers = [];
      let c = 0,
        way = apart,
        before = GAP;
      for (let b = 0; b < this.blocks && c < room; b++) {
        if (!need[b]) continue;
        const first = b * BLOCK,
          last = Math.min(n - 1, first + BLOCK),
          stride = Math.max(1, Math.ceil((last - first) / Math.max(1, need[b] / thin)));
        for (let i = first; i < last && c < room;) {
          const what = look[i + 1],
            end = Math.min(last, i + stride);
          let j = i + 1,
            value = values ? values[j] : 0;
          for (; j < end && look[j + 1] === what; j++) {
            const next = values ? values[j + 1] : 0;
            if (next === next && !(Math.abs(next) <= Math.abs(value))) value = next;
          }
          const kind = what % CHOSEN;
          if (kind !== GAP) this.put(c++, i, j, value, index ? index[i] : i, what, origin);
          if (kind !== before) way = apart; // each stretch has one at its beginning
          before = kind;
          if (spare && kind === 0) {
            const {P} = this;
            way += Math.hypot(P[3 * j] - P[3 * i], P[3 * j + 1] - P[3 * i + 1], P[3 * j + 2] - P[3 * i + 2]);
            if (way >= apart && whiskers.length < spare) {
              whiskers.push(j);
              way = 0;
            }
          }
          i = j;
        }
      }
      for (const j of whiskers) this.whisker(c++, j, origin);
      this.drawn = c;
      this.thin = thin;
    }

    // Distance between whiskers in mm for a picture of `px` pixels per mm.
    apart(px) {
      let length = 0;
      for (let b = 0; b < this.blocks; b++) if (this.need[b]) length += this.length[b];
      return Math.max(WHISKERS.apart / px, length / WHISKERS.most);
    }

    whisker(c, j, origin) {
      const {P, D, buffer: out, index, values} = this;
      for (let v = 0, o = c * 4 * FLOATS; v < 4; v++, o += FLOATS) {
        for (let k = 0; k < 3; k++) {
          out[o + k] = out[o + 3 + k] = P[3 * j + k] - origin[k];
          out[o + 6 + k] = 0;
          out[o + 9 + k] = D[3 * j + k];
        }
        out[o + 12] = SIDES[v];
        out[o + 13] = values ? values[j] : 0;
        out[o + 14] = index ? index[j] : j;
        out[o + 15] = WHISKER;
      }
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
        out[o + 12] = SIDES[v];
        out[o + 13] = value;
        out[o + 14] = sample;
        out[o + 15] = what;
      }
    }

    // Nearest drawn point to the pixel (px, py) of the pane within `limit` pixels: {layer, at, distance} or null. Exact for any k.
    pick(view, px, py, limit, cut, rapids, plane) {
      const {clip: e, w, h, scale, k, ortho} = view,
        {P, D, look, index, n} = this;
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
            what = look[i] % CHOSEN;
          if (plane && plane[0] * P[j] + plane[1] * P[j + 1] + plane[2] * P[j + 2] > plane[3]) {
            joined = false;
            continue;
          }
          if (joined && what !== GAP && what !== DIM && (rapids || what !== RAPID) && s <= cut) {
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
  Object.assign(OLP, {Path, BLOCK, FLOATS, RAPID, GAP, WHISKER, DIM, CHOSEN});
})();
