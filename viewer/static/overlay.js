"use strict";
// The overlay of the picture: the flag of the worst place, lines above, tool ring, current points, notes and measured lines.
(() => {
  const KEEP_OFF = ["switch", "views", "readout"],
    WIDEST = 40,
    MOST_MARKS = 200, // lines above that are marked; of more the colours tell
    PLAIN = 0.35; // part of a direction that is worth a word

  // Lines of at most WIDEST characters, broken at spaces where there are some.
  function wrapped(text) {
    const lines = [""];
    for (const word of text.split(" ")) {
      if (lines.at(-1) && lines.at(-1).length + word.length >= WIDEST) lines.push("");
      lines.push((lines.pop() + " " + word).trim().slice(0, WIDEST));
    }
    return lines;
  }

  // A direction in words: the axes along which it mainly leads.
  OLP.direction = unit =>
    unit
      .map((v, j) => [Math.abs(v), (v < 0 ? "−" : "+") + "XYZ"[j]])
      .filter(([size]) => size > PLAIN)
      .sort((p, q) => q[0] - p[0])
      .map(([, name]) => name)
      .join(" ");

  class Overlay {
    constructor(app) {
      this.app = app;
      this.canvas = document.getElementById("overlay");
      this.measured = []; // up to two {layer, at, true_point}
      this.hover = null; // {layer, at}
      OLP.on("drawn", () => this.show());
    }

    show() {
      const {clientWidth: w, clientHeight: h} = this.app.scene.pane,
        ratio = window.devicePixelRatio || 1;
      if (!w || !h) return;
      if (this.canvas.width !== Math.round(w * ratio) || this.canvas.height !== Math.round(h * ratio))
        Object.assign(this.canvas, {width: Math.round(w * ratio), height: Math.round(h * ratio)});
      const c = this.canvas.getContext("2d"),
        box = this.canvas.getBoundingClientRect();
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.clearRect(0, 0, w, h);
      const taken = KEEP_OFF.map(id => document.getElementById(id))
        .filter(e => !e.hidden)
        .map(e => e.getBoundingClientRect())
        .map(r => [r.left - box.left, r.top - box.top, r.right - box.left, r.bottom - box.top]);
      this.draw(c, taken);
    }

    // Draws into a context whose unit is a pixel of the pane; boxes `taken` are kept free.
    draw(c, taken) {
      const {app} = this,
        style = getComputedStyle(document.documentElement),
        get = name => style.getPropertyValue(name).trim();
      Object.assign(this, {context: c, taken, ink: get("--ink"), paper: get("--panel"), above: get("--fail")});
      c.font = "12px " + get("--font");
      this.view = app.scene.view(0);
      this.points();
      this.lines_above();
      this.flag();
      this.notes();
      this.measure();
    }

    at(point) {
      return this.app.scene.project(point, this.view);
    }

    points() {
      const {app, context: c} = this,
        {state, pictures} = app;
      for (const layer of app.layers.values()) {
        if (!layer.visible || !layer.knows(state.sample_at)) continue;
        const p = this.at(layer.at(layer.own(state.sample_at), pictures.k_of(layer)));
        if (p) this.dot(p, 3, this.paper, this.ink);
      }
      const tool = this.at(app.tool_point());
      if (tool)
        for (const [width, stroke] of [
          [4.5, this.paper],
          [2, this.ink],
        ]) {
          c.beginPath();
          c.arc(...tool, 9, 0, 7);
          Object.assign(c, {lineWidth: width, strokeStyle: stroke});
          c.stroke();
        }
      if (tool) this.taken.push([tool[0] - 10, tool[1] - 10, tool[0] + 10, tool[1] + 10]); // no label hides it
      if (this.hover) {
        const layer = app.layers.get(this.hover.layer),
          p = this.at(layer.at(this.hover.at, pictures.k_of(layer)));
        if (p) this.dot(p, 4.5, this.ink, this.paper);
      }
    }

    dot([x, y], radius, fill, stroke = this.paper) {
      const c = this.context;
      c.beginPath();
      c.arc(x, y, radius, 0, 7);
      Object.assign(c, {fillStyle: fill, strokeStyle: stroke, lineWidth: 1.5});
      c.fill();
      c.stroke();
    }

    // Lines that the table of judgements says are above, as small flags without words where they are farthest off.
    lines_above() {
      const {app, context: c} = this,
        layer = app.pictures.layer,
        own = app.manifest.listing.by_layer?.[layer.name];
      if (!own) return;
      this.marks ??= new Map();
      if (!this.marks.has(layer.name)) {
        const rows = [];
        app.arrays.get(own.state).forEach((code, row) => code === 1 && app.first[row] >= 0 && rows.push(row));
        this.marks.set(layer.name, rows.length > MOST_MARKS ? [] : app.places_of(rows, layer.name));
      }
      for (const sample of this.marks.get(layer.name)) {
        const p = this.at(app.point_of(sample, layer.name));
        if (!p) continue;
        c.beginPath();
        c.moveTo(p[0], p[1]);
        c.lineTo(p[0] - 4, p[1] - 8);
        c.lineTo(p[0] + 4, p[1] - 8);
        c.closePath();
        Object.assign(c, {fillStyle: this.above, strokeStyle: this.paper, lineWidth: 1});
        c.fill();
        c.stroke();
      }
    }

    // The worst place of the picture: value, line, direction, and the deviation as an arrow.
    flag() {
      const {app, context: c} = this,
        {flag, label} = app.pictures.current ?? {};
      if (!flag) return;
      const layer = app.layers.get(flag.layer),
        own = layer.own(flag.sample),
        from = this.at(layer.at(own, 0)),
        to = this.at(layer.at(own, app.pictures.k_of(layer)));
      const {w, h} = this.view;
      if (!from || !to || to[0] < 0 || to[1] < 0 || to[0] > w || to[1] > h) return;
      const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
      if (length > 8) {
        const [ux, uy] = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
        for (const [width, stroke] of [
          [4, this.paper],
          [2, this.ink],
        ]) {
          Object.assign(c, {lineWidth: width, strokeStyle: stroke});
          c.beginPath();
          c.moveTo(...from);
          c.lineTo(...to);
          c.moveTo(to[0] - 7 * ux + 4 * uy, to[1] - 7 * uy - 4 * ux);
          c.lineTo(...to);
          c.lineTo(to[0] - 7 * ux - 4 * uy, to[1] - 7 * uy + 4 * ux);
          c.stroke();
        }
      }
      const text = `▲ ${OLP.colour.um(flag.um)} µm  ·  line ${flag.line}\nlargest, ${label}${flag.direction.some(v => v) ? ", towards " + OLP.direction(flag.direction) : ""}`;
      this.taken.push([to[0] - 14, to[1] - 14, to[0] + 14, to[1] + 14]);
      this.label(text, ...this.outwards(to, text), this.ink, to);
      this.dot(to, 4, this.ink);
    }

    // Where a label of a point begins: away from the middle of the picture.
    outwards([x, y], text) {
      const wide = 7 * Math.min(WIDEST, Math.max(...text.split("\n").map(s => s.length)));
      return [x < this.view.w / 2 ? x - wide - 30 : x + 30, y < this.view.h / 2 ? y - 60 : y + 30];
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
        ends = app.state.notes.map(note => this.at(app.point_of(note.sample, note.layer)));
      for (const p of ends) if (p) this.taken.push([p[0] - 10, p[1] - 10, p[0] + 10, p[1] + 10]);
      app.state.notes.forEach((note, i) => {
        const p = ends[i];
        if (!p) return;
        this.label(`${i + 1}  ${note.text}`, ...this.outwards(p, note.text), this.ink, p);
        this.dot(p, 4, this.ink);
      });
    }

    measure() {
      const {context: c, measured} = this,
        {layers, pictures} = this.app,
        ends = measured.map(({layer, at}) => this.at(layers.get(layer).at(at, pictures.k_of(layers.get(layer)))));
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
  }

  Object.assign(OLP, {Overlay, MOST_MARKS});
})();
