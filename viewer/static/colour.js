"use strict";
// Bands of values and their colours, as olp/review/palette.py has them, and numbers as people read them.
(() => {
  const MOST = 6,
    ROUND = [1, 2, 2.5, 5, 10],
    LEAST_STEP = 0.25,
    ROUNDING = 1e-9,
    LEAST = 1e-6; // a smaller ratio is nothing

  function step_of(least) {
    const unit = 10 ** Math.floor(Math.log10(least));
    return ROUND.map(m => unit * m).find(s => s >= least * (1 - ROUNDING));
  }

  // Multiples of `step` beyond `above`, to the first at or beyond `last`.
  function multiples(above, last, step) {
    const first = Math.floor((above / step) * (1 + ROUNDING)) + 1,
      final = Math.max(first, Math.ceil((last / step) * (1 - ROUNDING)));
    return Array.from({length: final - first + 1}, (_, k) => (first + k) * step);
  }

  // Ascending edges from 0 to the first round number at or above `largest`; with a tolerance its round shares or multiples.
  function bands(largest, tolerance) {
    const unit = tolerance ?? 1,
      ratio = largest / unit < LEAST ? 1 : largest / unit;
    if (tolerance === null || ratio <= 1 + ROUNDING)
      return [0, ...multiples(0, ratio, step_of(ratio / MOST))].map(v => v * unit);
    const within = ratio > 2 * MOST ? [0, 1] : [0, 0.5, 1];
    return [...within, ...multiples(1, ratio, step_of(Math.max((ratio - 1) / MOST, LEAST_STEP)))].map(v => v * unit);
  }

  // Bands of a value with a sign, about zero.
  function signed_bands(largest) {
    const half = bands(largest, null).slice(1);
    return [...half.map(v => -v).reverse(), 0, ...half];
  }

  const spread = (family, k, count) => family[Math.floor(((k + 0.5) / count) * family.length)];

  // The colour of each band between edges, from the families of a theme.
  function shades(edges, tolerance, palette) {
    const negative = edges[0] < 0,
      names = edges.slice(1).map(top =>
        negative ? (top <= 0 ? "minus" : "open") : tolerance === null ? "open" : top <= tolerance * (1 + ROUNDING) ? "within" : "above",
      );
    return names.map((name, k) => {
      const own = names.flatMap((n, i) => (n === name ? [i] : [])),
        at = own.indexOf(k);
      return spread(palette[name], name === "minus" ? own.length - 1 - at : at, own.length);
    });
  }

  // Band of a value: a band ends at its upper edge.
  function band_of(edges, value) {
    let k = 0;
    while (k < edges.length - 2 && value > edges[k + 1]) k++;
    return k;
  }

  // Smallest round number that is not below x.
  function round_up(x) {
    if (!(x > 0)) return 1;
    const unit = 10 ** Math.floor(Math.log10(x));
    return +([1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10].find(m => m * unit >= x * (1 - 1e-9)) * unit).toPrecision(6);
  }

  // Multiples of a round step that divide [lo, hi] into about `count` parts: two or more, as one is no scale.
  function ticks(lo, hi, count) {
    const span = hi - lo;
    if (!(span > 0) || !Number.isFinite(span)) return [lo];
    const raw = span / Math.max(1, count),
      unit = 10 ** Math.floor(Math.log10(raw));
    const first = step => Math.ceil(lo / step - 1e-9),
      last = step => Math.floor(hi / step + 1e-9),
      widest = [1, 2, 5, 10].findIndex(m => m * unit >= raw * (1 - 1e-9)),
      step = [10, 5, 2, 1, 0.5, 0.2, 0.1].slice(3 - widest).find(m => last(m * unit) > first(m * unit)) * unit,
      out = [];
    for (let k = first(step); k <= last(step); k++) out.push(k * step);
    return out;
  }

  function number(v, digits = 3) {
    if (v === null || v === undefined || Number.isNaN(v)) return "–";
    if (v === 0) return "0";
    const size = Math.abs(v);
    if (size >= 1e6 || size < 1e-4)
      return v
        .toExponential(Math.max(0, digits - 1))
        .replace("-", "−")
        .replace("e+", "e");
    return (size >= 10 ** digits ? Math.round(v).toString() : String(+v.toPrecision(digits))).replace("-", "−");
  }

  // A deviation in µm as every report prints it.
  const um = v =>
    v === null || v === undefined || Number.isNaN(v)
      ? "–"
      : v !== 0 && Math.abs(v) < 0.005
        ? "<0.01"
        : v.toFixed(2).replace("-", "−");

  const unit_label = unit =>
    unit === "um"
      ? "µm"
      : String(unit ?? "")
          .replace("_", "/")
          .replace("deg", "°")
          .replace("mm/s2", "mm/s²")
          .replace("mm/s3", "mm/s³");

  // A number as people write it: thousands in commas or spaces, a multiplication sign in front.
  // A decimal comma is none: what it means is not known.
  const parse = text => {
    const plain = String(text)
      .replace(/[×x\s']/g, "")
      .replace("−", "-")
      .replace(/,(?=\d{3}(?:[,.]|$))/g, "");
    return plain === "" ? NaN : Number(plain);
  };

  // A text of a canvas that is no wider than `width`: whole, or with a mark where its end is left out.
  function fitted(c, text, width) {
    if (c.measureText(text).width <= width) return text;
    const letters = [...text];
    while (letters.length && c.measureText(`${letters.join("")}…`).width > width) letters.pop();
    return letters.length ? `${letters.join("")}…` : "";
  }

  Object.assign(OLP, {
    fitted,
    colour: {bands, signed_bands, shades, band_of, round_up, ticks, number, um, unit_label, parse},
  });
})();
