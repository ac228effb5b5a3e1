"use strict";
// Colour maps that are even in lightness, so that colour-blind readers see the order too, and their look-up tables.
(() => {
  // Control points in OKLCH (lightness, chroma, hue in degrees): lightness is monotonic in every sequential map, and
  // on either side of the middle in every diverging one; hues avoid the red-green pair.
  const MAPS = {
    ember: {
      label: "blue – violet – amber",
      stops: [
        [0.38, 0.17, 264],
        [0.5, 0.2, 300],
        [0.61, 0.2, 352],
        [0.72, 0.17, 40],
        [0.82, 0.16, 80],
      ],
    },
    lagoon: {
      label: "violet – teal – lime",
      stops: [
        [0.34, 0.13, 300],
        [0.47, 0.1, 250],
        [0.6, 0.1, 190],
        [0.72, 0.14, 150],
        [0.84, 0.17, 118],
      ],
    },
    slate: {
      label: "blue – grey – yellow",
      stops: [
        [0.34, 0.12, 262],
        [0.47, 0.05, 262],
        [0.59, 0.01, 110],
        [0.71, 0.08, 95],
        [0.84, 0.15, 95],
      ],
    },
  };
  const DIVERGING = {
    light: [
      [0.42, 0.15, 258],
      [0.62, 0.13, 246],
      [0.83, 0.01, 250],
      [0.66, 0.15, 58],
      [0.47, 0.13, 48],
    ],
    dark: [
      [0.78, 0.12, 236],
      [0.62, 0.13, 250],
      [0.44, 0.01, 250],
      [0.66, 0.15, 55],
      [0.82, 0.15, 75],
    ],
  };
  // Okabe and Ito's blue and vermilion, for lines within and above.
  const STATES = {light: ["#0072b2", "#d55e00"], dark: ["#3b9bd9", "#ff7a2e"]};
  const UNKNOWN = {light: "#8a94a3", dark: "#76818f"};
  const SIZE = 1024;

  function oklch_rgb([L, C, h]) {
    const a = C * Math.cos((h * Math.PI) / 180),
      b = C * Math.sin((h * Math.PI) / 180);
    const l = (L + 0.3963377774 * a + 0.2158037573 * b) ** 3,
      m = (L - 0.1055613458 * a - 0.0638541728 * b) ** 3,
      s = (L - 0.0894841775 * a - 1.291485548 * b) ** 3;
    const linear = [
      4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
      -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
      -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
    ];
    return linear.map(v => 255 * Math.min(1, Math.max(0, v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055)));
  }

  // Interpolated in OKLab's plane, where a straight line between two colours is even to the eye.
  function along(stops, x) {
    const at = Math.min(1, Math.max(0, x)) * (stops.length - 1),
      i = Math.min(stops.length - 2, Math.floor(at)),
      f = at - i;
    const [p, q] = [stops[i], stops[i + 1]].map(([L, C, h]) => [
      L,
      C * Math.cos((h * Math.PI) / 180),
      C * Math.sin((h * Math.PI) / 180),
    ]);
    const [L, a, b] = p.map((v, j) => v + f * (q[j] - v));
    return oklch_rgb([L, Math.hypot(a, b), (Math.atan2(b, a) * 180) / Math.PI]);
  }

  const hex_rgb = text => [1, 3, 5].map(i => parseInt(text.slice(i, i + 2), 16));

  // Colour of the fraction x of a scale; `scale` = {kind, mode, map, theme}. The lower half of states is within.
  function rgb(scale, x) {
    if (scale.mode === "states") return hex_rgb(STATES[scale.theme][x < 0.5 ? 0 : 1]);
    const at = scale.mode === "steps" ? (Math.min(9, Math.floor(x * 10)) + 0.5) / 10 : x;
    if (scale.kind === "diverging") return along(DIVERGING[scale.theme], at);
    const {stops} = MAPS[scale.map];
    // On a dark ground the dark end is lighter; the steps are still even.
    return along(scale.theme === "dark" ? stops.map(([L, C, h]) => [0.5 + 0.8 * (L - 0.34), C, h]) : stops, at);
  }

  // Table of SIZE + 1 colours as RGBA bytes: the last is for unknown values.
  function table(scale) {
    const out = new Uint8Array(4 * (SIZE + 1));
    for (let i = 0; i < SIZE; i++) out.set([...rgb(scale, i / (SIZE - 1)), 255], 4 * i);
    out.set([...hex_rgb(UNKNOWN[scale.theme]), 255], 4 * SIZE);
    return out;
  }

  // The same hue, light or dark enough to be read on the theme's ground.
  function readable(hex, theme) {
    const [r, g, b] = hex_rgb(hex).map(v => ((v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    const l = Math.cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b),
      m = Math.cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b),
      s = Math.cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
    const L = 0.2104542553 * l + 0.793617785 * m - 0.0040720468 * s,
      A = 1.9779984951 * l - 2.428592205 * m + 0.4505937099 * s,
      B = 0.0259040371 * l + 0.7827717662 * m - 0.808675766 * s;
    const turned = oklch_rgb([
      theme === "dark" ? Math.max(L, 0.74) : Math.min(L, 0.6),
      Math.hypot(A, B),
      (Math.atan2(B, A) * 180) / Math.PI,
    ]);
    return "#" + turned.map(v => Math.round(v).toString(16).padStart(2, "0")).join("");
  }

  // Smallest round number that is not below x.
  function round_up(x) {
    if (!(x > 0)) return 1;
    const unit = 10 ** Math.floor(Math.log10(x));
    return +([1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10].find(m => m * unit >= x * (1 - 1e-9)) * unit).toPrecision(6);
  }

  // Round steps that divide [lo, hi] into about `count` parts.
  function ticks(lo, hi, count) {
    const span = hi - lo;
    if (!(span > 0) || !Number.isFinite(span)) return [lo];
    const raw = span / Math.max(1, count),
      unit = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].find(m => m * unit >= raw * (1 - 1e-9)) * unit,
      out = [];
    for (let k = Math.ceil(lo / step - 1e-9); k * step <= hi + 1e-9 * span; k++) out.push(k * step);
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
  const um = v => (v === null || v === undefined || Number.isNaN(v) ? "–" : v < 0.005 ? "<0.01" : v.toFixed(2));

  const unit_label = unit =>
    unit === "um"
      ? "µm"
      : String(unit ?? "")
          .replace("_", "/")
          .replace("deg", "°")
          .replace("mm/s2", "mm/s²")
          .replace("mm/s3", "mm/s³");

  Object.assign(OLP, {colour: {MAPS, SIZE, rgb, table, round_up, ticks, number, um, unit_label, hex_rgb, readable}});
})();
