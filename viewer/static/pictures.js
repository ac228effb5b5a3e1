"use strict";
// The pictures of the job - uncorrected, corrected, measured - that switch and blend, each with bands and an enlargement
// of its own. What a picture is judged by, its largest deviation and its flag are those of the table of judgements.
(() => {
  const SHARE = 0.03; // size of the largest deviation, enlarged, as a share of the size of the job
  const LARGEST = 1e5;

  class Pictures {
    constructor(app, size) {
      this.app = app;
      this.size = size; // of the job, mm
      this.list = (app.manifest.pictures ?? [])
        .map(p => ({...p, layers: p.layers.filter(n => app.layers.has(n))}))
        .filter(p => p.layers.length);
      this.at = Math.max(0, this.list.length - 1); // between two pictures both are drawn, each in part
      this.basis = "own"; // what bands are in units of: what the picture is judged by, the part tolerance, the reader's
      this.display_um = null;
      this.same = false; // one scale and one enlargement for all
    }

    get current() {
      return this.list[Math.round(this.at)] ?? null;
    }
    // Layer of the tool and of the readout.
    get layer() {
      return this.app.layers.get(this.current?.flag?.layer ?? this.current?.layers[0]) ?? this.app.layers.values().next().value;
    }
    weight(k) {
      return Math.max(0, 1 - Math.abs(this.at - k));
    }
    of_layer(name) {
      return this.list.find(p => p.layers.includes(name)) ?? null;
    }

    // Shows picture number `at`, or a blend of the two beside it.
    show(at) {
      this.at = Math.max(0, Math.min(this.list.length - 1, Number.isFinite(+at) ? +at : this.at));
      if (this.same) this.rescale();
      else this.draw();
      OLP.emit("picture");
    }

    // What bands of a deviation are in units of, um; null where nothing is stated.
    tolerance(picture) {
      if (this.basis === "display" && this.display_um > 0) return this.display_um;
      if (this.basis === "part" && this.app.manifest.part_tolerance_um > 0) return this.app.manifest.part_tolerance_um;
      return picture.tolerance_um;
    }

    set_basis(basis, display_um = this.display_um) {
      this.basis = ["own", "part", "display"].includes(basis) ? basis : "own";
      this.display_um = Number.isFinite(display_um) && display_um > 0 ? display_um : null;
      if (this.basis === "display" && this.display_um === null) this.basis = "own";
      this.rescale();
    }

    set_same(on) {
      this.same = Boolean(on);
      for (const picture of this.list) picture.chosen = null;
      this.rescale();
    }

    // Largest value of the metric on the layers of a picture; of the deviation at least what the table states.
    largest(picture) {
      const {metrics} = this.app,
        metric = this.app.metric,
        values = picture.layers.map(n => metrics.summary(metric, n)?.largest ?? 0);
      return Math.max(0, metric?.judged ? (picture.largest_um ?? 0) : 0, ...values);
    }

    // The largest deviation that is drawn of a layer, um.
    size_of(name) {
      const layer = this.app.layers.get(name);
      return layer.judged ? (this.app.metrics.summary(this.app.distance, name)?.largest ?? 0) : 1e3 * Math.max(0, ...layer.spread);
    }

    // Bands and enlargement of every picture for the present metric.
    rescale() {
      const {app} = this,
        {colour} = OLP,
        palette = app.manifest.palette[app.state.theme],
        metric = app.metric;
      const largest = this.list.map(p => this.largest(p)),
        sizes = this.list.map(p => Math.max(p.largest_um ?? 0, ...p.layers.map(n => this.size_of(n)))),
        all = Math.max(0, ...largest);
      this.list.forEach((picture, k) => {
        picture.automatic = this.enlargement(this.same ? Math.max(...sizes) : sizes[k]);
        const tolerance = metric?.judged ? this.tolerance(this.same ? this.current : picture) : null;
        if (!metric || !picture.layers.some(name => name in metric.by_layer)) picture.scale = null;
        else if (metric.kind === "state")
          picture.scale = {edges: [0, 1.5, 2.5], tolerance: 1.5, shades: [palette.within[5], palette.above[4]]};
        else {
          const top = this.same ? all : largest[k],
            edges = metric.kind === "diverging" ? colour.signed_bands(top) : colour.bands(top, tolerance);
          picture.scale = {edges, tolerance, shades: colour.shades(edges, tolerance, palette)};
        }
      });
      this.draw();
      OLP.emit("scale");
    }

    // A round factor at which a deviation is a small share of the job's size.
    enlargement(largest_um) {
      if (!(largest_um > 0)) return 1;
      const wanted = (SHARE * this.size) / (1e-3 * largest_um),
        unit = 10 ** Math.floor(Math.log10(wanted));
      return Math.max(1, Math.min(LARGEST, [5, 2, 1].find(m => m * unit <= wanted) * unit));
    }

    exaggeration(picture = this.current) {
      return picture ? (picture.chosen ?? picture.automatic ?? 1) : 1;
    }

    // The enlargement of the current picture, or with null the automatic one; of all where they have the same.
    set_exaggeration(k) {
      const chosen = Number.isFinite(k) && k !== null ? Math.max(1, Math.min(LARGEST, k)) : null;
      for (const picture of this.same ? this.list : [this.current]) if (picture) picture.chosen = chosen;
      this.draw();
      OLP.emit("exaggeration");
    }

    // Enlargement of a layer: that of its picture; the command has that of the current one.
    k_of(layer) {
      return layer.D ? this.exaggeration(this.of_layer(layer.name) ?? this.current) : 0;
    }

    // Gives the lines their values, bands, enlargement and opacity.
    draw() {
      const {app} = this,
        {scene, metrics} = app;
      for (const lines of scene.lines.values()) {
        const {path, uniforms: u} = lines,
          k = this.list.findIndex(p => p.layers.includes(path.name)),
          picture = this.list[k],
          weight = picture ? this.weight(k) : 1;
        path.visible = picture ? weight > 0 : Boolean(app.state.layers[path.name]);
        u.opacity.value = Math.sqrt(weight);
        u.k.value = this.k_of(path);
        path.values = picture ? metrics.values(app.metric, path.name) : null;
        lines.set_bands(path.values ? picture.scale : null);
        scene.viewer.set_property(["olp", path.name], "visible", path.visible);
      }
      app.show_rapids();
      app.place();
      scene.schedule(0);
    }
  }

  OLP.Pictures = Pictures;
})();
