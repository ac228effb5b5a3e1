"use strict";
// The state of the page and its consequences; every view listens here.
(() => {
  const listeners = new Map();
  OLP.on = (event, call) => listeners.set(event, [...(listeners.get(event) ?? []), call]);
  OLP.emit = event => (listeners.get(event) ?? []).forEach(call => call());

  const AXES = {light: ["#c8500a", "#00805d", "#0068a8"], dark: ["#ff9a5c", "#4fd0a5", "#6cbcf5"]};
  OLP.NEUTRAL = "#77818d";
  const JUDGED = ["measured", "corrected", "uncorrected", "command"];
  const RANKED = 500;

  class App {
    constructor(manifest, arrays) {
      Object.assign(this, {manifest, arrays});
      const get = name => arrays.get(name);
      this.base = get(manifest.base);
      this.rows = get(manifest.line);
      this.kind = get(manifest.rapid);
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
        exaggeration: 1,
        metric: "",
        layers: {},
        theme: "light",
        view: "iso",
        playing: false,
        rapids: true,
        span: [-1, -1],
        callouts: (manifest.callouts ?? []).map(c => ({...c})),
        worst: -1,
      };
      this.runs();
    }

    // First sample of each row of the listing, -1 where a row has no move.
    runs() {
      const rows = this.manifest.arrays[this.manifest.listing.row_nominal].n;
      this.first = new Int32Array(rows).fill(-1);
      for (let i = this.samples - 1; i > 0; i--) if (this.rows[i] >= 0) this.first[this.rows[i]] = i;
    }

    // Samples [a, b] of the run of a row that holds `near`, or else of its first run; null where it has no move.
    run(row, near = -1) {
      let a = near > 0 && this.rows[near] === row ? near : (this.first[row] ?? -1);
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
      if (state.sample <= state.span[0] || state.sample > state.span[1]) this.set_span([-1, -1]);
      this.place();
      OLP.emit("time");
    }

    set_sample(sample) {
      this.set_time(this.time_of(sample), sample);
    }
    row_at() {
      return this.rows[this.state.sample];
    }

    set_span(span) {
      if (span[0] === this.state.span[0] && span[1] === this.state.span[1]) return;
      this.state.span = span;
      this.scene.set_uniform("first", span[0]);
      this.scene.set_uniform("last", span[1]);
      this.scene.schedule(30);
      OLP.emit("span");
    }

    // Marks the moves of a row; the tool goes to their end, without `stay`.
    select_row(row, stay = false) {
      const run = this.run(row, this.state.sample);
      if (run) {
        if (!stay) this.set_sample(run[1]);
        this.set_span([run[0] - 1, run[1]]);
        if (!stay) this.camera.reveal(this.tool_point());
      } else {
        this.set_span([-1, -1]);
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

    set_exaggeration(k) {
      this.state.exaggeration = Math.max(1, Math.min(1e5, k || 1));
      for (const {path, uniforms} of this.scene.lines.values()) uniforms.k.value = path.D ? this.state.exaggeration : 0;
      this.place();
      this.scene.schedule();
      OLP.emit("exaggeration");
    }

    set_layer(name, on) {
      const layer = this.layers.get(name);
      if (layer) {
        layer.visible = this.state.layers[name] = Boolean(on);
        this.scene.viewer.set_property(["olp", name], "visible", layer.visible);
        this.show_rapids();
        this.scene.schedule(0);
        this.state.worst = -1;
        OLP.emit("layers");
      } else if (name === "rapids") {
        this.state.rapids = this.state.layers.rapids = Boolean(on);
        this.show_rapids();
        OLP.emit("layers");
      } else if (this.meshes.shown[name]) {
        this.state.layers[name] = Boolean(on);
        this.meshes.set_visible(name, Boolean(on));
        OLP.emit("layers");
      }
    }

    // Draws rapids of one layer only: several would hide the path.
    show_rapids() {
      let free = this.state.rapids;
      for (const {path, uniforms} of this.scene.lines.values()) {
        uniforms.rapids.value = free && path.visible && path.kind ? 1 : 0;
        if (uniforms.rapids.value) free = false;
      }
      this.scene.viewer.set_dirty();
    }

    set_metric(name) {
      this.state.metric = this.metrics.find(name) ? name : "";
      this.state.worst = -1;
      const metric = this.metrics.find(this.state.metric);
      this.metrics.keep([metric, this.plot_metric()]);
      this.scale.use(metric);
      this.scene.schedule(0);
      OLP.emit("metric");
    }

    // Gives the lines the values of the metric, or with `judges` their states in the table of judgements.
    colour_lines(judges) {
      const metric = this.metrics.find(this.state.metric);
      for (const {path, uniforms} of this.scene.lines.values()) {
        path.values = judges ? this.metrics.states(path.name) : this.metrics.values(metric, path.name);
        uniforms.coloured.value = path.values ? 1 : 0;
      }
      this.paint();
      this.scene.schedule(0);
    }

    // What a deviation is judged by: of the corrected program, and of what was measured.
    limits() {
      return [
        [this.manifest.tolerance_um, "corrected"],
        [this.manifest.part_tolerance_um, "measured"],
      ]
        .filter(([value]) => value > 0)
        .map(([value, label]) => ({value, label}));
    }

    // Without a metric layers have their own colours; with one, layers without values are grey.
    paint() {
      const metric = this.metrics.find(this.state.metric);
      for (const {path, uniforms} of this.scene.lines.values())
        uniforms.colour.value.set(metric && !path.values ? OLP.colour.readable(OLP.NEUTRAL, this.state.theme) : path.colour);
      this.scene.viewer.set_dirty();
    }

    // The metric of the plots while paths have the colours of their layers.
    plot_metric() {
      return this.metrics.find("magnitude") ?? this.manifest.metrics[0] ?? null;
    }

    // Layer of the tool, and the position of the tool (mm, enlarged).
    tool_layer() {
      return (
        ["corrected", "command", "nominal"].map(n => this.layers.get(n)).find(l => l?.visible) ?? this.layers.values().next().value
      );
    }
    tool_point() {
      const layer = this.tool_layer();
      return layer.at(layer.own(this.state.sample_at), this.state.exaggeration);
    }

    point_of(sample, name) {
      const layer = this.layers.get(name) ?? this.tool_layer();
      return layer.at(layer.own(sample), this.state.exaggeration);
    }

    place() {
      this.meshes.follow(this.tool_point(), this.state.sample_at);
      if (this.state.trail) this.scene.set_uniform("cut", this.state.sample_at);
      this.scene.viewer.set_dirty();
    }

    set_trail(on) {
      this.state.trail = on;
      this.scene.set_uniform("cut", on ? this.state.sample_at : 1e9);
    }

    axis_colour(i) {
      return AXES[this.state.theme][i % 3];
    }

    // Layer whose values are ranked and counted: the last state that is shown.
    judged(metric) {
      const names = this.metrics.layers(metric).filter(n => this.layers.get(n).visible);
      return JUDGED.map(p => names.find(n => n.startsWith(p))).find(Boolean) ?? names[0] ?? null;
    }

    // The next line of the table of judgements by its deviation, in a circle; returns {rank, count, sample, value, layer}
    // or null.
    worst(step = 1) {
      const name = this.judged(this.plot_metric());
      if (this.ranking?.name !== name) this.ranking = {name, list: this.rank(name)};
      const {list} = this.ranking;
      if (!list.length) return null;
      this.state.worst =
        this.state.worst < 0 ? (step > 0 ? 0 : list.length - 1) : (this.state.worst + step + list.length) % list.length;
      const {row, value} = list[this.state.worst],
        sample = this.largest_of(row, name);
      this.set_sample(sample);
      this.select_row(row, true);
      this.camera.reveal(this.tool_point());
      return {rank: this.state.worst + 1, count: list.length, sample, row, value, layer: name};
    }

    // The rows that count, the one with the largest deviation of the layer first; measured ones count all.
    rank(name) {
      const own = this.manifest.listing.by_layer?.[name];
      if (!own) return [];
      const [um, state] = [own.um, own.state].map(n => this.arrays.get(n)),
        rows = [];
      for (let row = 0; row < um.length; row++)
        if (um[row] > 0 && this.first[row] >= 0 && (state[row] < 2 || name.startsWith("measured"))) rows.push({row, value: um[row]});
      return rows.sort((p, q) => q.value - p.value || p.row - q.row).slice(0, RANKED);
    }

    // The sample of a row where the layer is shown farthest off.
    largest_of(row, name) {
      const values = this.metrics.values(this.plot_metric(), name),
        layer = this.layers.get(name);
      let sample = this.first[row],
        most = -1;
      for (let i = 0; i < values.length; i++) {
        const at = layer.index ? layer.index[i] : i;
        if (this.rows[at] === row && values[i] > most) [sample, most] = [at, values[i]];
      }
      return sample;
    }
  }

  OLP.App = App;
})();
