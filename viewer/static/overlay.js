"use strict";
// The overlay of the picture: tool ring, current points, triad, scale, notes and measured lines, redrawn with it.
(() => {
  const KEEP_OFF = ["legend", "readout", "views"],
    WIDEST = 40;

  // Lines of at most WIDEST characters, broken at spaces where there are some.
  function wrapped(text) {
    const lines = [""];
    for (const word of text.split(" ")) {
      if (lines.at(-1) && lines.at(-1).length + word.length >= WIDEST) lines.push("");
      lines.push((lines.pop() + " " + word).trim().slice(0, WIDEST));
    }
    return lines;
  }

  class Overlay {
    constructor(app) {
      this.app = app;
      this.canvas = document.getElementById("overlay");
      this.context = this.canvas.getContext("2d");
      this.measured = []; // up to two {point, label}
      this.hover = null; // {layer, at}
      OLP.on("drawn", () => this.draw());
    }

    draw() {
      const {app, canvas, context: c} = this,
        {clientWidth: w, clientHeight: h} = app.scene.pane,
        ratio = window.devicePixelRatio || 1;
      if (!w || !h) return;
      if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio))
        Object.assign(canvas, {width: Math.round(w * ratio), height: Math.round(h * ratio)});
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.clearRect(0, 0, w, h);
      const style = getComputedStyle(document.documentElement),
        colour = name => style.getPropertyValue(name).trim();
      this.ink = colour("--ink");
      this.paper = colour("--panel");
      this.accent = colour("--accent");
      c.font = "12px " + colour("--font");
      this.view = app.scene.view(0);
      const box = canvas.getBoundingClientRect();
      this.taken = KEEP_OFF.map(id => document.getElementById(id).getBoundingClientRect()).map(r => [
        r.left - box.left,
        r.top - box.top,
        r.right - box.left,
        r.bottom - box.top,
      ]);
      this.points();
      this.notes();
      this.measure();
      this.triad(w, h);
      if (this.view.ortho) this.scale(w, h);
    }

    at(point) {
      return this.app.scene.project(point, this.view);
    }

    points() {
      const {app, context: c} = this,
        {state} = app;
      for (const layer of app.layers.values()) {
        if (!layer.visible) continue;
        const p = this.at(layer.at(layer.own(state.sample_at), state.exaggeration));
        if (p) this.dot(p, 3.5, layer.colour);
      }
      const tool = this.at(app.tool_point());
      if (tool) {
        for (const [width, stroke] of [
          [4, this.paper],
          [2, this.accent],
        ]) {
          c.beginPath();
          c.arc(...tool, 9, 0, 7);
          Object.assign(c, {lineWidth: width, strokeStyle: stroke});
          c.stroke();
        }
      }
      if (this.hover) {
        const p = this.at(app.layers.get(this.hover.layer).at(this.hover.at, state.exaggeration));
        if (p) this.dot(p, 4.5, this.ink);
      }
    }

    dot([x, y], radius, fill) {
      const c = this.context;
      c.beginPath();
      c.arc(x, y, radius, 0, 7);
      Object.assign(c, {fillStyle: fill, strokeStyle: this.paper, lineWidth: 1.5});
      c.fill();
      c.stroke();
    }

    // Corner nearest to (x, y) for a box that hides neither a panel nor another label.
    free(x, y, wide, high) {
      const clash = (a, b) => this.taken.some(r => a < r[2] && a + wide > r[0] && b < r[3] && b + high > r[1]);
      const within = (v, size, whole) => Math.min(Math.max(4, v), Math.max(4, whole - size - 4));
      const corners = [0, -1, 1, -2, 2, -3, 3, -4, 4].flatMap(down =>
        [0, -0.5, 0.5, -1, 1].map(aside => [
          within(x + aside * (wide + 24), wide, this.view.w),
          within(y + down * (high + 8), high, this.view.h),
        ]),
      );
      // Nearest first; the point itself is not hidden.
      corners.sort((p, q) => Math.hypot(p[0] - x, p[1] - y) - Math.hypot(q[0] - x, q[1] - y));
      const [left, top] = corners.find(([a, b]) => !clash(a, b)) ?? corners[0];
      this.taken.push([left, top, left + wide, top + high]);
      return [left, top];
    }

    label(text, x, y, border, from = null) {
      const c = this.context,
        lines = text.split("\n").flatMap(wrapped).slice(0, 4),
        wide = Math.max(...lines.map(s => c.measureText(s).width)) + 14,
        high = 16 * lines.length + 8;
      const [left, top] = this.free(x, y, wide, high);
      if (from) {
        Object.assign(c, {strokeStyle: border, lineWidth: 1.5});
        c.beginPath();
        c.moveTo(...from);
        c.lineTo(Math.min(Math.max(from[0], left), left + wide), Math.min(Math.max(from[1], top), top + high));
        c.stroke();
      }
      Object.assign(c, {fillStyle: this.paper, strokeStyle: border, lineWidth: 1.2, textBaseline: "middle", textAlign: "left"});
      c.beginPath();
      c.roundRect(left, top, wide, high, 4);
      c.fill();
      c.stroke();
      c.fillStyle = this.ink;
      lines.forEach((s, i) => c.fillText(s, left + 7, top + 12 + 16 * i));
    }

    notes() {
      const {app} = this,
        ends = app.state.callouts.map(note => this.at(app.point_of(note.sample, note.layer))),
        tool = this.at(app.tool_point());
      for (const p of [...ends, tool]) if (p) this.taken.push([p[0] - 10, p[1] - 10, p[0] + 10, p[1] + 10]);
      app.state.callouts.forEach((note, i) => {
        const p = ends[i];
        if (!p) return;
        // Outwards, away from the path.
        const left = p[0] < this.view.w / 2,
          above = p[1] < this.view.h / 2;
        this.label(`${i + 1}  ${note.text}`, left ? p[0] - 250 : p[0] + 30, above ? p[1] - 75 : p[1] + 35, this.accent, p);
        this.dot(p, 4, this.accent);
      });
    }

    measure() {
      const {context: c, measured} = this,
        ends = measured.map(m => this.at(m.point));
      if (ends.some(p => !p)) return;
      if (ends.length === 2) {
        Object.assign(c, {strokeStyle: this.ink, lineWidth: 1.5});
        c.setLineDash([6, 4]);
        c.beginPath();
        c.moveTo(...ends[0]);
        c.lineTo(...ends[1]);
        c.stroke();
        c.setLineDash([]);
      }
      ends.forEach(p => this.dot(p, 5, this.ink));
      if (ends.length === 2)
        this.label(this.app.measure_text(), (ends[0][0] + ends[1][0]) / 2 + 12, (ends[0][1] + ends[1][1]) / 2 + 8, this.ink);
    }

    triad(w, h) {
      const {context: c} = this,
        x = w - 46,
        y = h - 46;
      Object.assign(c, {textAlign: "center", textBaseline: "middle", lineWidth: 2});
      const axes = this.app.camera
        .axes()
        .map((a, i) => [...a, "XYZ"[i], this.app.axis_colour(i)])
        .sort((p, q) => p[2] - q[2]);
      for (const [dx, dy, , name, colour] of axes) {
        if (Math.hypot(dx, dy) < 0.08) continue;
        c.strokeStyle = c.fillStyle = colour;
        c.beginPath();
        c.moveTo(x, y);
        c.lineTo(x + 26 * dx, y + 26 * dy);
        c.stroke();
        c.fillText(name, x + 36 * dx, y + 36 * dy);
      }
    }

    // A round length, and the deviation of that length at this exaggeration.
    scale(w, h) {
      const {context: c} = this,
        length = OLP.colour.round_up(90 / this.view.scale / 2.5),
        px = length * this.view.scale,
        x = w - 90 - px,
        y = h - 20;
      const enlarged = length / this.app.state.exaggeration,
        number = OLP.colour.number;
      Object.assign(c, {strokeStyle: this.ink, fillStyle: this.ink, lineWidth: 1.5, textAlign: "center", textBaseline: "bottom"});
      c.beginPath();
      c.moveTo(x, y - 4);
      c.lineTo(x, y);
      c.lineTo(x + px, y);
      c.lineTo(x + px, y - 4);
      c.stroke();
      c.fillText(`${number(length)} mm`, x + px / 2, y - 4);
      c.textBaseline = "top";
      c.fillText(enlarged < 1 ? `error ${number(enlarged * 1e3)} µm` : `error ${number(enlarged)} mm`, x + px / 2, y + 3);
    }
  }

  OLP.Overlay = Overlay;
})();
