"use strict";
// The verdict with its questions and figures, findings, statistics, and the readout over the picture. What is said here is
// what the table of judgements says; this page computes no verdict.
(() => {
  const $ = id => document.getElementById(id);
  const make = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };
  const ANSWER = new Map([
    [true, ["pass", "yes"]],
    [false, ["fail", "NO"]],
    [null, ["open", "open"]],
  ]);
  const WORD = new Map([
    [true, ["pass", "PASS"]],
    [false, ["fail", "FAIL"]],
    [null, ["open", "NOT JUDGED"]],
  ]);
  const MOST_FINDINGS = 500;
  // Sentences of the proof are in ASCII, for terminals.
  const micrometres = text => text.replace(/\bum\b/g, "µm");

  // The questions of a verdict: what fails is read first.
  OLP.questions = verdict => (verdict?.questions ?? []).toSorted((p, q) => (q.ok === false) - (p.ok === false));

  // What is to be said of pictures beside their figures.
  OLP.notes_of = app =>
    app.pictures.list.filter(p => p.note).map(p => make("p", {className: "empty note-of", textContent: `${p.label}: ${micrometres(p.note)}`}));

  class Panels {
    constructor(app) {
      this.app = app;
      const {manifest} = app;
      $("title").textContent = manifest.title;
      $("subtitle").textContent = [
        manifest.program,
        manifest.corrected && `→ ${manifest.corrected}`,
        manifest.machine && `· ${manifest.machine}`,
        manifest.frame && `· frame ${manifest.frame}`,
        manifest.digest && `· ${manifest.digest}`,
      ]
        .filter(Boolean)
        .join(" ");
      $("subtitle").title = $("subtitle").textContent;
      this.card();
      this.findings();
      for (const event of ["metric", "picture", "chosen", "filter"]) OLP.on(event, () => this.statistics());
      for (const event of ["time", "picture", "row"]) OLP.on(event, () => this.readout());
    }

    // Verdict, questions, the largest deviation of each picture with its place, and what the correction removed.
    card() {
      const {verdict} = this.app.manifest,
        box = $("verdict");
      box.hidden = !verdict;
      if (verdict) {
        const [name, word] = WORD.get(verdict.ok);
        box.className = name;
        box.textContent = word;
      }
      const questions = OLP.questions(verdict).map(q => {
        const [name, word] = ANSWER.get(q.ok);
        return make(
          "dl",
          {className: "question"},
          make("span", {className: `answer ${name}`, textContent: word}),
          make("dt", {textContent: q.question}),
          make("dd", {textContent: micrometres(q.sentence)}),
        );
      });
      for (const question of verdict?.unasked ?? [])
        questions.push(
          make(
            "dl",
            {className: "question"},
            make("span", {className: "answer open", textContent: "not asked"}),
            make("dt", {textContent: question}),
            make("dd", {textContent: "No part tolerance is stated."}),
          ),
        );
      const remarks = (verdict?.remarks ?? []).map(text => make("p", {className: "remark", textContent: micrometres(text)}));
      $("card").replaceChildren(this.figures(), ...OLP.notes_of(this.app), ...this.removed(), ...questions, ...remarks);
    }

    figures() {
      const {um} = OLP.colour,
        {app} = this,
        longest = Math.max(...app.pictures.list.map(p => `${p.flag?.line ?? ""}${p.lines_above ?? ""}`.length)),
        table = make("table", {className: longest > 9 ? "tight" : ""});
      table.append(
        make("tr", {}, ...["µm", "largest", "rms", "line", "above"].map(t => make("th", {textContent: t, scope: "col"}))),
      );
      app.pictures.list.forEach((picture, k) => {
        const line = make("button", {className: "line", textContent: picture.flag?.line ?? "–", title: "Go there"});
        line.disabled = !picture.flag;
        line.onclick = () => {
          app.pictures.show(k);
          app.go_to_flag(picture);
        };
        table.append(
          make(
            "tr",
            {},
            make("th", {textContent: picture.label, scope: "row"}),
            make("td", {}, make("b", {textContent: um(picture.largest_um)})),
            make("td", {textContent: um(picture.rms_um)}),
            make("td", {}, line),
            make("td", {textContent: picture.lines_above ?? "–", title: picture.lines_above > OLP.MOST_MARKS ? `lines above what they are judged by; of more than ${OLP.MOST_MARKS} the picture marks none: its colours tell` : "lines above what they are judged by"}),
          ),
        );
      });
      return table;
    }

    removed() {
      const {removed} = this.app.manifest,
        {um} = OLP.colour;
      if (!removed || removed.percent === null) return [];
      const less = removed.percent >= 0;
      return [
        make("p", {
          id: "removed",
          textContent: `The correction ${less ? "removes" : "ADDS"} ${Math.abs(removed.percent).toFixed(1)} % of the largest: ${um(removed.before_um)} → ${um(removed.after_um)} µm`,
        }),
      ];
    }

    // Of the deviation the figures of the proof and of the comparison, of other metrics those of the points shown; of what
    // is selected or passes the filter those of the table and of its points.
    statistics() {
      const {app} = this,
        metric = app.metric,
        names = app.metrics.layers(metric).filter(n => app.pictures.of_layer(n)),
        unit = OLP.colour.unit_label(metric?.unit),
        proved = Boolean(metric?.judged),
        kept = app.kept(),
        part = kept ? (app.state.chosen.length ? ", selected" : ", filtered") : "";
      const table = make(
        "table",
        {},
        make("caption", {
          textContent: metric ? `${metric.label}${unit ? ", " + unit : ""}, ${proved ? "moves that count" : "points shown"}${part}` : "",
        }),
        make("thead", {}, make("tr", {}, make("th"), ...names.map(n => make("th", {textContent: app.pictures.of_layer(n).label, scope: "col"})))),
      );
      if (proved && kept) this.kept_rows(table, names, kept);
      else if (proved) this.proved_rows(table, names);
      else if (metric?.kind !== "state") this.shown_rows(table, metric, names, kept);
      $("statistics").replaceChildren(table, ...this.facts());
    }

    // What the table says of the lines that are kept.
    kept_rows(table, names, kept) {
      const {app} = this,
        {rows} = app.rows_of(kept),
        row = (label, cells) => table.append(make("tr", {}, make("th", {textContent: label}), ...cells.map(t => make("td", {textContent: t}))));
      row(
        "largest",
        names.map(n => app.largest_of(rows, n)).map(v => (v < 0 ? "–" : OLP.colour.um(v))),
      );
      row(
        "lines above",
        names.map(n => app.above_of(rows, n)),
      );
    }

    shown_rows(table, metric, names, kept) {
      const parts = names.map(n => this.app.metrics.summary(metric, n, kept)),
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

    // The file's own figures of layers: one row per label.
    proved_rows(table, names) {
      const rows = new Map(),
        {um} = OLP.colour;
      for (const s of this.app.manifest.statistics ?? [])
        if (s.layer) rows.set(s.label, {...rows.get(s.label), [s.layer]: s});
      for (const [label, by] of rows)
        if (names.some(n => by[n]))
          table.append(
            make(
              "tr",
              {},
              make("th", {textContent: label}),
              ...names.map(n => make("td", {textContent: by[n] ? um(by[n].value) : "–"})),
            ),
          );
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
      if (!list.length) $("findings").append(make("p", {className: "empty", textContent: "None."}));
      for (const f of [...list]
        .sort((p, q) => order.indexOf(p.severity) - order.indexOf(q.severity))
        .slice(0, MOST_FINDINGS)) {
        const entry = make(
          "button",
          {className: `finding ${order.includes(f.severity) ? f.severity : "info"}`},
          make("b", {textContent: f.code}),
          make("span", {
            textContent: `${f.severity}: ${micrometres(f.message)}${f.line ? ` (line ${f.place ?? f.line})` : ""}`,
          }),
        );
        entry.disabled = !f.line;
        entry.onclick = () => app.go_to_line(app.listing.names ? f.place : f.line);
        $("findings").append(entry);
      }
      if (list.length > MOST_FINDINGS)
        $("findings").append(make("p", {className: "empty", textContent: `${list.length - MOST_FINDINGS} more are in the report.`}));
    }

    // Where the tool is, by how much it is off there in each picture, and what the table states of its line, which may be
    // at a place between two points; nothing while it is where it began.
    readout() {
      const {app} = this,
        {state, manifest} = app,
        {um} = OLP.colour;
      $("readout").hidden = state.sample_at === 0;
      const nominal = app.layers.get("nominal") ?? app.layers.values().next().value,
        p = nominal.at(state.sample_at, 0),
        number = v => (v <= -0.005 ? "−" : "") + Math.abs(v).toFixed(2);
      const line = app.listing?.number(state.row, 0),
        table = make("table"),
        row = (head, cells, className = "") => table.append(make("tr", {className}, make("th", {textContent: head}), ...cells.map(t => make("td", {textContent: t}))));
      table.append(
        make(
          "tr",
          {},
          make("th", {textContent: line ? `line ${line}` : ""}),
          ...["X", "Y", "Z", app.distance ? `${app.distance.label} here` : "", "line, at most"].map(a => make("th", {textContent: a})),
        ),
      );
      row("nominal, mm", [...p.map((v, j) => (v + manifest.origin_mm[j]).toFixed(3).replace("-", "−")), "", ""]);
      for (const layer of app.layers.values()) {
        const label = app.pictures.of_layer(layer.name)?.label;
        if (!layer.D || !label) continue;
        const stated = um(app.stated_um(layer.name, state.row)),
          other = app.pictures.current.layers.includes(layer.name) ? "" : "other";
        if (!layer.knows(state.sample_at)) {
          row(`${label}, µm`, ["–", "–", "–", "–", stated], other);
          continue;
        }
        const at = layer.own(state.sample_at),
          a = layer.at(at, 0),
          d = layer.at(at, 1).map((v, j) => 1e3 * (v - a[j])),
          size = app.metrics.values(app.distance, layer.name)?.[Math.ceil(at - 1e-9)] ?? NaN;
        row(`${label}, µm`, [...d.map(number), size === size ? number(size) : "–", stated], other);
      }
      for (const name of app.pictures.current.layers) {
        const part = app.side_um(name, state.row),
          text = `${um(part)} µm of the line's ${um(app.stated_um(name, state.row))} may be backlash: its side is not known yet`;
        if (part > 0) table.append(make("tr", {}, make("td", {className: "side", colSpan: 6, textContent: text})));
      }
      $("readout").replaceChildren(table);
    }
  }

  OLP.make = make;
  Object.assign(OLP, {WORD, micrometres});
  OLP.Panels = Panels;
})();
