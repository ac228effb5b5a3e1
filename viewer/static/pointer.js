"use strict";
// The mouse on the picture: the point under it, a click that selects, two clicks that measure.
(() => {
  const $ = id => document.getElementById(id),
    STILL = 4; // px that a click may move

  class Pointer {
    constructor(app) {
      Object.assign(this, {app, pane: app.scene.pane, measuring: false, from: null, waiting: false});
      this.pane.addEventListener("pointerdown", e => {
        this.from = [e.clientX, e.clientY];
        this.hide();
      });
      // the controls hold the pointer during a drag, so its end is seen by the document
      document.addEventListener("pointerup", e => this.up(e));
      this.pane.addEventListener("pointermove", e => this.move(e));
      this.pane.addEventListener("pointerleave", () => this.hide());
      $("measure").onclick = () => this.set_measuring(!this.measuring);
      app.measure_text = () => this.text();
    }

    // Nearest point to a pixel of the page: {layer, sample, distance, at} or null; at = own index of the layer.
    pick(x, y) {
      const box = this.pane.getBoundingClientRect(),
        hit = this.app.scene.pick(x - box.left, y - box.top);
      if (!hit) return null;
      const layer = this.app.layers.get(hit.layer),
        sample = layer.index ? layer.index[Math.round(hit.at)] : hit.at;
      return {...hit, sample};
    }

    up(e) {
      const from = this.from;
      this.from = null;
      if (!from || e.button !== 0 || Math.hypot(e.clientX - from[0], e.clientY - from[1]) > STILL) return;
      const hit = this.pick(e.clientX, e.clientY),
        {app} = this;
      if (this.measuring) {
        if (hit) this.mark(hit);
        return;
      }
      if (!hit) {
        app.set_span([-1, -1]);
        return;
      }
      app.set_sample(hit.sample);
      app.select_row(app.row_at(), true);
    }

    mark({layer, at}) {
      const {overlay} = this.app,
        k = this.app.state.exaggeration,
        path = this.app.layers.get(layer);
      if (overlay.measured.length === 2) overlay.measured = [];
      overlay.measured.push({point: path.at(at, k), true_point: path.at(at, 1), k});
      overlay.draw();
      if (overlay.measured.length === 2) this.app.toast(this.text().replace("\n", "   "), 8000);
    }

    // Distance and its parts of the true positions, whatever the exaggeration.
    text() {
      const [p, q] = this.app.overlay.measured.map(m => m.true_point),
        d = q.map((v, j) => v - p[j]),
        f = v => v.toFixed(4).replace("-", "−");
      return `${f(Math.hypot(...d))} mm\nΔX ${f(d[0])}  ΔY ${f(d[1])}  ΔZ ${f(d[2])}`;
    }

    set_measuring(on) {
      this.measuring = on;
      this.app.overlay.measured = [];
      $("measure").setAttribute("aria-pressed", on);
      this.pane.classList.toggle("measuring", on);
      if (on) this.app.toast("Click two points on the paths", 3000);
      this.app.overlay.draw();
    }

    move(e) {
      if (e.buttons || this.waiting) return;
      this.waiting = true;
      requestAnimationFrame(() => {
        this.waiting = false;
        const hit = this.pick(e.clientX, e.clientY);
        if (hit) this.tip(hit, e);
        else this.hide();
      });
    }

    tip(hit, e) {
      const {app} = this,
        path = app.layers.get(hit.layer),
        sample = Math.ceil(hit.sample - 1e-9),
        row = app.rows[sample],
        number = OLP.colour.number;
      const line = app.listing.number(row, 0),
        metric = app.metrics.find(app.state.metric) ?? app.plot_metric(),
        values = app.metrics.values(metric, hit.layer),
        box = this.pane.getBoundingClientRect();
      const text = [
        path.label,
        line ? `line ${line}:  ${app.listing.text(row, 0).slice(0, 60)}` : "",
        `${app.time_of(hit.sample).toFixed(3)} s,  ${app.kind[sample] === OLP.RAPID ? "rapid" : "feed"}`,
      ];
      if (values) text.push(`${metric.label}  ${number(values[Math.round(hit.at)], 4)} ${OLP.colour.unit_label(metric.unit)}`);
      const tip = $("tip");
      tip.textContent = text.filter(Boolean).join("\n");
      tip.hidden = false;
      tip.style.left = Math.min(e.clientX - box.left + 16, box.width - tip.offsetWidth - 6) + "px";
      tip.style.top = Math.min(e.clientY - box.top + 16, box.height - tip.offsetHeight - 6) + "px";
      app.overlay.hover = {layer: hit.layer, at: hit.at};
      app.overlay.draw();
      app.plots.charts.forEach(c => c.set_mark("hover", app.plots.x_of(app.time_of(hit.sample))));
      this.tipped = true;
    }

    hide() {
      if (!this.tipped) return;
      this.tipped = false;
      $("tip").hidden = true;
      this.app.overlay.hover = null;
      this.app.overlay.draw();
      this.app.plots.charts.forEach(c => c.set_mark("hover", null));
    }
  }

  OLP.Pointer = Pointer;
})();
