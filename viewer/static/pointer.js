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
        app.choose(OLP.NONE);
        return;
      }
      app.set_sample(hit.sample);
      app.select_row(app.row_at(), true);
    }

    // While measuring, the current point of the tool is taken.
    take_current() {
      const {layer} = this.app.pictures;
      if (this.measuring) this.mark({layer: layer.name, at: layer.own(this.app.state.sample_at)});
    }

    mark({layer, at}) {
      const {overlay, layers} = this.app,
        path = layers.get(layer);
      if (overlay.measured.length === 2) overlay.measured = [];
      overlay.measured.push({layer, at, true_point: path.at(at, path.D ? 1 : 0)});
      overlay.show();
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
      if (on) this.app.toast("Click two points on the paths, or take current points with Enter", 3000);
      this.app.overlay.show();
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
        {metric} = app,
        values = app.metrics.values(metric, hit.layer),
        box = this.pane.getBoundingClientRect();
      const text = [
        path.label,
        line ? `line ${line}:  ${app.listing.text(row, 0).slice(0, 60)}` : "",
        `${app.time_of(hit.sample).toFixed(3)} s,  ${app.kind[sample] === OLP.RAPID ? "does not count" : "counts"}`,
      ];
      const value = values?.[Math.round(hit.at)];
      if (values && metric.kind === "state") text.push(value === 2 ? "line above" : value === 1 ? "line within" : "not judged");
      else if (values) text.push(`${metric.label}  ${number(value, 4)} ${OLP.colour.unit_label(metric.unit)}`);
      const tip = $("tip");
      tip.textContent = text.filter(Boolean).join("\n");
      tip.hidden = false;
      tip.style.left = Math.min(e.clientX - box.left + 16, box.width - tip.offsetWidth - 6) + "px";
      tip.style.top = Math.min(e.clientY - box.top + 16, box.height - tip.offsetHeight - 6) + "px";
      app.overlay.hover = {layer: hit.layer, at: hit.at};
      app.overlay.show();
      app.plots.charts.forEach(c => c.set_mark("hover", app.plots.x_of(app.time_of(hit.sample))));
      this.tipped = true;
    }

    hide() {
      if (!this.tipped) return;
      this.tipped = false;
      $("tip").hidden = true;
      this.app.overlay.hover = null;
      this.app.overlay.show();
      this.app.plots.charts.forEach(c => c.set_mark("hover", null));
    }
  }

  OLP.Pointer = Pointer;
})();
