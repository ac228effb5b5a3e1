"use strict";
// Line charts on a canvas, in lanes one above the other: any number of points as one minimum and maximum per pixel column,
// so no peak is lost. Series tell themselves apart by their dashes.
(() => {
  const EDGE = {left: 54, right: 12, top: 22, bottom: 20}, // px; the top is at least what the choices take
    GAP = 6; // px between lanes

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
    // events: {hover(x or null), click(x), zoom([low, high] or null), span([x, x] or null, whether it is the last one),
    // extend(1 or -1)}
    constructor(host, events) {
      this.host = host;
      this.events = events;
      [this.top, this.base] = [0, 1].map(() => document.createElement("canvas"));
      this.base.setAttribute("role", "img");
      this.base.tabIndex = 0;
      this.base.setAttribute("aria-keyshortcuts", "+ - Home ArrowLeft ArrowRight Shift+ArrowLeft Shift+ArrowRight Escape");
      this.top.setAttribute("aria-hidden", "true");
      host.prepend(this.base, this.top);
      Object.assign(this, {lanes: [], over: EDGE.top, range: null, extent: [0, 1], marks: {now: null, hover: null}, bands: []});
      new ResizeObserver(() => this.draw()).observe(host);
      OLP.zoom(this, events);
    }

    // lanes: [{title, unit, series: [{label, dashes, x, y}], limits: [{value}], include}]; x ascending, NaN in y is a gap.
    // Lanes of one unit have one scale with `alike`.
    set({extent, x_label, lanes, alike = false}) {
      Object.assign(this, {extent, x_label, lanes, alike});
      if (!(this.extent[1] > this.extent[0])) this.extent[1] = this.extent[0] + 1;
      this.draw();
    }

    set_range(range) {
      this.range = range;
      this.draw();
    }

    // Ranges [a, b] of x that are marked.
    set_bands(bands) {
      this.bands = bands;
      this.draw();
    }

    get window() {
      return this.range ?? this.extent;
    }
    get wide() {
      return Math.max(1, this.host.clientWidth - EDGE.left - EDGE.right);
    }
    get high() {
      return Math.max(1, this.host.clientHeight - this.over - EDGE.bottom);
    }
    px(x) {
      return EDGE.left + ((x - this.window[0]) / (this.window[1] - this.window[0])) * this.wide;
    }
    py(lane, y) {
      return lane.at + (1 - (y - lane.low) / (lane.up - lane.low)) * lane.high;
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
      this.look = {ink: get("--ink"), soft: get("--soft"), rule: get("--rule"), panel: get("--panel"), mark: get("--mark"), fail: get("--fail")};
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
      if (!this.host.clientWidth || !this.host.clientHeight || !this.lanes.length) return;
      this.over = Math.max(EDGE.top, (this.host.querySelector(".choices")?.offsetHeight ?? 0) + 2);
      const c = this.prepare(this.base),
        each = (this.high - GAP * (this.lanes.length - 1)) / this.lanes.length;
      this.lanes.forEach((lane, k) => {
        lane.at = this.over + k * (each + GAP);
        lane.high = Math.max(1, each);
        lane.drawn = lane.series.map(s => this.columns(s));
        this.fit(lane);
      });
      if (this.alike) {
        const low = Math.min(...this.lanes.map(l => l.low)),
          up = Math.max(...this.lanes.map(l => l.up));
        for (const lane of this.lanes) Object.assign(lane, {low, up});
      }
      this.abscissa(c);
      this.written = [];
      for (const lane of this.lanes) this.lane(c, lane);
      this.heading(c);
      this.base.setAttribute("aria-label", this.text());
      this.draw_marks();
    }

    // The range of a lane: its values, zero, and the limits near them.
    fit(lane) {
      let low = 0,
        up = 0;
      for (const columns of lane.drawn)
        for (const [, a, b] of columns) {
          if (a < low) low = a;
          if (b > up) up = b;
        }
      lane.range = [low, up];
      for (const {value} of lane.limits ?? [])
        if (lane.include || (value <= 1.6 * up && value >= 1.6 * low)) {
          low = Math.min(low, value);
          up = Math.max(up, value);
        }
      if (!(up > low)) up = low + 1;
      Object.assign(lane, {low: low - (low < 0 ? 0.06 * (up - low) : 0), up: up + 0.08 * (up - low)});
    }

    // The chart in words.
    text() {
      const {number} = OLP.colour;
      return this.lanes
        .map(l => `${l.title}${l.unit ? ", " + l.unit : ""}: from ${number(l.range[0])} to ${number(l.range[1])} over ${this.x_label}`)
        .join("; ");
    }

    abscissa(c) {
      const {ticks, number} = OLP.colour,
        bottom = this.over + this.high;
      Object.assign(c, {strokeStyle: this.look.rule, fillStyle: this.look.soft, lineWidth: 1, textBaseline: "top"});
      const right = EDGE.left + this.wide - c.measureText(this.x_label).width - 14;
      c.textAlign = "center";
      for (const x of ticks(...this.window, this.wide / 80)) {
        const at = Math.round(this.px(x)) + 0.5;
        c.beginPath();
        c.moveTo(at, bottom);
        c.lineTo(at, bottom + 4);
        c.stroke();
        if (at + c.measureText(number(x, 5)).width / 2 < right && at > EDGE.left - 1) c.fillText(number(x, 5), at, bottom + 6);
      }
      c.textAlign = "right";
      c.fillText(this.x_label, EDGE.left + this.wide, bottom + 6);
      c.fillStyle = this.look.mark;
      for (const [a, b] of this.bands) {
        if (b < this.window[0] || a > this.window[1]) continue;
        const [from, to] = [a, b].map(x => Math.min(EDGE.left + this.wide, Math.max(EDGE.left, this.px(x))));
        c.fillRect(from, this.over, Math.max(1.5, to - from), this.high);
      }
    }

    lane(c, lane) {
      const {ticks, number} = OLP.colour;
      Object.assign(c, {strokeStyle: this.look.rule, fillStyle: this.look.soft, lineWidth: 1, textAlign: "right", textBaseline: "middle"});
      // of numbers that would overlap, also with those of the lane above, the largest is written
      for (const y of ticks(lane.low, lane.up, Math.max(3, lane.high / 26)).sort((p, q) => Math.abs(q) - Math.abs(p))) {
        const at = Math.round(this.py(lane, y)) + 0.5;
        c.beginPath();
        c.moveTo(EDGE.left, at);
        c.lineTo(EDGE.left + this.wide, at);
        c.stroke();
        if (this.written.some(other => Math.abs(other - at) < 11)) continue;
        c.fillText(number(y), EDGE.left - 6, at);
        this.written.push(at);
      }
      c.save();
      c.beginPath();
      c.rect(EDGE.left, lane.at - 1, this.wide, lane.high + 2);
      c.clip();
      c.strokeStyle = this.look.fail;
      for (const {value} of lane.limits ?? []) {
        const at = Math.round(this.py(lane, value)) + 0.5;
        c.setLineDash([6, 3]);
        c.beginPath();
        c.moveTo(EDGE.left, at);
        c.lineTo(EDGE.left + this.wide, at);
        c.stroke();
      }
      lane.drawn.forEach((columns, i) => this.line(c, lane, columns, lane.series[i]));
      c.restore();
      if (this.lanes.length > 1) {
        Object.assign(c, {fillStyle: this.look.ink, textAlign: "left", textBaseline: "top"});
        Object.assign(c, {strokeStyle: this.look.panel, lineWidth: 4, lineJoin: "round"});
        c.strokeText(lane.title, EDGE.left + 5, lane.at + 1);
        c.fillText(lane.title, EDGE.left + 5, lane.at + 1);
      }
    }

    line(c, lane, columns, {dashes}) {
      Object.assign(c, {strokeStyle: this.look.ink, lineWidth: 1.25, lineJoin: "round"});
      c.setLineDash(dashes?.[1] ? dashes : []);
      c.beginPath();
      let pen = false;
      for (const [x, a, b] of columns) {
        if (a !== a) {
          pen = false;
          continue;
        }
        const y = this.py(lane, a);
        if (pen) c.lineTo(x, y);
        else {
          // a point alone is seen as well
          c.moveTo(x, y - 0.75);
          c.lineTo(x, y + 0.75);
          c.moveTo(x, y);
        }
        if (b > a) c.lineTo(x, this.py(lane, b));
        pen = true;
      }
      c.stroke();
      c.setLineDash([]);
    }

    heading(c) {
      const choices = this.host.querySelector(".choices"),
        room = this.host.clientWidth - (choices?.offsetWidth ?? 0) - 16,
        [first] = this.lanes,
        plain = c.font;
      Object.assign(c, {textAlign: "left", textBaseline: "middle", fillStyle: this.look.ink, font: "600 " + plain});
      const name = this.lanes.length > 1 ? this.title : first.title,
        unit = this.lanes.every(lane => lane.unit === first.unit) && first.unit,
        titles = [name, name.split(",")[0]].map(text => (unit ? `${text}, ${unit}` : text)),
        title = OLP.fitted(c, titles.find(text => c.measureText(text).width <= room - 10) ?? titles[1], room - 10);
      c.fillText(title, 10, 11);
      let x = Math.ceil(10 + c.measureText(title).width) + 14;
      c.font = plain;
      // where each lane is one curve, its title names it
      const curves = this.lanes.reduce((most, lane) => (lane.series.length > most.length ? lane.series : most), []);
      if (curves.length < 2) return;
      c.lineWidth = 1.25;
      for (const {label, dashes} of curves) {
        const wide = c.measureText(label).width;
        if (x + wide + 30 > room) break;
        c.strokeStyle = this.look.ink;
        c.setLineDash(dashes?.[1] ? dashes : []);
        c.beginPath();
        c.moveTo(x, 11.5);
        c.lineTo(x + 18, 11.5);
        c.stroke();
        c.setLineDash([]);
        c.fillStyle = this.look.soft;
        c.fillText(label, x + 22, 11);
        x += Math.ceil(wide) + 34;
      }
    }

    set_mark(name, x) {
      if (this.marks[name] === x) return;
      this.marks[name] = x;
      this.draw_marks();
    }

    draw_marks() {
      if (!this.host.clientWidth || !this.lanes.length || this.lanes[0].up === undefined) return;
      const c = this.prepare(this.top),
        {now, hover} = this.marks;
      const kinds = [[now, this.look.ink, []], [hover, this.look.soft, [3, 3]]];
      for (const [x, colour, dash] of kinds) {
        if (x === null || x < this.window[0] || x > this.window[1]) continue;
        const at = Math.round(this.px(x)) + 0.5;
        c.strokeStyle = colour;
        c.setLineDash(dash);
        c.beginPath();
        c.moveTo(at, this.over);
        c.lineTo(at, this.over + this.high);
        c.stroke();
      }
      c.setLineDash([]);
      if (hover !== null) this.values(c, hover);
    }

    // Labels and values of all series at x.
    at(x) {
      return this.lanes.flatMap(lane =>
        lane.series
          .map(s => [
            this.lanes.length > 1 ? lane.title : s.label,
            s.y[Math.max(0, Math.min(s.x.length - 1, OLP.find(s.x, x)))],
          ])
          .filter(r => r[1] !== undefined),
      );
    }

    values(c, x) {
      const {number} = OLP.colour,
        rows = this.at(x);
      if (!rows.length) return;
      const wide = Math.max(...rows.map(r => c.measureText(`${r[0]}  ${number(r[1], 4)}`).width)) + 20,
        high = 15 * rows.length + 8,
        at = this.px(x);
      const left = at + 10 + wide > this.host.clientWidth ? at - wide - 10 : at + 10;
      Object.assign(c, {fillStyle: this.look.panel, strokeStyle: this.look.rule, textBaseline: "middle"});
      c.beginPath();
      c.roundRect(left, this.over + 2, wide, high, 4);
      c.fill();
      c.stroke();
      c.fillStyle = this.look.ink;
      rows.forEach(([label, value], i) => {
        const y = this.over + 14 + 15 * i;
        c.textAlign = "left";
        c.fillText(label, left + 7, y);
        c.textAlign = "right";
        c.fillText(number(value, 4), left + wide - 7, y);
      });
    }
  }

  OLP.Chart = Chart;
})();
