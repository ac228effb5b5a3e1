"use strict";
// Puts the page together; errors are shown in the page itself.
(() => {
  const $ = id => document.getElementById(id);

  // Corners of the box of the feed moves of the base path, and the radius about its middle that contains all else.
  function extent(app) {
    const whole = [
        [Infinity, Infinity, Infinity],
        [-Infinity, -Infinity, -Infinity],
      ],
      cut = structuredClone(whole);
    for (let j = 0; j < 3; j++) {
      let [low, high, first, last] = [Infinity, -Infinity, Infinity, -Infinity],
        before = NaN;
      for (let i = 0, k = j; i < app.samples; i++, k += 3) {
        const v = app.base[k];
        if (v < low) low = v;
        if (v > high) high = v;
        if (i > 0 && app.kind[i] === 0) {
          if (v < first) first = v;
          if (v > last) last = v;
          if (before < first) first = before;
          if (before > last) last = before;
        }
        before = v;
      }
      [whole[0][j], whole[1][j], cut[0][j], cut[1][j]] = [low, high, first, last];
    }
    const box = cut[0][0] <= cut[1][0] ? cut : whole,
      size = Math.hypot(...box[0].map((v, j) => box[1][j] - v)) || 10;
    const middle = box[0].map((v, j) => (v + box[1][j]) / 2),
      far = Math.max(
        ...[0, 1].flatMap(a =>
          [0, 1].flatMap(b =>
            [0, 1].map(c => Math.hypot(whole[a][0] - middle[0], whole[b][1] - middle[1], whole[c][2] - middle[2])),
          ),
        ),
      );
    // machine nodes move with the axes, by at most the size of the path
    const meshes = app.meshes.reach.map(
      ([centre, radius]) => Math.hypot(...centre.map((v, j) => v - middle[j])) + radius + 2 * far,
    );
    return {box, size, reach: Math.max(far, ...meshes, size) * 1.5};
  }

  function extend(app) {
    let timer = 0;
    // A message at the bottom of the picture; kind "lost" is shown until it is removed.
    app.toast = (text, ms, kind = "") => {
      const box = $("toast");
      if (text === null) {
        if (box.dataset.kind === kind) box.hidden = true;
        return;
      }
      Object.assign(box, {textContent: text, hidden: false});
      box.dataset.kind = kind;
      clearTimeout(timer);
      if (ms)
        timer = setTimeout(() => {
          box.hidden = true;
        }, ms);
    };
    app.set_theme = theme => {
      app.state.theme = document.documentElement.dataset.theme = theme;
      const style = getComputedStyle(document.documentElement),
        get = name => style.getPropertyValue(name).trim();
      for (const {uniforms: u} of app.scene.lines.values()) {
        u.faint.value.set(get("--rapid"));
        for (const name of ["colour", "unknown"]) u[name].value.set(get("--nominal"));
        u.ink.value.set(get("--ink"));
      }
      $("theme").setAttribute("aria-pressed", theme === "dark");
      app.pictures.rescale();
      OLP.emit("theme");
    };
    app.set_view = name => {
      app.camera.fit(name);
      app.state.view = name;
      OLP.emit("view");
    };
    app.go_to_line = line => {
      const row = app.listing.row_of_line(line);
      if (row >= 0) app.select_row(row);
    };
    app.go_to_flag = (picture = app.pictures.current) => {
      if (!picture?.flag) return;
      app.set_sample(picture.flag.sample);
      app.select_row(app.row_at(), true);
      app.camera.reveal(app.tool_point());
    };
    app.hover_sample = sample => {
      const {layer} = app.pictures;
      app.overlay.hover = sample === null ? null : {layer: layer.name, at: layer.own(sample)};
      app.overlay.show();
    };
    // The picture in words.
    app.text = () => {
      const {current} = app.pictures,
        {um} = OLP.colour,
        drawn = `${app.state.view ? `Seen from ${app.state.view}, d` : "D"}eviations enlarged ${app.legend.factor()} times.`;
      if (!current) return `The nominal path. ${drawn}`;
      const towards = current.flag && OLP.direction(current.flag.direction),
        place = current.flag ? ` at line ${current.flag.line}${towards ? `, towards ${towards}` : ""}` : "";
      return `Picture ${current.label}: the largest deviation is ${um(current.largest_um)} µm${place}. ${drawn}`;
    };
    for (const event of ["picture", "exaggeration", "scale", "view"]) OLP.on(event, () => app.scene.pane.setAttribute("aria-label", app.text()));
  }

  function follow_listing(app) {
    const {listing} = app;
    let kept = -2;
    const show = () => {
      listing.selected = app.state.row;
      listing.current = app.row_at();
      listing.show(app.state.row);
      if (kept === app.state.row) return;
      kept = app.state.row;
      const line = (side, name) => {
        const n = listing.number(app.state.row, side);
        return n
          ? [
              OLP.make(
                "p",
                {},
                OLP.make("b", {textContent: `${name} ${n}`}),
                OLP.make("code", {textContent: listing.text(app.state.row, side)}),
              ),
            ]
          : [];
      };
      $("detail").replaceChildren(...line(0, "nominal"), ...(listing.texts[1] ? line(1, "corrected") : []));
    };
    for (const event of ["time", "row", "chosen"]) OLP.on(event, show);
  }

  async function start() {
    const manifest = JSON.parse($("olp-manifest").textContent);
    const app = new OLP.App(manifest, await OLP.unpack(manifest, $("olp-data").textContent.trim()));
    app.scene = new OLP.Scene(app, $("pane"));
    [...app.layers.values()].forEach((path, order) => app.scene.add_path(path, order));
    app.meshes = new OLP.Meshes(app);
    const {box, size, reach} = extent(app);
    app.camera = new OLP.Camera(app, box, reach);
    app.pictures = new OLP.Pictures(app, size);
    extend(app);
    app.legend = new OLP.Legend(app);
    app.listing = new OLP.Listing(app);
    app.panels = new OLP.Panels(app);
    app.display = new OLP.Display(app);
    app.overlay = new OLP.Overlay(app);
    app.timeline = new OLP.Timeline(app);
    app.plots = new OLP.Plots(app);
    app.tree = new OLP.Tree(app);
    app.filter = new OLP.Filter(app);
    app.pointer = new OLP.Pointer(app);
    app.notes = new OLP.Notes(app);
    app.layout = new OLP.Layout(app);
    app.keys = new OLP.Keys(app);
    OLP.reports(app);
    follow_listing(app);
    if (app.scene.flat) app.scene.viewer.renderer.draw = OLP.flat_drawing(app.scene);
    app.scene.viewer.set_3d_pane_size();
    app.state.metric = app.distance?.name ?? "";
    app.set_theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    app.set_metric(app.state.metric);
    app.set_view("iso");
    app.pictures.show(app.pictures.at);
    app.set_sample(0);
    app.plots.draw();
    app.notes.restore();
    expose(app);
    app.scene.begin();
    OLP.watch(app);
    document.documentElement.dataset.ready = "1";
  }

  // What scripts and tests may use.
  function expose(app) {
    const page = (sample, name = "nominal") => {
      const at = app.scene.project(app.point_of(sample, name)),
        pane = app.scene.pane.getBoundingClientRect();
      return at && [at[0] + pane.left, at[1] + pane.top];
    };
    window.olp = {
      app,
      manifest: app.manifest,
      arrays: app.arrays,
      state: app.state,
      set_time: t => app.set_time(t),
      set_exaggeration: k => app.pictures.set_exaggeration(k),
      show_picture: at => app.pictures.show(at),
      set_metric: name => app.set_metric(name),
      set_layer: (name, on) => app.set_layer(name, on),
      select_row: row => app.select_row(row),
      pick: (x, y) => app.pointer.pick(x, y),
      project: page,
      worst: (next = 1) => app.worst(next),
      frame_ms: () => app.scene.frame_ms(),
      get drawn() {
        return app.scene.drawn;
      },
    };
  }

  start().catch(error => {
    document.documentElement.dataset.error = error.message;
    $("app").replaceChildren(OLP.make("p", {className: "broken", textContent: `This page cannot be shown: ${error.message}`}));
    console.error(error);
  });
})();
