"use strict";
// A line chart on a canvas: any number of points as one minimum and maximum per pixel column, so no peak is lost.
(() => {
  const CORNER = 130; // px of the select at the top right
  const EDGE = {left: 54, right: 12, top: 24, bottom: 22};

  // Index of the first x that is not below `value`, in an ascending array.
  function lower(x, value) {
    let lo = 0,
      hi = x.length;
    while (lo < hi) {
      const mid = (lo + hi) >> 1;
      if (x[mid] < value) lo = mid + 1;
      else hi = mid;
    }
    return lo;
  }

  class Chart {
    // events: {hover(x or null), click(x), zoom([low, high] or null)}
    constructor(host, events) {
      this.host = host;
      this.events = events;
      [this.top, this.base] = [0, 1].map(() => document.createElement("canvas"));
      host.prepend(this.base, this.top);
      Object.assign(this, {series: [], limits: [], range: null, extent: [0, 1], marks: {now: null, hover: null}, readout: null});
      new ResizeObserver(() => this.draw()).observe(host);
      OLP.zoom(this, events);
    }

    // series: [{label, colour, x, y}], limits: [{value, label, colour}]; x ascending, NaN in y is a gap
    set({extent, title, unit, x_label, series, limits, include = false}) {
      Object.assign(this, {extent, title, unit, x_label, series, limits, include});
      if (!(this.extent[1] > this.extent[0])) this.extent[1] = this.extent[0] + 1;
      this.draw();
    }

    set_range(range) {
      this.range = range;
      this.draw();
    }

    get window() {
      return this.range ?? this.extent;
    }
    get wide() {
      return Math.max(1, this.host.clientWidth - EDGE.left - EDGE.right);
    }
    get high() {
      return Math.max(1, this.host.clientHeight - EDGE.top - EDGE.bottom);
    }
    px(x) {
      return EDGE.left + ((x - this.window[0]) / (this.window[1] - this.window[0])) * this.wide;
    }
    py(y) {
      return EDGE.top + (1 - (y - this.low) / (this.up - this.low)) * this.high;
    }
    x_at(px) {
      return this.window[0] + ((px - EDGE.left) / this.wide) * (this.window[1] - this.window[0]);
    }

    prepare(canvas) {
      const ratio = window.devicePixelRatio || 1,
        w = this.host.clientWidth,
        h = this.host.clientHeight,
        c = canvas.getContext("2d");
      if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio))
        Object.assign(canvas, {width: Math.round(w * ratio), height: Math.round(h * ratio)});
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.clearRect(0, 0, w, h);
      const style = getComputedStyle(document.documentElement),
        get = name => style.getPropertyValue(name).trim();
      this.look = {ink: get("--ink"), soft: get("--soft"), rule: get("--rule"), panel: get("--panel"), accent: get("--accent")};
      c.font = "11px " + get("--font");
      return c;
    }

    // One [column, low, high] per pixel column with points, or the points where they are few.
    columns({x, y}) {
      const [a, b] = this.window,
        first = Math.max(0, lower(x, a) - 1),
        last = Math.min(x.length, lower(x, b) + 1),
        out = [];
      if (last - first <= 2 * this.wide) {
        for (let i = first; i < last; i++) out.push([this.px(x[i]), y[i], y[i]]);
        return out;
      }
      let column = -Infinity,
        low = NaN,
        high = NaN;
      const scale = this.wide / (b - a);
      for (let i = first; i < last; i++) {
        const at = Math.floor((x[i] - a) * scale),
          v = y[i];
        if (at !== column) {
          if (column > -Infinity) out.push([EDGE.left + column + 0.5, low, high]);
          column = at;
          low = high = v;
        } else if (v < low || low !== low) {
          low = v;
          if (high !== high) high = v;
        } else if (v > high) high = v;
      }
      out.push([EDGE.left + column + 0.5, low, high]);
      return out;
    }

    draw() {
      if (!this.host.clientWidth || !this.host.clientHeight) return;
      const c = this.prepare(this.base),
        drawn = this.series.map(s => this.columns(s));
      let low = 0,
        up = 0;
      for (const columns of drawn)
        for (const [, a, b] of columns) {
          if (a < low) low = a;
          if (b > up) up = b;
        }
      for (const {value} of this.limits)
        if (this.include || (value <= 1.6 * up && value >= 1.6 * low)) {
          low = Math.min(low, value);
          up = Math.max(up, value);
        }
      if (!(up > low)) up = low + 1;
      Object.assign(this, {low: low - (low < 0 ? 0.06 * (up - low) : 0), up: up + 0.08 * (up - low)});
      this.axes(c);
      c.save();
      c.beginPath();
      c.rect(EDGE.left, EDGE.top, this.wide, this.high);
      c.clip();
      this.limit_lines(c);
      drawn.forEach((columns, i) => this.line(c, columns, this.series[i].colour));
      c.restore();
      this.heading(c);
      this.draw_marks();
    }

    axes(c) {
      const {ticks, number} = OLP.colour,
        bottom = EDGE.top + this.high;
      Object.assign(c, {
        strokeStyle: this.look.rule,
        fillStyle: this.look.soft,
        lineWidth: 1,
        textAlign: "right",
        textBaseline: "middle",
      });
      for (const y of ticks(this.low, this.up, this.high / 28)) {
        const at = Math.round(this.py(y)) + 0.5;
        c.beginPath();
        c.moveTo(EDGE.left, at);
        c.lineTo(EDGE.left + this.wide, at);
        c.stroke();
        c.fillText(number(y), EDGE.left - 6, at);
      }
      Object.assign(c, {textAlign: "center", textBaseline: "top"});
      const right = EDGE.left + this.wide - c.measureText(this.x_label).width - 14;
      for (const x of ticks(...this.window, this.wide / 80)) {
        const at = Math.round(this.px(x)) + 0.5;
        c.beginPath();
        c.moveTo(at, bottom);
        c.lineTo(at, bottom + 4);
        c.stroke();
        if (at < right && at > EDGE.left - 1) c.fillText(number(x, 5), at, bottom + 6);
      }
      c.textAlign = "right";
      c.fillText(this.x_label, EDGE.left + this.wide, bottom + 6);
    }

    limit_lines(c) {
      c.setLineDash([5, 4]);
      for (const {value, colour} of this.limits) {
        if (value > this.up || value < this.low) continue;
        c.strokeStyle = colour ?? this.look.soft;
        c.beginPath();
        c.moveTo(EDGE.left, this.py(value));
        c.lineTo(EDGE.left + this.wide, this.py(value));
        c.stroke();
      }
      c.setLineDash([]);
    }

    line(c, columns, colour) {
      Object.assign(c, {strokeStyle: colour, lineWidth: 1.3, lineJoin: "round"});
      c.beginPath();
      let pen = false;
      for (const [x, a, b] of columns) {
        if (Number.isNaN(a)) {
          pen = false;
          continue;
        }
        if (pen) c.lineTo(x, this.py(a));
        else c.moveTo(x, this.py(a));
        if (b > a) c.lineTo(x, this.py(b));
        pen = true;
      }
      c.stroke();
    }

    heading(c) {
      Object.assign(c, {textAlign: "left", textBaseline: "middle", fillStyle: this.look.ink});
      const bold = c.font;
      c.font = "600 " + bold;
      const title = this.unit ? `${this.title}, ${this.unit}` : this.title;
      c.fillText(title, 10, 12);
      let x = Math.ceil(10 + c.measureText(title).width) + 16;
      c.font = bold;
      for (const {label, colour} of this.series) {
        const wide = c.measureText(label).width;
        if (x + wide + 30 > this.host.clientWidth - CORNER) break;
        c.fillStyle = colour;
        c.fillRect(x, 11, 12, 3);
        c.fillStyle = this.look.soft;
        c.fillText(label, x + 16, 12);
        x += Math.ceil(wide) + 30;
      }
    }

    set_mark(name, x) {
      if (this.marks[name] === x) return;
      this.marks[name] = x;
      this.draw_marks();
    }

    draw_marks() {
      if (!this.host.clientWidth || this.up === undefined) return;
      const c = this.prepare(this.top),
        {now, hover} = this.marks;
      for (const [x, colour, dash] of [
        [now, this.look.accent, []],
        [hover, this.look.soft, [3, 3]],
      ]) {
        if (x === null || x < this.window[0] || x > this.window[1]) continue;
        const at = Math.round(this.px(x)) + 0.5;
        c.strokeStyle = colour;
        c.setLineDash(dash);
        c.beginPath();
        c.moveTo(at, EDGE.top);
        c.lineTo(at, EDGE.top + this.high);
        c.stroke();
      }
      c.setLineDash([]);
      if (hover !== null) this.values(c, hover);
    }

    values(c, x) {
      const {number} = OLP.colour,
        rows = this.series
          .map(s => [s.label, s.y[Math.max(0, Math.min(s.x.length - 1, OLP.find(s.x, x)))], s.colour])
          .filter(r => r[1] !== undefined);
      if (!rows.length) return;
      const wide = Math.max(...rows.map(r => c.measureText(`${r[0]}  ${number(r[1], 4)}`).width)) + 28,
        high = 15 * rows.length + 8,
        at = this.px(x);
      const left = at + 10 + wide > this.host.clientWidth ? at - wide - 10 : at + 10;
      Object.assign(c, {fillStyle: this.look.panel, strokeStyle: this.look.rule, textBaseline: "middle"});
      c.beginPath();
      c.roundRect(left, EDGE.top + 2, wide, high, 4);
      c.fill();
      c.stroke();
      rows.forEach(([label, value, colour], i) => {
        const y = EDGE.top + 14 + 15 * i;
        c.fillStyle = colour;
        c.fillRect(left + 7, y - 1, 8, 3);
        Object.assign(c, {fillStyle: this.look.ink, textAlign: "left"});
        c.fillText(label, left + 19, y);
        c.textAlign = "right";
        c.fillText(number(value, 4), left + wide - 7, y);
      });
    }
  }

  OLP.Chart = Chart;
})();
