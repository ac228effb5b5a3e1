"use strict";
// The mouse on a chart: the value under it, a click that selects, a wheel that zooms about it, a drag that moves along.
(() => {
  const STILL = 3,
    LEAST = 1e-7; // px that a click may move; smallest window as a share of the whole

  // The window [a, b], moved back into the data.
  function within(chart, [a, b]) {
    const shift = Math.max(0, chart.extent[0] - a) + Math.min(0, chart.extent[1] - b);
    return [a + shift, b + shift];
  }

  OLP.zoom = (chart, events) => {
    const {host} = chart,
      inside = e => e.clientX - host.getBoundingClientRect().left;
    let held = null;
    host.addEventListener("pointermove", e => {
      if (e.target.closest("select")) return;
      const px = inside(e),
        x = chart.x_at(px);
      if (held && Math.abs(px - held.px) > STILL) held.moved = true;
      if (held?.moved && chart.range) {
        const shift = ((held.px - px) / chart.wide) * (held.range[1] - held.range[0]);
        events.zoom(
          within(
            chart,
            held.range.map(v => v + shift),
          ),
        );
      }
      events.hover(x >= chart.window[0] && x <= chart.window[1] ? x : null);
    });
    host.addEventListener("pointerleave", () => events.hover(null));
    host.addEventListener("pointerdown", e => {
      if (e.target.closest("select")) return;
      held = {px: inside(e), range: chart.window.slice(), moved: false};
      host.setPointerCapture(e.pointerId);
    });
    host.addEventListener("pointerup", e => {
      if (held && !held.moved) events.click(chart.x_at(inside(e)));
      held = null;
    });
    host.addEventListener("dblclick", () => events.zoom(null));
    host.addEventListener(
      "wheel",
      e => {
        e.preventDefault();
        const x = chart.x_at(inside(e)),
          factor = Math.exp(Math.max(-1, Math.min(1, e.deltaY / 240))),
          [a, b] = chart.window;
        const next = [x + (a - x) * factor, x + (b - x) * factor],
          whole = chart.extent[1] - chart.extent[0];
        if (next[1] - next[0] > whole * LEAST) events.zoom(next[1] - next[0] >= whole ? null : within(chart, next));
      },
      {passive: false},
    );
  };
})();
