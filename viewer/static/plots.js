"use strict";
// The linked charts: the strip of the error along the path, and the motion of each axis against its limits.
(() => {
  const $ = id => document.getElementById(id);
  // [name, metrics of the lanes, text of the choice]; without metrics the lanes are the pictures, each with its own scale
  const STRIPS = [
    ["frame", ["normal", "binormal", "along"], "along and across"],
    ["axes", ["x", "y", "z"], "X, Y, Z"],
    ["pictures", null, "size, by picture"],
  ];
  // [name, title, unit behind that of an axis or of the path, text of the choice]
  const MOTIONS = [
    ["speed", "Speed", "/s", "speed"],
    ["velocity", "Velocity", "/s", "velocity"],
    ["acceleration", "Acceleration", "/s²", "acceleration"],
    ["jerk", "Jerk", "/s³", "jerk"],
    ["share", "Use of limits", "%", "use of limits"],
  ];
  const UNITS = {mm: "mm", deg: "°"};
  const DASHES = [
    [1, 0],
    [8, 3],
    [2, 3],
  ];

  const STEP = 0.02; // of the window, by which a key moves the end of a range

  class Plots {
    constructor(app) {
      this.app = app;
      this.abscissa = "way";
      this.kind = "frame";
      this.motion = app.manifest.motion ? "speed" : null;
      this.cache = new Map();
      const hosts = document.querySelectorAll("#plots .plot");
      const events = {
        hover: x => this.hover(x),
        click: x => {
          app.set_time(this.time_at(x));
          app.select_row(app.row_at(), true);
        },
        zoom: range => this.charts.forEach(c => c.set_range(range)),
        span: (range, last) => this.span(range, last),
        extend: direction => this.extend(direction),
      };
      this.strip = new OLP.Chart(hosts[0], events);
      this.charts = [this.strip];
      for (const [value, metrics, label] of STRIPS)
        if (!metrics || metrics.every(n => app.metrics.find(n))) $("strip").append(new Option(label, value));
      $("strip").onchange = e => this.set_strip(e.target.value);
      this.set_strip($("strip").options[0].value);
      if (this.motion) {
        this.movement = new OLP.Chart(hosts[1], events);
        this.charts.push(this.movement);
        for (const [value, , , label] of MOTIONS) $("motion").append(new Option(label, value));
        $("motion").value = this.motion;
        $("motion").onchange = e => this.set_motion(e.target.value);
      } else hosts[1].hidden = true;
      $("abscissa").onchange = e => this.set_abscissa(e.target.value);
      OLP.on("time", () => this.mark());
      OLP.on("theme", () => this.draw());
      for (const event of ["picture", "scale"]) OLP.on(event, () => this.draw_strip());
      for (const event of ["chosen", "filter"]) OLP.on(event, () => this.draw_chosen());
    }

    // Ascending abscissa of the nominal samples.
    get axis() {
      return this.abscissa === "time" ? this.app.time : this.app.arc;
    }
    // Ascending abscissa of the samples of the motion.
    get motion_axis() {
      const time = this.app.arrays.get(this.app.manifest.motion.time);
      return this.abscissa === "time" ? time : this.cached("motion arc", () => Float64Array.from(time, t => this.x_of(t)));
    }
    // First and last abscissa of all charts, so that one window is the same place in each.
    get extent() {
      const ends = [this.axis, ...(this.movement ? [this.motion_axis] : [])]
        .filter(x => x.length)
        .flatMap(x => [x[0], x[x.length - 1]]);
      return ends.length ? [Math.min(...ends), Math.max(...ends)] : [0, 1];
    }
    get x_label() {
      return this.abscissa === "time" ? "time, s" : "distance, mm";
    }
    time_at(x) {
      return this.abscissa === "time" ? x : this.between(this.app.arc, this.app.time, x);
    }
    x_of(time) {
      return this.abscissa === "time" ? time : this.between(this.app.time, this.app.arc, time);
    }

    between(from, to, x) {
      const i = OLP.find(from, x),
        j = Math.min(from.length - 1, i + 1),
        span = from[j] - from[i];
      return to[i] + (span > 0 ? Math.min(1, Math.max(0, (x - from[i]) / span)) : 0) * (to[j] - to[i]);
    }

    draw() {
      this.charts.forEach(c => {
        c.range = null;
      });
      this.draw_strip();
      this.draw_motion();
      this.draw_chosen();
      this.mark();
    }

    // What the page does not have changes nothing.
    set_abscissa(name) {
      if (name !== "way" && name !== "time") return;
      $("abscissa").value = this.abscissa = name;
      this.draw();
    }

    set_motion(name) {
      if (!this.movement || !MOTIONS.some(([known]) => known === name)) return;
      $("motion").value = this.motion = name;
      this.draw_motion();
    }

    set_strip(kind) {
      if (![...$("strip").options].some(o => o.value === kind)) return;
      $("strip").value = this.kind = kind;
      this.cache.clear();
      this.draw_strip();
    }

    abscissa_of(layer) {
      return layer.index
        ? this.cached(`${layer.name} ${this.abscissa}`, () => Float64Array.from(layer.index, i => this.axis[i]))
        : this.axis;
    }

    // Series of the layers of a picture in a metric.
    series(picture, metric) {
      const {app} = this;
      return picture.layers.flatMap((name, k) => {
        const layer = app.layers.get(name),
          y = this.cached(`${metric.name} ${name}`, () => app.metrics.values(metric, name));
        return y ? [{label: picture.label, dashes: DASHES[k % 3], x: this.abscissa_of(layer), y}] : [];
      });
    }

    // Of the current picture the parts of the error, or of every picture its size.
    draw_strip() {
      const {app} = this,
        {pictures, metrics} = app,
        names = STRIPS.find(([name]) => name === this.kind)[1],
        {current} = pictures;
      if (!current || !app.scene) return;
      const limits = picture => {
        const value = app.metric?.judged ? picture.scale?.tolerance : pictures.tolerance(picture);
        return value ? [{value}] : [];
      };
      const lane = (title, picture, metric, limit) => ({title, unit: OLP.colour.unit_label(metric.unit), series: this.series(picture, metric), limits: limit});
      const lanes = names
        ? names.map(name => {
            const metric = metrics.find(name);
            return lane(metric.label, current, metric, limits(current).flatMap(({value}) => [{value}, {value: -value}]));
          })
        : pictures.list.map(picture => lane(picture.label, picture, app.distance, limits(picture)));
      metrics.keep([app.metric, app.distance]);
      this.strip.title = names ? `Error, ${current.label}` : "Size of the error";
      this.strip.set({extent: this.extent, x_label: this.x_label, lanes, alike: Boolean(names)});
    }

    draw_motion() {
      if (!this.movement) return;
      const {
          arrays,
          manifest: {motion},
        } = this.app,
        kind = this.motion;
      const x = this.motion_axis;
      const [, title, rate] = MOTIONS.find(m => m[0] === kind);
      let lanes;
      if (kind === "speed") {
        const series = [{label: "path", dashes: DASHES[0], x, y: arrays.get(motion.speed)}];
        if (motion.feed) series.push({label: "programmed", dashes: DASHES[1], x, y: arrays.get(motion.feed)});
        lanes = [{title, unit: "mm" + rate, series, limits: []}];
      } else lanes = this.states(kind, title, rate, x);
      this.movement.title = title;
      this.movement.set({extent: this.extent, x_label: this.x_label, lanes: lanes.map(lane => ({...lane, include: true}))});
    }

    // Lanes of a state of the axes, or of their use of limits: up to three axes of one unit share one.
    states(kind, title, rate, x) {
      const {axes} = this.app.manifest.motion,
        used = kind === "share",
        units = [...new Set(axes.map(axis => (used ? "" : axis.unit)))],
        groups = units.flatMap(unit => {
          const own = axes.filter(axis => used || axis.unit === unit);
          return own.length > DASHES.length ? own.map(axis => [axis]) : [own];
        });
      return groups.map(own => {
        const unit = used ? rate : UNITS[own[0].unit] + rate,
          names = own.map(axis => axis.name).join(", "),
          series = own.map((axis, i) => ({
            label: axis.name,
            dashes: DASHES[i],
            x,
            y: used ? this.cached("share " + axis.name, () => this.share(axis)) : this.app.arrays.get(axis[kind]),
          })),
          limits = used ? [{value: 100}] : own.flatMap(axis => [1, -1].map(sign => ({value: sign * axis[kind + "_limit"]})));
        return {
          title: groups.length === 1 ? title : units.length > 1 ? `${names} in ${unit}` : names,
          unit,
          series,
          limits: limits.filter(l => Number.isFinite(l.value)),
        };
      });
    }

    // Largest of velocity, acceleration and jerk of an axis as a share of its limits, %.
    share(axis) {
      const parts = ["velocity", "acceleration", "jerk"]
        .filter(k => axis[k + "_limit"] > 0)
        .map(k => [this.app.arrays.get(axis[k]), 100 / axis[k + "_limit"]]);
      return Float32Array.from(this.app.arrays.get(axis.velocity), (_, i) =>
        Math.max(...parts.map(([values, f]) => Math.abs(values[i]) * f)),
      );
    }

    cached(key, make) {
      if (!this.cache.has(key)) this.cache.set(key, make());
      return this.cache.get(key);
    }

    mark() {
      const x = this.x_of(this.app.state.time);
      this.charts.forEach(c => c.set_mark("now", x));
    }

    // Marks what is selected, else the lines that are kept.
    draw_chosen() {
      const {app} = this,
        {chosen} = app.state,
        bands = (chosen.length ? chosen : this.lines()).map(([a, b]) => [this.axis[Math.max(0, a - 1)], this.axis[b]]);
      this.charts.forEach(c => c.set_bands(bands));
    }

    // The range of samples of the lines that are kept, in a list; none where all are.
    lines() {
      const {app} = this,
        [first, last] = app.filter?.lines ?? [null, null];
      if (first === null && last === null) return [];
      let a = -1,
        b = -1;
      for (let i = 0; i < app.samples; i++)
        if (app.rows[i] >= (first ?? 0) && app.rows[i] <= (last ?? Infinity)) {
          if (a < 0) a = i;
          b = i;
        }
      return a < 0 ? [] : [[a, b]];
    }

    // Marks a range of the abscissa while it is dragged, and at its end keeps the lines that are in it; null keeps all.
    span(range, last) {
      const {app} = this;
      if (!last && range) {
        const [a, b] = [...range].sort((p, q) => p - q);
        this.charts.forEach(c => c.set_bands([[a, b]]));
        return;
      }
      if (last) {
        const [first, end] = range ? this.rows_between(range) : [null, null];
        this.keep(first, end);
        this.ends = first === null ? null : [first, end];
      }
      this.draw_chosen();
    }

    keep(first, last) {
      const {app} = this;
      app.choose(OLP.NONE);
      app.filter.set_lines(first, last);
      if (first === null) return;
      $("filter").open = true;
      app.listing.show(first);
    }

    // First and last row of the listing with a move in a range of the abscissa.
    rows_between(range) {
      const {app} = this,
        [a, b] = [...range].sort((p, q) => p - q).map(x => Math.ceil(app.sample_of(this.time_at(x)) - 1e-9));
      let first = null,
        last = null;
      for (let i = Math.max(0, a); i <= Math.min(app.samples - 1, b); i++) {
        const row = app.rows[i];
        if (row < 0) continue;
        if (first === null || row < first) first = row;
        if (last === null || row > last) last = row;
      }
      return [first, last];
    }

    // Moves the end of the range of lines from the current one to the next line with a move, or by a small part of the
    // window where that is farther.
    extend(direction) {
      const {app} = this,
        [low, high] = app.filter.lines,
        same = this.ends && Math.min(...this.ends) === low && Math.max(...this.ends) === high,
        [fixed, end] = same ? this.ends : [app.row_at(), app.row_at()],
        run = app.run(end);
      if (!run) return;
      let to = end + direction;
      while (to >= 0 && to < app.first.length && app.first[to] < 0) to += direction;
      if (to < 0 || to >= app.first.length) to = end;
      const [a, b] = this.strip.window,
        x = this.axis[run[direction > 0 ? 1 : 0]] + direction * STEP * (b - a),
        [far] = this.rows_between([x, x]);
      if (far !== null && (far - to) * direction > 0) to = far;
      this.ends = [fixed, to];
      this.keep(Math.min(fixed, to), Math.max(fixed, to));
    }

    hover(x) {
      this.charts.forEach(c => c.set_mark("hover", x));
      this.app.hover_sample(x === null ? null : this.app.sample_of(this.time_at(x)));
    }
  }

  OLP.Plots = Plots;
})();
