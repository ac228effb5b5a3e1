"use strict";
// Mouse, fingers and keys on a chart: the value under it, a click that goes there, a drag that selects a range, a wheel or
// two fingers that zoom, and what moves the window along.
(() => {
  const STILL = 3, // px that a click may move
    LEAST = 1e-7, // smallest window as a share of the whole
    FACTOR = 1.5, // of a key that zooms
    SHARE = 0.1, // of the window that a key moves along
    CLOSEST = 16; // px between two fingers that still zoom

  class Hand {
    constructor(chart, events) {
      Object.assign(this, {chart, events, held: new Map(), from: null, pinch: null});
      const {host} = chart,
        on = (name, call, options) => host.addEventListener(name, e => e.target.closest("select") || call(e), options);
      on("pointerdown", e => this.down(e));
      on("pointermove", e => this.move(e));
      on("pointerup", e => this.up(e));
      on("pointercancel", e => this.cancel(e));
      on("pointerleave", () => events.hover(null));
      on("dblclick", () => events.zoom(null));
      on("wheel", e => this.wheel(e), {passive: false});
      on("keydown", e => this.key(e));
    }

    inside(e) {
      return e.clientX - this.chart.host.getBoundingClientRect().left;
    }
    get width() {
      return this.chart.window[1] - this.chart.window[0];
    }

    // Shows the window [a, b], moved back into the data; all of them where it is as long.
    show([a, b]) {
      const [low, high] = this.chart.extent;
      if (b - a <= (high - low) * LEAST) return;
      const shift = Math.max(0, low - a) + Math.min(0, high - b);
      this.events.zoom(b - a >= high - low ? null : [a + shift, b + shift]);
    }
    zoom(x, factor) {
      this.show(this.chart.window.map(v => x + (v - x) * factor));
    }
    shift(window, by) {
      if (this.chart.range) this.show(window.map(v => v + by));
    }

    down(e) {
      if (e.button !== 0) return;
      const {chart, held} = this,
        px = this.inside(e);
      held.set(e.pointerId, px);
      chart.host.setPointerCapture(e.pointerId);
      if (held.size === 1) this.from = {px, x: chart.x_at(px), window: chart.window.slice(), along: e.shiftKey, moved: false};
      else if (held.size === 2) {
        if (this.from?.moved && !this.from.along) this.events.span(null, false);
        this.from = null;
        this.pinch = [...held.values()].map(v => chart.x_at(v));
      }
    }

    move(e) {
      const {chart, held, from} = this,
        px = this.inside(e),
        x = chart.x_at(px);
      if (held.has(e.pointerId)) held.set(e.pointerId, px);
      if (held.size === 2 && this.pinch) return this.fingers();
      if (from) {
        if (Math.abs(px - from.px) > STILL) from.moved = true;
        if (from.moved && from.along) this.shift(from.window, ((from.px - px) / chart.wide) * (from.window[1] - from.window[0]));
        else if (from.moved) this.events.span([from.x, x], false);
      }
      this.events.hover(x >= chart.window[0] && x <= chart.window[1] ? x : null);
    }

    // Keeps what was under two fingers under them.
    fingers() {
      const {chart} = this,
        [p, q] = [...this.held.values()],
        [x, y] = this.pinch;
      if (Math.abs(q - p) < CLOSEST || (y - x) * (q - p) <= 0) return;
      const scale = (y - x) / (q - p),
        first = x - (p - chart.px(chart.window[0])) * scale;
      this.show([first, first + chart.wide * scale]);
    }

    up(e) {
      const {from, chart} = this,
        x = chart.x_at(this.inside(e));
      if (from?.moved && !from.along) this.events.span([from.x, x], true);
      else if (from && !from.moved) this.events.click(x);
      this.release(e);
    }

    // The browser takes the gesture, as to scroll the page.
    cancel(e) {
      if (this.from?.moved && !this.from.along) this.events.span(null, false);
      this.release(e);
    }

    release(e) {
      this.held.delete(e.pointerId);
      this.from = null;
      if (!this.held.size) this.pinch = null;
    }

    wheel(e) {
      e.preventDefault();
      this.zoom(this.chart.x_at(this.inside(e)), Math.exp(Math.max(-1, Math.min(1, e.deltaY / 240))));
    }

    key(e) {
      if (e.ctrlKey || e.metaKey || e.altKey) return;
      const {chart, events} = this,
        {now} = chart.marks,
        [a, b] = chart.window,
        x = now >= a && now <= b ? now : (a + b) / 2,
        calls = {
          "+": () => this.zoom(x, 1 / FACTOR),
          "=": () => this.zoom(x, 1 / FACTOR),
          "-": () => this.zoom(x, FACTOR),
          Home: () => events.zoom(null),
          ArrowLeft: () => (e.shiftKey ? events.extend(-1) : this.shift(chart.window, -SHARE * this.width)),
          ArrowRight: () => (e.shiftKey ? events.extend(1) : this.shift(chart.window, SHARE * this.width)),
          Escape: () => events.span(null, true),
        };
      if (!Object.hasOwn(calls, e.key)) return;
      e.preventDefault();
      e.stopPropagation();
      calls[e.key]();
    }
  }

  OLP.zoom = (chart, events) => new Hand(chart, events);
})();
