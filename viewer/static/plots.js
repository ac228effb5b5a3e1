"use strict";
// The two linked plots: deviation along the path, and the motion of each axis against its limits.
(() => {
  // [name, title, unit, text of the choice]
  const MOTIONS = [
    ["speed", "Speed", "mm/s", "path and feed"],
    ["velocity", "Velocity", "mm/s", "velocity"],
    ["acceleration", "Acceleration", "mm/s²", "acceleration"],
    ["jerk", "Jerk", "mm/s³", "jerk"],
    ["share", "Use of limits", "%", "use of limits"],
  ];

  class Plots {
    constructor(app) {
      this.app = app;
      this.abscissa = "time";
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
      };
      this.deviation = new OLP.Chart(hosts[0], events);
      this.charts = [this.deviation];
      const select = document.getElementById("motion");
      if (this.motion) {
        this.movement = new OLP.Chart(hosts[1], events);
        this.charts.push(this.movement);
        for (const [value, , , label] of MOTIONS) select.append(new Option(label, value));
        select.value = this.motion;
        select.onchange = () => {
          this.motion = select.value;
          this.draw_motion();
        };
      } else hosts[1].hidden = true;
      document.getElementById("abscissa").onchange = e => {
        this.abscissa = e.target.value;
        this.draw();
      };
      OLP.on("time", () => this.mark());
      OLP.on("theme", () => this.draw());
      OLP.on("metric", () => this.draw_deviation());
      OLP.on("layers", () => this.draw_deviation());
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
      return this.abscissa === "time" ? "time, s" : "distance along the path, mm";
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
      this.draw_deviation();
      this.draw_motion();
      this.mark();
    }

    draw_deviation() {
      const {app} = this,
        metric = app.metrics.find(app.state.metric) ?? app.plot_metric(),
        series = [];
      for (const name of app.metrics.layers(metric)) {
        const layer = app.layers.get(name);
        if (!layer.visible) continue;
        const x = layer.index
          ? this.cached(`${name} ${this.abscissa}`, () => Float64Array.from(layer.index, i => this.axis[i]))
          : this.axis;
        series.push({label: name, colour: layer.colour, x, y: app.metrics.values(metric, name)});
      }
      this.deviation.set({
        extent: this.extent,
        title: metric?.label ?? "Deviation",
        unit: OLP.colour.unit_label(metric?.unit),
        x_label: this.x_label,
        series,
        limits: metric?.judged ? app.limits() : [],
      });
    }

    draw_motion() {
      if (!this.movement) return;
      const {
          arrays,
          manifest: {motion},
        } = this.app,
        kind = this.motion;
      const x = this.motion_axis;
      let series,
        limits = [];
      if (kind === "speed") {
        series = [{label: "path", colour: this.app.axis_colour(2), x, y: arrays.get(motion.speed)}];
        if (motion.feed) series.push({label: "programmed", colour: this.app.axis_colour(0), x, y: arrays.get(motion.feed)});
      } else if (kind === "share") {
        series = motion.axes.map((axis, i) => ({
          label: axis.name,
          colour: this.app.axis_colour(i),
          x,
          y: this.cached("share " + axis.name, () => this.share(axis)),
        }));
        limits = [{value: 100}];
      } else {
        series = motion.axes.map((axis, i) => ({
          label: axis.name,
          colour: this.app.axis_colour(i),
          x,
          y: arrays.get(axis[kind]),
        }));
        limits = motion.axes
          .flatMap((axis, i) => [1, -1].map(sign => ({value: sign * axis[kind + "_limit"], colour: this.app.axis_colour(i)})))
          .filter(l => Number.isFinite(l.value));
      }
      const [, title, unit] = MOTIONS.find(m => m[0] === kind);
      this.movement.set({extent: this.extent, title, unit, x_label: this.x_label, series, limits, include: true});
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

    hover(x) {
      this.charts.forEach(c => c.set_mark("hover", x));
      this.app.hover_sample(x === null ? null : this.app.sample_of(this.time_at(x)));
    }
  }

  OLP.Plots = Plots;
})();
