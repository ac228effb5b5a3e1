"use strict";
// What leaves the page: the view as a PNG picture, the pictures as a printed report, the points as CSV.
(() => {
  const $ = id => document.getElementById(id),
    make = (...a) => OLP.make(...a);
  const HEAD = 44, // height of the title of a saved picture, px
    MOST_FEATURES = 60,
    MOST_LINES = 20,
    KINDS = ["counts", "does not count", "start"];

  // A picture as it is in the view: title, paths, overlay and legend, in `ratio` pixels per pixel of the page.
  function picture_of(app) {
    const {pane} = app.scene,
      w = pane.clientWidth,
      h = pane.clientHeight,
      legend = OLP.Legend.height(w),
      ratio = window.devicePixelRatio || 1,
      canvas = Object.assign(document.createElement("canvas"), {width: Math.round(w * ratio), height: Math.round((HEAD + h + legend) * ratio)}),
      c = canvas.getContext("2d"),
      style = getComputedStyle(document.documentElement),
      get = name => style.getPropertyValue(name).trim(),
      {manifest} = app,
      [, word] = OLP.WORD.get(manifest.verdict?.ok ?? null);
    c.scale(ratio, ratio);
    c.fillStyle = get("--panel");
    c.fillRect(0, 0, w, HEAD + h + legend);
    c.fillStyle = get("--scene-low");
    c.fillRect(0, HEAD, w, h);
    Object.assign(c, {fillStyle: get("--ink"), textBaseline: "middle"});
    c.font = "600 14px " + get("--font");
    c.fillText(`${manifest.title}: ${word}`, 12, 14, w - 24);
    c.font = "11.5px " + get("--font");
    c.fillText($("subtitle").textContent, 12, 32, w - 24);
    c.drawImage(app.scene.still(), 0, HEAD, w, h);
    c.save();
    c.translate(0, HEAD);
    c.beginPath();
    c.rect(0, 0, w, h);
    c.clip();
    app.overlay.draw(c, []);
    c.restore();
    c.save();
    c.translate(0, HEAD + h);
    app.legend.draw(c, w);
    c.restore();
    return canvas;
  }

  const stem = app => (app.manifest.program || "review").replace(/[^\w.-]+/g, "-").replace(/\.\w+$/, "");

  OLP.download = (blob, name, app) => {
    const address = URL.createObjectURL(blob),
      link = make("a", {href: address, download: name});
    link.click();
    setTimeout(() => URL.revokeObjectURL(address), 10000);
    app.toast(`Saved as ${name}`, 4000);
  };

  const save_picture = app =>
    picture_of(app).toBlob(blob => OLP.download(blob, `${stem(app)}-${app.pictures.current?.name ?? "view"}.png`, app));

  // A cell of CSV; text that a spreadsheet would take for a formula is quoted by an apostrophe.
  const cell = value => {
    const plain = String(value).replace(/[\x00-\x1f\x7f]/g, " "),
      text = /^[=+\-@]/.test(plain) ? `'${plain}` : plain;
    return /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };

  // The points of the program that are selected, else those that pass the filter, with the deviation of each layer at them;
  // and after each of them the measured points next to it, each with its own nominal point.
  OLP.csv = app => {
    const drawn = [...app.layers.values()].filter(l => l.D && app.pictures.of_layer(l.name)),
      [model, measured] = [drawn.filter(l => !l.index), drawn.filter(l => l.index)],
      names = [...model.map(l => l.name), ...(measured.length ? ["measured"] : [])],
      {origin_mm: origin, frame} = app.manifest,
      heads = ["line", "distance_mm", "time_s", "kind", "X_mm", "Y_mm", "Z_mm", ...names.flatMap(n => ["X", "Y", "Z"].map(a => `${n}_D${a}_um`))],
      rows = [cell(`# ${app.manifest.title}; frame=${frame}`), [...heads, "of"].map(cell).join(",")],
      next = measured.map(() => 0); // the first point of each run that is not passed
    const put = (i, of, kind, base, at, deviations) => {
      const line = app.listing.number(app.rows[i], 0),
        p = [0, 1, 2].map(j => (base[3 * at + j] + origin[j]).toFixed(4));
      rows.push([cell(String(line)), app.arc[i].toFixed(3), app.time[i].toFixed(6), KINDS[kind], ...p, ...deviations, cell(of)].join(","));
    };
    const away = (layer, at) => [0, 1, 2].map(j => (1e3 * layer.D[3 * at + j]).toFixed(3)),
      blank = list => list.flatMap(() => ["", "", ""]),
      kept = app.kept();
    for (let i = 0; i < app.samples; i++) {
      const on = !kept || kept[i];
      if (on) put(i, "program", app.kind[i], app.base, i, [...model.flatMap(l => away(l, i)), ...blank(measured.slice(0, 1))]);
      measured.forEach((layer, k) => {
        for (; next[k] < layer.n && layer.index[next[k]] <= i; next[k]++)
          if (on) put(i, layer.label, layer.kind[next[k]], layer.P, next[k], [...blank(model), ...away(layer, next[k])]);
      });
    }
    return rows.join("\r\n") + "\r\n";
  };

  OLP.save_csv = app => OLP.download(new Blob([OLP.csv(app)], {type: "text/csv"}), `${stem(app)}-points.csv`, app);

  // -- print -----------------------------------------------------------------------------------------------------------

  // A table with columns of these shares of the width, in %.
  function table(head, rows, shares = head.map(() => 100 / head.length)) {
    return make(
      "table",
      {},
      make("colgroup", {}, ...shares.map(share => make("col", {width: `${share}%`}))),
      make("thead", {}, make("tr", {}, ...head.map(t => make("th", {textContent: t})))),
      make("tbody", {}, ...rows.map(row => make("tr", {}, ...row.map(t => make("td", {textContent: t}))))),
    );
  }

  // Every picture in the current view, in light colours, each with its legend.
  function prints(app) {
    const {pictures} = app,
      kept = [pictures.at, app.state.theme];
    app.set_theme("light");
    const figures = pictures.list.map((picture, k) => {
      pictures.show(k);
      app.scene.refill();
      const image = make("img", {src: picture_of(app).toDataURL("image/png"), alt: app.text()});
      return make("figure", {}, image, make("figcaption", {textContent: app.text()}));
    });
    pictures.show(kept[0]);
    app.set_theme(kept[1]);
    app.scene.refill();
    return figures;
  }

  function worst_lines(app) {
    const {um} = OLP.colour,
      name = app.pictures.layer.name;
    return app.rank(name).slice(0, MOST_LINES).map(({row, value}) => [String(app.listing.number(row, 0)), um(value), app.listing.text(row, 0)]);
  }

  function features(app) {
    const {um} = OLP.colour,
      {tree, pictures} = app,
      layers = pictures.list.flatMap(p => p.layers);
    return tree.nodes.slice(0, MOST_FEATURES).map(node => [
      `${node.label} ${node.detail ?? ""}`.trim(),
      node.lines,
      pictures.list.map(p => um(tree.largest(node, p))).join(" → "),
      (node.figures ?? []).map(f => `${f.label} ${layers.filter(n => f.by_layer[n] !== undefined && f.by_layer[n] !== null).map(n => um(f.by_layer[n])).join(" → ")}`).join("; "),
      node.ok === null ? "–" : node.ok ? "within" : "ABOVE",
    ]);
  }

  // The report, built anew for each print.
  function report(app) {
    const {manifest, pictures} = app,
      {um} = OLP.colour,
      [, word] = OLP.WORD.get(manifest.verdict?.ok ?? null);
    const parts = [
      make("h1", {textContent: manifest.title}),
      make("p", {textContent: $("subtitle").textContent}),
      make("p", {}, make("span", {className: "verdict", textContent: word})),
      ...OLP.questions(manifest.verdict).map(q => make("p", {}, make("b", {textContent: q.question}), ` ${OLP.micrometres(q.sentence)}`)),
      ...(manifest.verdict?.unasked ?? []).map(text => make("p", {}, make("b", {textContent: text}), " Not asked: no part tolerance is stated.")),
      ...(manifest.verdict?.remarks ?? []).map(text => make("p", {textContent: OLP.micrometres(text)})),
      table(
        ["deviation, µm", "largest", "rms", "line", "towards", "lines above"],
        pictures.list.map(p => [
          p.label,
          um(p.largest_um),
          um(p.rms_um),
          p.flag?.line ?? "–",
          p.flag ? OLP.direction(p.flag.direction) : "–",
          String(p.lines_above ?? "–"),
        ]),
      ),
      ...OLP.notes_of(app),
    ];
    if ($("removed")) parts.push(make("p", {textContent: $("removed").textContent}));
    parts.push(...prints(app));
    const listed = features(app);
    if (listed.length) parts.push(make("h2", {textContent: "Operations and features"}), table(["feature", "lines", "largest, µm", "figures, µm", "verdict"], listed, [27, 11, 20, 32, 10]));
    if (app.tree.nodes.length > MOST_FEATURES) parts.push(make("p", {textContent: `${app.tree.nodes.length - MOST_FEATURES} more are on the page.`}));
    const lines = worst_lines(app);
    if (lines.length) parts.push(make("h2", {textContent: `Largest deviations, ${pictures.current.label}`}), table(["line", "µm", "text"], lines, [12, 12, 76]));
    const findings = manifest.findings ?? [];
    if (findings.length)
      parts.push(make("h2", {textContent: "Findings"}), table(["code", "finding", "line"], findings.slice(0, 50).map(f => [f.code, OLP.micrometres(f.message), f.place ?? "–"]), [12, 74, 14]));
    if (app.state.notes.length)
      parts.push(
        make("h2", {textContent: "Notes"}),
        table(["line", "note"], app.state.notes.map(n => [String(app.listing.number(app.rows[n.sample], 0)), n.text])),
      );
    $("print").replaceChildren(...parts);
  }

  OLP.reports = app => {
    $("picture").onclick = () => save_picture(app);
    $("print-report").onclick = () => window.print();
    addEventListener("beforeprint", () => report(app));
    app.picture_of = () => picture_of(app);
    app.report = () => report(app);
  };
})();
