"use strict";
// The colours of the values: range, steps, pass or fail, and the colour bar.
(() => {
  const $ = id => document.getElementById(id),
    BINS = 60;

  class Scale {
    constructor(app) {
      this.app = app;
      Object.assign(this, {
        min: 0,
        max: 1,
        mode: "continuous",
        map: "ember",
      });
      const {manifest} = app,
        select = $("metric");
      select.append(new Option("layer", ""), ...this.groups(manifest.metrics));
      for (const [name, {label}] of Object.entries(OLP.colour.MAPS)) $("map").append(new Option(label, name));
      select.onchange = () => app.set_metric(select.value);
      $("scale-mode").onchange = e => {
        this.mode = e.target.value;
        this.apply();
      };
      $("map").onchange = e => {
        this.map = e.target.value;
        this.apply();
      };
      $("scale-auto").onclick = () => {
        this.automatic();
        this.apply();
      };
      for (const [id, end] of [
        ["scale-min", "min"],
        ["scale-max", "max"],
      ])
        $(id).onchange = e => this.edit(end, e.target.value);
      $("allowed").textContent = app
        .limits()
        .map(({value, label}) => `${OLP.colour.um(value)} µm, ${label}`)
        .join("; ");
      $("exaggeration").onchange = e => app.set_exaggeration(OLP.parse(e.target.value));
      $("exaggeration-slider").oninput = e => app.set_exaggeration(+(10 ** +e.target.value).toPrecision(2));
      OLP.on("exaggeration", () => {
        const k = app.state.exaggeration;
        $("exaggeration").value = k.toLocaleString("en", {maximumFractionDigits: 2, useGrouping: true});
        $("exaggeration-slider").value = Math.log10(k);
      });
      OLP.on("layers", () => this.draw());
      new ResizeObserver(() => this.draw()).observe($("colour-bar"));
    }

    groups(metrics) {
      const own = metrics.filter(m => !m.name.startsWith("source:")),
        sources = metrics.filter(m => m.name.startsWith("source:")),
        option = m => new Option(m.label, m.name);
      if (!sources.length) return own.map(option);
      const group = Object.assign(document.createElement("optgroup"), {label: "by error source"});
      group.append(...sources.map(option));
      return [...own.map(option), group];
    }

    use(metric) {
      this.metric = metric;
      $("metric").value = metric?.name ?? "";
      this.automatic();
      this.apply();
    }

    get kind() {
      return this.metric?.kind ?? "sequential";
    }

    // Whether colours are the states of the table: its verdict, which this page does not compute.
    get judges() {
      return this.mode === "states" && Boolean(this.metric?.judged);
    }

    // A round number that no value of a feed move on the metric's layers exceeds.
    automatic() {
      if (!this.metric) return;
      const parts = this.app.metrics
        .layers(this.metric)
        .map(name => this.app.metrics.summary(this.metric, name))
        .filter(Boolean);
      const top = OLP.colour.round_up(Math.max(1e-6, ...parts.map(p => p.largest)));
      [this.min, this.max] = [this.kind === "diverging" ? -top : 0, top];
    }

    edit(end, text) {
      const value = OLP.parse(text);
      if (Number.isFinite(value)) {
        this[end] = value;
        if (this.kind === "diverging") [this.min, this.max] = [-Math.abs(value), Math.abs(value)]; // zero is in the middle of its colours
      }
      if (!(this.max > this.min)) this.automatic();
      this.apply();
    }

    set_range(min, max) {
      Object.assign(this, {min, max});
      this.apply();
    }

    apply() {
      const {app, judges} = this;
      this.scheme = {
        kind: this.kind,
        mode: this.mode === "states" && !judges ? "continuous" : this.mode,
        map: this.map,
        theme: app.state.theme,
        min: this.min,
        max: this.max,
      };
      app.colour_lines(judges);
      // states are 1 and 2
      app.scene.set_uniform("low", judges ? 0.5 : this.min);
      app.scene.set_uniform("high", judges ? 2.5 : this.max);
      app.scene.set_colours(OLP.colour.table(this.scheme));
      const text = v => String(+v.toPrecision(6));
      $("scale-min").value = text(this.min);
      $("scale-max").value = text(this.max);
      $("scale-mode").value = this.mode;
      $("map").value = this.map;
      $("map").disabled = this.kind === "diverging" || judges;
      for (const id of ["scale-min", "scale-max", "scale-auto", "scale-mode"]) $(id).disabled = !this.metric;
      this.draw();
    }

    // Share of the samples by value, for the judged layer.
    histogram() {
      const name = this.app.judged(this.metric),
        values = name && this.app.metrics.values(this.metric, name),
        bins = new Float64Array(BINS);
      if (!values) return bins;
      const stride = Math.max(1, Math.floor(values.length / 2e5));
      for (let i = 0; i < values.length; i += stride) {
        const at = (values[i] - this.min) / (this.max - this.min);
        if (at >= 0 && at <= 1) bins[Math.min(BINS - 1, Math.floor(at * BINS))]++;
      }
      const most = Math.max(1, ...bins);
      return bins.map(v => Math.sqrt(v / most));
    }

    draw() {
      const box = $("legend"),
        canvas = $("colour-bar");
      box.hidden = !this.metric;
      if (!this.metric || !this.scheme) return;
      const {colour} = OLP,
        unit = colour.unit_label(this.metric.unit),
        ratio = window.devicePixelRatio || 1,
        w = canvas.clientWidth,
        h = canvas.clientHeight,
        c = canvas.getContext("2d");
      $("legend-title").textContent = this.judges ? "line" : `${this.metric.label}${unit ? ", " + unit : ""}`;
      Object.assign(canvas, {width: Math.round(w * ratio), height: Math.round(h * ratio)});
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      const style = getComputedStyle(document.documentElement),
        ink = style.getPropertyValue("--ink").trim(),
        bar = {x: 30, y: 8, w: 14, h: h - 16};
      c.font = "11px " + style.getPropertyValue("--font").trim();
      for (let y = 0; y < bar.h; y++) {
        c.fillStyle = `rgb(${colour.rgb(this.scheme, 1 - (y + 0.5) / bar.h).map(Math.round)})`;
        c.fillRect(bar.x, bar.y + y, bar.w, 1.5);
      }
      if (this.judges) {
        this.draw_states(c, bar, ink);
        return;
      }
      c.fillStyle = style.getPropertyValue("--soft").trim();
      this.histogram().forEach((share, i) => {
        if (share > 0)
          c.fillRect(bar.x - 4 - 24 * share, bar.y + (1 - (i + 1) / BINS) * bar.h, 24 * share, Math.max(1, bar.h / BINS - 0.5));
      });
      const y_of = v => bar.y + (1 - (v - this.min) / (this.max - this.min)) * bar.h;
      Object.assign(c, {fillStyle: ink, strokeStyle: ink, textBaseline: "middle", lineWidth: 1});
      for (const v of colour.ticks(this.min, this.max, h / 32)) {
        c.fillRect(bar.x + bar.w, Math.round(y_of(v)), 4, 1);
        c.fillText(colour.number(v, 4), bar.x + bar.w + 8, y_of(v));
      }
      if (!this.metric.judged) return;
      for (const {value} of this.app.limits()) {
        if (value < this.min || value > this.max) continue;
        c.lineWidth = 2;
        c.strokeRect(bar.x - 2, Math.round(y_of(value)), bar.w + 4, 0.5);
      }
    }

    draw_states(c, bar, ink) {
      Object.assign(c, {fillStyle: ink, textBaseline: "middle"});
      c.fillText("above", bar.x + bar.w + 8, bar.y + bar.h / 4);
      c.fillText("within", bar.x + bar.w + 8, bar.y + (3 * bar.h) / 4);
    }
  }

  // A number as people write it: thousands in commas or spaces, a multiplication sign in front.
  OLP.parse = text => {
    const plain = String(text)
      .replace(/[×x\s,']/g, "")
      .replace("−", "-");
    return plain === "" ? NaN : Number(plain);
  };
  OLP.Scale = Scale;
})();
