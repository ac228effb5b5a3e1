"use strict";
// The strip below the picture that nothing covers: bands with their colours, scale bar, enlargement, axes. One function draws
// it, on the page, into pictures that are saved, and into prints.
(() => {
  const BLOCK = 12, // height of the bands, px
    SHARES = 13, // height of the bars above them, px
    RIGHT = 250, // width of scale bar and axes, px
    NARROW = 620; // below this width they have a row of their own

  class Legend {
    constructor(app) {
      this.app = app;
      this.canvas = document.getElementById("legend-canvas");
      this.box = document.getElementById("legend");
      this.fit(); // the picture has what it leaves
      for (const event of ["drawn", "scale", "picture", "exaggeration", "theme", "filter"]) OLP.on(event, () => this.later());
      new ResizeObserver(() => this.later()).observe(this.box);
    }

    later() {
      if (this.waiting) return;
      this.waiting = true;
      requestAnimationFrame(() => {
        this.waiting = false;
        this.show();
      });
    }

    static height(width) {
      return width < NARROW ? 112 : 56;
    }

    // Gives the canvas its size; returns the width.
    fit() {
      const {clientWidth: w} = this.box;
      if (!w) return 0;
      const h = Legend.height(w),
        ratio = window.devicePixelRatio || 1;
      if (this.canvas.width !== Math.round(w * ratio) || this.canvas.height !== Math.round(h * ratio))
        Object.assign(this.canvas, {width: Math.round(w * ratio), height: Math.round(h * ratio)});
      Object.assign(this.canvas.style, {width: w + "px", height: h + "px"});
      return w;
    }

    show() {
      const w = this.fit();
      if (!w) return;
      const c = this.canvas.getContext("2d"),
        ratio = window.devicePixelRatio || 1;
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.clearRect(0, 0, w, Legend.height(w));
      this.draw(c, w);
      this.canvas.setAttribute("aria-label", this.text());
    }

    // What the strip says, in words.
    text() {
      const {pictures, metric} = this.app,
        {current} = pictures,
        scale = current?.scale;
      if (!metric) return "No colours";
      if (!scale) return `${this.title()}: not known for this picture`;
      if (metric.kind === "state") return `${this.title()}: within or above; enlarged ${this.factor()} times`;
      const unit = OLP.colour.unit_label(metric.unit),
        ends = `${OLP.colour.number(scale.edges[0])} to ${OLP.colour.number(scale.edges.at(-1))} ${unit}`;
      return `${this.title()}: ${scale.shades.length} bands from ${ends}${this.unit_text()}; enlarged ${this.factor()} times`;
    }

    // The picture, and what its colours show.
    heading() {
      const {pictures, metric} = this.app,
        unit = OLP.colour.unit_label(metric?.unit);
      return pictures.current && metric ? [pictures.current.label, `: ${metric.label}${unit ? ", " + unit : ""}`] : ["nominal path", ""];
    }
    title() {
      return this.heading().join("");
    }

    // What one unit of the upper numbers is.
    unit_text() {
      const {pictures, metric, manifest} = this.app,
        {current} = pictures;
      if (!metric?.judged || !current) return "";
      const tolerance = current.scale?.tolerance ?? null,
        own = tolerance === current.tolerance_um && pictures.basis !== "display";
      if (tolerance === null) return "; no part tolerance is stated";
      const what = own
        ? current.basis
        : pictures.basis === "part" && tolerance === manifest.part_tolerance_um
          ? "part tolerance"
          : "display tolerance, colours only";
      return `; 1× = ${OLP.colour.um(tolerance)} µm ${what}`;
    }

    factor() {
      return this.app.pictures.exaggeration().toLocaleString("en", {maximumFractionDigits: 2});
    }

    draw(c, w) {
      const style = getComputedStyle(document.documentElement),
        get = name => style.getPropertyValue(name).trim();
      this.look = {ink: get("--ink"), soft: get("--soft"), font: get("--font")};
      const narrow = w < NARROW;
      this.bands(c, 12, 4, narrow ? w - 24 : w - RIGHT - 36);
      this.scale_bar(c, narrow ? 12 : w - RIGHT, narrow ? 98 : 40);
      this.triad(c, w - 36, narrow ? 88 : 30);
    }

    bands(c, x, y, wide) {
      const {app, look} = this,
        {metric, pictures} = app,
        scale = pictures.current?.scale;
      Object.assign(c, {fillStyle: look.ink, textBaseline: "middle", textAlign: "left"});
      const bold = `600 11.5px ${look.font}`,
        plain = `11px ${look.font}`,
        said = !metric ? "" : scale ? this.unit_text().replace(/^; /, "") : "not known for this picture";
      c.font = plain;
      const taken = said ? c.measureText(said).width + 12 : 0;
      c.font = bold;
      const [picture, shown] = this.heading(),
        title = OLP.fitted(c, picture, wide - taken - c.measureText(shown).width) + shown,
        titled = c.measureText(title).width;
      c.fillText(title, x, y + 7);
      Object.assign(c, {font: plain, fillStyle: look.soft});
      c.fillText(said, x + titled + 12, y + 7);
      if (!scale) return;
      const {edges, shades, tolerance} = scale,
        each = Math.min(96, (wide - 56) / shades.length),
        top = y + 15 + SHARES;
      this.shares().forEach((share, k) => {
        c.fillStyle = shades[k];
        c.fillRect(x + k * each, top, each - 1, BLOCK);
        c.fillStyle = look.soft;
        const bar = Math.max(share > 0 ? 1 : 0, Math.round(share * (SHARES - 3)));
        c.fillRect(x + k * each + 1, top - 1 - bar, each - 3, bar);
      });
      c.fillStyle = look.ink;
      c.textBaseline = "top";
      if (metric.kind === "state") {
        ["within", "above"].forEach((word, k) => c.fillText(word, x + k * each, top + BLOCK + 1));
        return;
      }
      let free = -Infinity;
      edges.forEach((edge, k) => {
        const at = x + k * each,
          limit = tolerance !== null && Math.abs(edge - tolerance) < 1e-9 * tolerance,
          text = OLP.colour.number(edge) + (limit ? " = 1×" : tolerance !== null && k === edges.length - 1 ? ` = ${OLP.colour.number(edge / tolerance)}×` : ""),
          half = c.measureText(text).width / 2,
          left = Math.max(x, Math.min(x + wide - 2 * half, at - half));
        if (limit) c.fillRect(at - 1.5, top - 3, 2, BLOCK + 5);
        if (left < free && !limit) return;
        c.fillText(text, left, top + BLOCK + 2);
        free = left + 2 * half + 5;
      });
    }

    // How much of the path is in each band, by length, relative to the largest; what is outside the filter has no part in it.
    shares() {
      const {app} = this,
        {current} = app.pictures,
        {edges, shades} = current.scale,
        key = [current.name, app.state.metric, edges.join(), app.mask_number ?? 0].join("|");
      if (this.key === key) return this.known;
      const sum = new Float64Array(shades.length);
      for (const name of current.layers) {
        const values = app.metrics.values(app.metric, name),
          {index} = app.layers.get(name);
        if (!values) continue;
        for (let i = 1; i < values.length; i++) {
          const at = index ? index[i] : i;
          if (values[i] !== values[i] || (app.mask && !app.mask[at])) continue;
          sum[OLP.colour.band_of(edges, values[i])] += index ? 1 : app.arc[i] - app.arc[i - 1];
        }
      }
      this.key = key;
      const most = Math.max(...sum) || 1;
      return (this.known = Array.from(sum, v => v / most));
    }

    // A round length, and the deviation of that length as drawn.
    scale_bar(c, x, y) {
      const {app, look} = this,
        view = app.scene.view(0),
        {number, round_up} = OLP.colour;
      Object.assign(c, {strokeStyle: look.ink, fillStyle: look.ink, lineWidth: 1.5, textBaseline: "bottom", textAlign: "left"});
      c.font = `600 11.5px ${look.font}`;
      c.fillText(`deviations × ${this.factor()}`, x, y - 19);
      c.font = `11px ${look.font}`;
      if (!view.ortho) {
        c.fillText("perspective: no scale", x, y + 4);
        return;
      }
      const length = round_up(64 / view.scale / 2.5),
        px = length * view.scale,
        drawn = length / app.pictures.exaggeration();
      c.beginPath();
      c.moveTo(x + 0.75, y - 8);
      c.lineTo(x + 0.75, y - 3);
      c.lineTo(x + px, y - 3);
      c.lineTo(x + px, y - 8);
      c.stroke();
      c.textBaseline = "middle";
      const away = drawn < 1 ? `${number(drawn * 1e3)} µm` : `${number(drawn)} mm`;
      c.fillText(`${number(length)} mm of path`, x + px + 8, y - 8);
      c.fillText(`${away} of deviation`, x + px + 8, y + 6);
    }

    triad(c, x, y) {
      const {app, look} = this;
      Object.assign(c, {textAlign: "center", textBaseline: "middle", lineWidth: 2});
      c.font = `600 11px ${look.font}`;
      const axes = app.camera
        .axes()
        .map((a, i) => [...a, "XYZ"[i]])
        .sort((p, q) => p[2] - q[2]);
      for (const [dx, dy, , name] of axes) {
        if (Math.hypot(dx, dy) < 0.08) continue;
        c.strokeStyle = c.fillStyle = look.ink;
        c.beginPath();
        c.moveTo(x, y);
        c.lineTo(x + 16 * dx, y + 16 * dy);
        c.stroke();
        c.fillText(name, x + 24 * dx, y + 24 * dy);
      }
    }
  }

  OLP.Legend = Legend;
})();
