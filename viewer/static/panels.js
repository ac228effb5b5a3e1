"use strict";
// Panels at the left: layers, statistics, findings; the verdict in the heading; the readout over the picture.
(() => {
  const $ = id => document.getElementById(id);
  const make = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };
  const ROLES = {workpiece: "Workpiece", fixture: "Fixture", machine: "Machine", tool: "Tool"};

  class Panels {
    constructor(app) {
      this.app = app;
      $("title").textContent = app.manifest.title;
      $("subtitle").textContent = [
        app.manifest.program,
        app.manifest.corrected && `→ ${app.manifest.corrected}`,
        app.manifest.machine && `· ${app.manifest.machine}`,
        app.manifest.frame && `· frame ${app.manifest.frame}`,
        app.manifest.digest && `· ${app.manifest.digest}`,
      ]
        .filter(Boolean)
        .join(" ");
      $("subtitle").title = $("subtitle").textContent;
      this.layers();
      this.findings();
      this.verdict();
      OLP.on("metric", () => this.statistics());
      OLP.on("layers", () => {
        this.tick();
        this.statistics();
        this.readout();
      });
      OLP.on("time", () => this.readout());
      OLP.on("theme", () => {
        this.swatches();
        this.readout();
      });
    }

    layers() {
      const {app} = this,
        entries = [...app.layers.values()].map(l => [l.name, l.label, l.visible, "line"]);
      entries.push(["rapids", "Rapid moves", true, "dashes"]);
      for (const [role, {labels}] of Object.entries(app.meshes.shown))
        entries.push([
          role,
          role === "tool" ? "Tool" : labels.length === 1 && labels[0] ? labels[0] : (ROLES[role] ?? role),
          true,
          "solid",
        ]);
      for (const [name, label, on, kind] of entries) {
        app.state.layers[name] = on;
        const box = make("input", {
          type: "checkbox",
          id: "layer-" + name,
          checked: on,
          onchange: () => app.set_layer(name, box.checked),
        });
        const swatch = make("span", {className: "swatch " + kind});
        swatch.dataset.layer = name;
        $("layers").append(make("label", {title: label}, box, swatch, make("span", {textContent: label, className: "name"})));
      }
    }

    swatches() {
      const {app} = this;
      for (const swatch of $("layers").querySelectorAll(".swatch")) {
        const layer = app.layers.get(swatch.dataset.layer);
        if (layer) swatch.style.background = layer.colour;
        const mesh = app.meshes.shown[swatch.dataset.layer];
        if (mesh) swatch.style.background = `#${mesh.objects[0].material.color.getHexString()}`;
      }
    }

    tick() {
      for (const [name, on] of Object.entries(this.app.state.layers)) {
        const box = $("layer-" + name);
        if (box) box.checked = on;
      }
    }

    // Of the deviation the figures of the proof and of the comparison, of other metrics those of the points shown.
    statistics() {
      const {app} = this,
        metric = app.metrics.find(app.state.metric) ?? app.plot_metric(),
        names = app.metrics.layers(metric).filter(n => app.layers.get(n).visible),
        unit = OLP.colour.unit_label(metric?.unit),
        proved = metric === app.plot_metric(),
        what = proved ? "moves that count" : "points shown";
      const table = make(
        "table",
        {},
        make("caption", {textContent: metric ? `${metric.label}${unit ? ", " + unit : ""}, ${what}` : ""}),
        make("tr", {}, make("th"), ...names.map(n => make("th", {}, this.key(app.layers.get(n))))),
      );
      if (proved) this.packed_rows(table, names);
      else this.shown_rows(table, metric, names);
      $("statistics").replaceChildren(table, ...this.facts());
    }

    shown_rows(table, metric, names) {
      const parts = names.map(n => this.app.metrics.summary(metric, n)),
        {number} = OLP.colour;
      for (const [label, show] of [
        ["largest", p => number(p.largest)],
        ["mean", p => number(p.mean)],
        ["rms", p => number(p.rms)],
      ])
        table.append(
          make("tr", {}, make("th", {textContent: label}), ...parts.map(p => make("td", {textContent: p ? show(p) : "–"}))),
        );
    }

    key(layer) {
      const mark = make("span", {className: "key", title: layer.label, textContent: layer.name});
      mark.style.borderColor = layer.colour;
      return mark;
    }

    // The file's own figures of layers: one row per label.
    packed_rows(table, names) {
      const rows = new Map(),
        {um} = OLP.colour;
      for (const s of this.app.manifest.statistics ?? [])
        if (s.layer) rows.set(s.label, {...rows.get(s.label), [s.layer]: s});
      for (const [label, by] of rows) {
        if (!names.some(n => by[n])) continue;
        table.append(
          make(
            "tr",
            {},
            make("th", {textContent: label}),
            ...names.map(n =>
              make("td", {textContent: by[n] ? um(by[n].value) : "–"}),
            ),
          ),
        );
      }
    }

    // Figures of the whole job.
    facts() {
      const list = (this.app.manifest.statistics ?? []).filter(s => !s.layer),
        table = make("table", {className: "facts"});
      for (const {label, value, unit} of list)
        table.append(
          make(
            "tr",
            {},
            make("th", {textContent: label}),
            make("td", {
              textContent:
                `${typeof value === "number" ? OLP.colour.number(value, 4) : value} ${OLP.colour.unit_label(unit)}`.trim(),
            }),
          ),
        );
      return list.length ? [table] : [];
    }

    findings() {
      const {app} = this,
        list = app.manifest.findings ?? [],
        order = ["error", "warning", "info"];
      $("findings-count").textContent = list.length || "";
      $("findings-box").open = list.some(f => f.severity === "error");
      if (!list.length) $("findings").append(make("p", {className: "empty", textContent: "None."}));
      for (const f of [...list].sort((p, q) => order.indexOf(p.severity) - order.indexOf(q.severity)).slice(0, 500)) {
        const entry = make(
          "button",
          {className: `finding ${order.includes(f.severity) ? f.severity : "info"}`},
          make("b", {textContent: f.code}),
          make("span", {textContent: f.line ? `${f.message} (line ${f.place ?? f.line})` : f.message}),
        );
        entry.disabled = !f.line;
        entry.onclick = () => app.go_to_line(app.listing.names ? f.place : f.line);
        $("findings").append(entry);
      }
    }

    // The verdict of the file; this page computes none.
    verdict() {
      const box = $("verdict"),
        {verdict} = this.app.manifest;
      box.hidden = !verdict;
      if (!verdict) return;
      const [name, word] = verdict.ok === null ? ["open", "NOT JUDGED"] : verdict.ok ? ["pass", "PASS"] : ["fail", "FAIL"];
      box.className = name;
      box.replaceChildren(make("b", {textContent: word}), make("span", {textContent: verdict.text}));
      box.title = verdict.text;
    }

    readout() {
      const {app} = this,
        {state, manifest} = app,
        nominal = app.layers.get("nominal") ?? app.layers.values().next().value,
        p = nominal.at(state.sample_at, 0),
        number = v => (v <= -0.05 ? "−" : "") + Math.abs(v).toFixed(1);
      const line = app.listing?.number(state.row, 0),
        table = make("table");
      table.append(
        make(
          "tr",
          {},
          make("th", {textContent: line ? `line ${line}` : ""}),
          ...["X", "Y", "Z", ""].map(a => make("th", {textContent: a})),
        ),
      );
      table.append(
        make(
          "tr",
          {},
          make("th", {textContent: "nominal, mm"}),
          ...p.map((v, j) => make("td", {textContent: (v + manifest.origin_mm[j]).toFixed(3).replace("-", "−")})),
          make("td"),
        ),
      );
      for (const layer of app.layers.values()) {
        if (!layer.D || !layer.visible) continue;
        const at = layer.own(state.sample_at),
          a = layer.at(at, 0),
          d = layer.at(at, 1).map((v, j) => 1e3 * (v - a[j])),
          cells = [...d.map(number), number(Math.hypot(...d))];
        table.append(make("tr", {}, make("th", {}, this.key(layer), ", µm"), ...cells.map(t => make("td", {textContent: t}))));
      }
      $("readout").replaceChildren(table);
    }
  }

  OLP.make = make;
  OLP.Panels = Panels;
})();
