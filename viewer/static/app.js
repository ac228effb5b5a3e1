"use strict";
// The state of the page and its consequences; every view listens here.
(() => {
  const listeners = new Map();
  OLP.on = (event, call) => listeners.set(event, [...(listeners.get(event) ?? []), call]);
  OLP.emit = event => (listeners.get(event) ?? []).forEach(call => call());

  const RANKED = 500;
  const NONE = [];

  class App {
    constructor(manifest, arrays) {
      Object.assign(this, {manifest, arrays});
      const get = name => arrays.get(name);
      this.base = get(manifest.base);
      this.rows = get(manifest.line);
      this.kind = get(manifest.rapid);
      this.waypoint = manifest.waypoint ? get(manifest.waypoint) : null;
      this.time = get(manifest.time);
      this.arc = get(manifest.way); // arc length, mm
      this.samples = this.time.length;
      this.end = this.time[this.samples - 1];
      this.layers = new Map();
      for (const spec of manifest.layers) {
        const own = spec.base && spec.base !== manifest.base,
          index = spec.index ? get(spec.index) : null;
        this.layers.set(
          spec.name,
          new OLP.Path(
            spec,
            get(spec.base ?? manifest.base),
            spec.delta ? get(spec.delta) : null,
            index,
            spec.kind ? get(spec.kind) : own || index ? null : this.kind,
          ),
        );
      }
      this.metrics = new OLP.Metrics(this);
      this.state = {
        time: this.time[0],
        sample_at: 0,
        sample: 0,
        row: this.rows[0],
        metric: "",
        layers: {nominal: true, whiskers: true, rapids: true},
        theme: "light",
        view: "iso",
        playing: false,
        chosen: NONE, // ranges [first, last] of samples
        notes: (manifest.notes ?? []).map(n => ({...n})),
        worst: -1,
        trail: false, // only the path up to the current time is drawn
      };
      this.mask = null; // by sample: 1 where it passes the filter
      this.runs();
      this.compose();
    }

    // First sample of each row of the listing, -1 where a row has no move.
    runs() {
      const rows = this.manifest.arrays[this.manifest.listing.row_nominal].n;
      this.first = new Int32Array(rows).fill(-1);
      for (let i = this.samples - 1; i >= 0; i--) if (this.rows[i] >= 0 && (i > 0 || this.first[this.rows[0]] < 0)) this.first[this.rows[i]] = i;
    }

    // How the segment that ends in each sample is drawn.
    compose() {
      const {kind, mask} = this,
        look = (this.look ??= new Uint8Array(this.samples));
      look.set(kind);
      if (mask) for (let i = 0; i < look.length; i++) if (!mask[i] && kind[i] !== OLP.GAP) look[i] = OLP.DIM;
      for (const [a, b] of this.state.chosen)
        for (let i = Math.max(0, a); i <= b && i < look.length; i++) look[i] += OLP.CHOSEN;
      for (const layer of this.layers.values()) {
        if (!layer.index && layer.n === look.length) {
          layer.look = look;
          continue;
        }
        layer.look ??= new Uint8Array(layer.n);
        for (let i = 0; i < layer.n; i++) {
          const at = layer.index ? layer.index[i] : Math.min(i, look.length - 1);
          layer.look[i] = layer.judged && layer.kind?.[i] ? OLP.RAPID : mask && !mask[at] ? OLP.DIM : look[at] & OLP.CHOSEN;
        }
      }
    }

    // Samples [a, b] of the run of a row that holds `near`, or else of its first run; null where it has no move.
    run(row, near = -1) {
      let a = near >= 0 && this.rows[near] === row ? near : (this.first[row] ?? -1);
      if (a < 0) return null;
      let b = a;
      while (a > 1 && this.rows[a - 1] === row) a--;
      while (b + 1 < this.samples && this.rows[b + 1] === row) b++;
      return [a, b];
    }

    // Sample (may be between two) at a time; constant in gaps.
    sample_of(time) {
      const i = OLP.find(this.time, time),
        j = Math.min(this.samples - 1, i + 1),
        span = this.time[j] - this.time[i];
      return i + (span > 0 && this.kind[j] !== OLP.GAP ? Math.min(1, Math.max(0, (time - this.time[i]) / span)) : 0);
    }

    time_of(sample) {
      const i = Math.max(0, Math.min(this.samples - 1, Math.floor(sample))),
        j = Math.min(this.samples - 1, i + 1);
      return this.time[i] + (sample - i) * (this.time[j] - this.time[i]);
    }

    set_time(time, sample = null) {
      const {state} = this;
      state.time = Math.max(this.time[0], Math.min(this.end, time));
      state.sample_at = sample ?? this.sample_of(state.time);
      state.sample = Math.ceil(state.sample_at - 1e-9);
      state.row = this.rows[state.sample];
      if (state.chosen.length && !state.chosen.some(([a, b]) => state.sample >= a && state.sample <= b)) this.choose(NONE);
      this.place();
      OLP.emit("time");
    }

    set_sample(sample) {
      this.set_time(this.time_of(sample), sample);
    }
    row_at() {
      return this.rows[this.state.sample];
    }

    // Marks ranges [first, last] of samples.
    choose(ranges) {
      if (!ranges.length && !this.state.chosen.length) return;
      this.state.chosen = ranges;
      this.compose();
      this.scene.schedule(30);
      OLP.emit("chosen");
    }

    // Draws faintly what is outside a filter; null is none.
    set_mask(mask) {
      this.mask = mask;
      this.mask_number = (this.mask_number ?? 0) + 1;
      this.compose();
      this.scene.schedule(30);
      OLP.emit("filter");
    }

    // By sample 1 where it is selected, else where it passes the filter; null where there is neither.
    kept() {
      const {chosen} = this.state;
      if (!chosen.length) return this.mask;
      const kept = new Uint8Array(this.samples);
      for (const [a, b] of chosen) kept.fill(1, Math.max(0, a), b + 1);
      return kept;
    }

    // How many points are kept, and by row of the listing 1 where one of them is.
    rows_of(kept) {
      const rows = new Uint8Array(this.first.length);
      let points = 0;
      for (let i = 0; i < kept.length; i++) {
        if (!kept[i]) continue;
        points++;
        if (this.rows[i] >= 0) rows[this.rows[i]] = 1;
      }
      return {points, rows};
    }

    // The deviation that the table states of a layer on a row, um; null where it states none.
    stated_um(name, row) {
      const own = this.manifest.listing.by_layer?.[name],
        value = own && row >= 0 ? this.arrays.get(own.um)[row] : -1;
      return value >= 0 ? value : null;
    }

    // The part of that which an unknown side of the backlash may be, um.
    side_um(name, row) {
      const own = this.manifest.listing.by_layer?.[name];
      return own?.side && row >= 0 ? Math.max(0, this.arrays.get(own.side)[row]) : 0;
    }

    // The largest deviation that the table states of a layer on rows that count; -1 where none does.
    largest_of(rows, name) {
      const own = this.manifest.listing.by_layer?.[name];
      if (!own) return -1;
      const [um, state] = [own.um, own.state].map(n => this.arrays.get(n)),
        shown = this.layers.get(name).index ? 2 : 1; // measured points count also where nothing judges them
      let most = -1;
      for (let row = 0; row < rows.length; row++) if (rows[row] && state[row] <= shown && um[row] > most) most = um[row];
      return most;
    }

    // How many of the rows the table says are above.
    above_of(rows, name) {
      const own = this.manifest.listing.by_layer?.[name],
        state = own ? this.arrays.get(own.state) : [];
      let count = 0;
      for (let row = 0; row < state.length; row++) if (rows[row] && state[row] === 1) count++;
      return count;
    }

    // Of what may be anything the ranges [first, last] of samples.
    ranges(value) {
      const whole = v => Number.isInteger(v) && v >= 0 && v < this.samples;
      return (Array.isArray(value) ? value : []).filter(r => Array.isArray(r) && whole(r[0]) && whole(r[1]) && r[0] <= r[1]);
    }

    // Marks the moves of a row; the tool goes to their end, without `stay`.
    select_row(row, stay = false) {
      const run = this.run(row, this.state.sample);
      if (run) {
        if (!stay) this.set_sample(run[1]);
        this.choose([run]);
        if (!stay) this.camera.reveal(this.tool_point());
      } else {
        this.choose(NONE);
        this.state.row = row;
      }
      OLP.emit("row");
    }

    step(direction) {
      const run = this.run(this.row_at(), this.state.sample) ?? [this.state.sample, this.state.sample];
      const to =
        direction > 0
          ? this.state.sample_at < run[1] - 1e-9
            ? run[1]
            : (this.run(this.rows[Math.min(this.samples - 1, run[1] + 1)], run[1] + 1)?.[1] ?? run[1])
          : run[0] - 1;
      this.set_sample(Math.max(0, Math.min(this.samples - 1, to)));
      OLP.emit("row");
    }

    // Shows or hides a layer that belongs to no picture, whiskers, rapids, or bodies of a role.
    set_layer(name, on) {
      const layer = this.layers.get(name);
      if (layer && this.pictures.of_layer(name)) return;
      if (!layer && !["rapids", "whiskers"].includes(name) && !Object.hasOwn(this.meshes.shown, name)) return;
      this.state.layers[name] = Boolean(on);
      if (Object.hasOwn(this.meshes.shown, name)) this.meshes.set_visible(name, Boolean(on));
      else this.pictures.draw();
      OLP.emit("layers");
    }

    // Draws rapids of one layer only: several would hide the path.
    show_rapids() {
      let free = this.state.layers.rapids;
      for (const {path, uniforms} of this.scene.lines.values()) {
        uniforms.rapids.value = free && path.visible && path.kind ? 1 : 0;
        if (uniforms.rapids.value) free = false;
      }
      this.scene.viewer.set_dirty();
    }

    // The quantity that colours show.
    get metric() {
      return this.metrics.find(this.state.metric);
    }
    // The deviation that is judged.
    get distance() {
      return this.metrics.find("magnitude") ?? this.manifest.metrics[0] ?? null;
    }

    set_metric(name) {
      this.state.metric = this.metrics.find(name) ? name : (this.distance?.name ?? "");
      this.metrics.keep([this.metric, this.distance]);
      this.pictures.rescale();
      OLP.emit("metric");
    }

    // Position of the tool (mm, enlarged).
    tool_point() {
      const {layer} = this.pictures;
      return layer.at(layer.own(this.state.sample_at), this.pictures.k_of(layer));
    }

    point_of(sample, name) {
      const layer = this.layers.get(name) ?? this.pictures.layer;
      return layer.at(layer.own(sample), this.pictures.k_of(layer));
    }

    place() {
      this.meshes.follow(this.tool_point(), this.state.sample_at);
      if (this.state.trail) this.scene.set_uniform("cut", this.state.sample_at);
      this.scene.viewer.set_dirty();
    }

    set_trail(on) {
      this.state.trail = document.getElementById("trail").checked = on;
      this.scene.set_uniform("cut", on ? this.state.sample_at : 1e9);
    }

    // The next line of the table of judgements by its deviation in the current picture, in a circle; returns
    // {rank, count, sample, row, value, layer} or null.
    worst(step = 1) {
      const name = this.pictures.layer.name;
      if (this.ranking?.name !== name) {
        this.ranking = {name, list: this.rank(name)};
        this.state.worst = -1;
      }
      const {list} = this.ranking;
      if (!list.length) return null;
      this.state.worst =
        this.state.worst < 0 ? (step > 0 ? 0 : list.length - 1) : (this.state.worst + step + list.length) % list.length;
      const {row, value} = list[this.state.worst],
        [sample] = this.places_of([row], name);
      this.set_sample(sample);
      this.select_row(row, true);
      this.camera.reveal(this.tool_point());
      return {rank: this.state.worst + 1, count: list.length, sample, row, value, layer: name};
    }

    // The rows that are judged, or where none is those that are shown, the one with the largest deviation first.
    rank(name) {
      const own = this.manifest.listing.by_layer?.[name];
      if (!own) return [];
      const [um, state] = [own.um, own.state].map(n => this.arrays.get(n)),
        most = state.some(code => code < 2) ? 1 : 2,
        counts = row => um[row] > 0 && this.first[row] >= 0 && state[row] <= most,
        sizes = Float64Array.from(um, (value, row) => (counts(row) ? value : 0)).sort(),
        least = sizes[Math.max(0, sizes.length - RANKED)],
        rows = [];
      for (let row = 0; row < um.length; row++) if (um[row] >= least && counts(row)) rows.push({row, value: um[row]});
      return rows.sort((p, q) => q.value - p.value || p.row - q.row).slice(0, RANKED);
    }

    // The sample of each row where the layer is off by what the table states, as nearly as it is shown.
    places_of(rows, name) {
      const values = this.metrics.values(this.distance, name),
        {index} = this.layers.get(name),
        sample = new Map(rows.map(row => [row, this.first[row]])),
        least = new Map();
      for (let i = 0; i < values.length; i++) {
        const at = index ? index[i] : i,
          row = this.rows[at];
        if (!sample.has(row)) continue;
        const off = Math.abs(values[i] - this.stated_um(name, row));
        if (off < (least.get(row) ?? Infinity)) {
          sample.set(row, at);
          least.set(row, off);
        }
      }
      return [...sample.values()];
    }
  }

  OLP.App = App;
  OLP.NONE = NONE;
})();
