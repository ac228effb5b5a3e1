"use strict";
// Values of a metric for each layer: packed ones, and those that follow from a layer's deviation.
(() => {
  const UPRIGHT = 1e-6; // a direction nearer to the tool's axis than this has no side

  class Metrics {
    constructor(app) {
      this.app = app;
      this.known = new Map();
      this.summaries = new Map();
      // The verdict of the line, as the table of judgements has it, is a way to colour as well.
      this.list = [...app.manifest.metrics];
      const layers = Object.keys(app.manifest.listing.by_layer ?? {});
      if (layers.length)
        this.list.push({
          name: "state",
          label: "verdict of the line",
          unit: "",
          kind: "state",
          by_layer: Object.fromEntries(layers.map(n => [n, null])),
        });
    }

    find(name) {
      return this.list.find(m => m.name === name) ?? null;
    }

    layers(metric) {
      return metric ? Object.keys(metric.by_layer).filter(name => this.app.layers.has(name)) : [];
    }

    // (n) values in the metric's unit for a layer, NaN where unknown and in rapids, which do not cut; null where the
    // metric has none for the layer.
    values(metric, name) {
      if (!metric || !(name in metric.by_layer) || !this.app.layers.has(name)) return null;
      const key = metric.name + "\n" + name;
      if (!this.known.has(key)) {
        const packed = metric.by_layer[name],
          layer = this.app.layers.get(name);
        const values =
          metric.kind === "state"
            ? this.states(layer)
            : packed === null
              ? this.derive(metric.of, layer)
              : Float32Array.from(this.app.arrays.get(packed));
        const {kind} = layer;
        if (kind) for (let i = 0; i < values.length; i++) if (kind[i]) values[i] = NaN;
        this.known.set(key, values);
      }
      return this.known.get(key);
    }

    // (n) states of a layer in the table of judgements, by the line of each sample: 1 within, 2 above, NaN for what is
    // not judged.
    states(layer) {
      const own = this.app.manifest.listing.by_layer[layer.name],
        state = this.app.arrays.get(own.state),
        {rows} = this.app,
        {index} = layer;
      return Float32Array.from({length: layer.n}, (_, i) => {
        const code = state[rows[index ? index[i] : i]];
        return code > 1 ? NaN : code + 1;
      });
    }

    // Metrics other than these are dropped from memory.
    keep(metrics) {
      const names = new Set(metrics.filter(Boolean).map(m => m.name));
      for (const key of this.known.keys()) if (!names.has(key.split("\n")[0])) {
          this.known.delete(key);
          this.summaries.delete(key);
        }
    }

    derive(part, layer) {
      const {n, D} = layer,
        out = new Float32Array(n);
      if (!D) return out;
      if (part === "magnitude") this.distance(layer, out);
      else if (part === "x" || part === "y" || part === "z")
        for (let i = 0, k = "xyz".indexOf(part); i < n; i++, k += 3) out[i] = 1e3 * D[k];
      else this.split(part, layer, out);
      return out;
    }

    // What counts, as in the proof: at waypoints the distance from the nominal point, between them the distance from the
    // path of the move; of measured points the distance.
    distance(layer, out) {
      const {n, D, index} = layer,
        {waypoint} = this.app;
      if (!index && waypoint) this.split("path", layer, out);
      for (let i = 0, k = 0; i < n; i++, k += 3)
        if (index || !waypoint || waypoint[i])
          out[i] = 1e3 * Math.sqrt(D[k] * D[k] + D[k + 1] * D[k + 1] + D[k + 2] * D[k + 2]);
    }

    // Parts by the direction of the nominal segment that ends in the sample: along it; normal, to its left in the plane
    // across Z; binormal, which completes the two (up on a level path); across, the size of the last two.
    // Path: across, or the distance from the start of the move where the tip is behind it, or from its end where beyond.
    split(part, {n, D, index}, out) {
      const P = this.app.base,
        {waypoint} = this.app,
        u = [1, 0, 0],
        side = [0, 1, 0],
        far = (a, b) => Math.sqrt((P[a] - P[b]) ** 2 + (P[a + 1] - P[b + 1]) ** 2 + (P[a + 2] - P[b + 2]) ** 2),
        same = (a, b) => P[a] === P[b] && P[a + 1] === P[b + 1] && P[a + 2] === P[b + 2];
      let begins = false;
      for (let i = 0, k = 0; i < n; i++, k += 3) {
        const s = index ? index[i] : i,
          a = 3 * s;
        let done = Infinity,
          left = Infinity,
          next = a;
        // between waypoints from the sample before to the one behind, which on arcs is the tangent
        if (waypoint && !waypoint[s] && a + 5 < P.length) {
          const opened = begins || waypoint[s - 1] === 1;
          begins = s === 0 || (opened && same(a, a - 3));
          next = a + 3;
          // a start may be there twice, before and after backlash is taken up
          if (begins && !waypoint[s + 1] && a + 8 < P.length && same(a, next)) next += 3;
          if (part === "path") {
            done = begins ? 0 : opened ? far(a, a - 3) : Infinity;
            left = waypoint[next / 3] ? far(a, next) : Infinity;
          }
        } else begins = false;
        if (s > 0 || next) {
          const from = s > 0 ? a - 3 : 0,
            x = P[next] - P[from],
            y = P[next + 1] - P[from + 1],
            z = P[next + 2] - P[from + 2];
          const length = Math.sqrt(x * x + y * y + z * z);
          if (length > 0) {
            u[0] = x / length;
            u[1] = y / length;
            u[2] = z / length;
            const flat = Math.sqrt(u[0] * u[0] + u[1] * u[1]);
            side[0] = flat > UPRIGHT ? -u[1] / flat : 0;
            side[1] = flat > UPRIGHT ? u[0] / flat : 1;
          }
        }
        const along = D[k] * u[0] + D[k + 1] * u[1] + D[k + 2] * u[2],
          normal = D[k] * side[0] + D[k + 1] * side[1];
        let value;
        if (part === "along") value = along;
        else if (part === "normal") value = normal;
        else if (part === "binormal")
          value = -D[k] * u[2] * side[1] + D[k + 1] * u[2] * side[0] + D[k + 2] * (u[0] * side[1] - u[1] * side[0]);
        else {
          if (part !== "across" && part !== "path") throw new Error(`unknown metric part ${part}`);
          const off = Math.max(-done, Math.min(left, along)),
            x = D[k] - off * u[0],
            y = D[k + 1] - off * u[1],
            z = D[k + 2] - off * u[2];
          value = Math.sqrt(x * x + y * y + z * z);
        }
        out[i] = 1e3 * value;
      }
    }

    // Largest |value|, mean and rms of the points of a layer, of all or of those of the samples that are kept.
    summary(metric, name, kept = null) {
      const values = this.values(metric, name);
      if (!values) return null;
      const {index} = this.app.layers.get(name);
      if (kept) return this.summarise(values, i => kept[index ? index[i] : i]);
      const key = metric.name + "\n" + name;
      if (!this.summaries.has(key)) this.summaries.set(key, this.summarise(values, null));
      return this.summaries.get(key);
    }

    summarise(values, keeps) {
      let count = 0,
        sum = 0,
        squares = 0,
        low = Infinity,
        high = -Infinity;
      for (let i = 0; i < values.length; i++) {
        const v = values[i];
        if (v !== v || (keeps && !keeps(i))) continue;
        count++;
        sum += v;
        squares += v * v;
        if (v < low) low = v;
        if (v > high) high = v;
      }
      if (!count) return null;
      return {
        count,
        low,
        high,
        largest: Math.max(Math.abs(low), Math.abs(high)),
        mean: sum / count,
        rms: Math.sqrt(squares / count),
      };
    }
  }

  OLP.Metrics = Metrics;
})();
