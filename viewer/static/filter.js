"use strict";
// What is kept of the program: by name, tool, operation, lines and kind of move. The rest is drawn faintly; listing, figures
// and CSV follow.
(() => {
  const $ = id => document.getElementById(id),
    KINDS = ["", "feed", "rapid"],
    LONGEST = 200; // characters of a name from a link
  // Ranges of the samples of a node; of an operation rapids as well.
  const spans = node => node.spans ?? node.samples;

  class Filter {
    constructor(app) {
      this.app = app;
      this.lines = [null, null]; // first and last row of the listing; null is open
      this.only = null; // ranges of samples that were selected, or null
      this.rows = null; // by row of the listing: 1 where it is kept
      const {tools, roots} = app.tree,
        numbers = tools.map(t => t.tool).filter(t => t !== null);
      $("filter-tool").append(new Option("all", ""), ...numbers.sort((p, q) => p - q).map(t => new Option(`T${t}`, t)));
      $("filter-operation").append(new Option("all", ""), ...roots.map(n => new Option(n.label, n.id)));
      for (const id of ["filter-tool", "filter-operation", "filter-kind"]) $(id).onchange = () => this.apply();
      for (const id of ["filter-first", "filter-last"]) $(id).onchange = () => this.read_lines();
      $("filter-text").oninput = () => this.apply();
      $("filter-clear").onclick = () => this.restore({});
      $("filter-chosen").onclick = () => this.keep_chosen();
      $("export").onclick = () => OLP.save_csv(app);
      for (const event of ["chosen", "filter"]) OLP.on(event, () => this.summary());
      this.summary();
    }

    // The rows of the lines that are named in the fields.
    read_lines() {
      const {listing} = this.app,
        end = (id, last) => {
          const text = $(id).value.trim();
          if (!text) return null;
          let row = listing.row_of_line(listing.names ? text : +text);
          if (row < 0) {
            this.app.toast(`No line ${text}`, 2500);
            $(id).value = ""; // the summary names the lines that are kept
            return null;
          }
          if (last && listing.names) while (row + 1 < listing.n && String(listing.number(row + 1, 0)) === text) row++;
          return row;
        };
      const [first, last] = [end("filter-first", false), end("filter-last", true)];
      if (first !== null && last !== null && first > last) this.app.toast("The first line is after the last", 2500);
      this.lines = [first, last];
      this.apply();
    }

    // Keeps the lines from one row of the listing to another; null is open.
    set_lines(first, last) {
      const name = row => (row === null ? "" : String(this.app.listing.number(row, 0)));
      this.lines = [first, last];
      $("filter-first").value = name(first);
      $("filter-last").value = name(last);
      this.apply();
    }

    set_tool(tool) {
      $("filter-tool").value = String(tool);
      this.apply();
    }

    // Keeps what is selected, and nothing else.
    keep_chosen() {
      const {chosen} = this.app.state;
      if (!chosen.length) this.app.toast("Select a feature or a line first", 3000);
      else this.restore({only: chosen});
    }

    // What a link says of the filter; lines are those of the nominal text.
    view() {
      const {numbers} = this.app.listing,
        line = row => (row === null ? null : numbers[0][row]);
      return {
        text: $("filter-text").value,
        tool: $("filter-tool").value,
        operation: $("filter-operation").value,
        lines: this.lines.map(line),
        kind: $("filter-kind").value,
        only: this.only,
      };
    }

    // Takes of a view what can be; the rest is no filter.
    restore({text, tool, operation, lines, kind, only}) {
      const {listing} = this.app,
        choose = (id, value) => {
          $(id).value = typeof value === "string" && [...$(id).options].some(o => o.value === value) ? value : "";
        },
        row = line => (Number.isInteger(line) && line > 0 && listing.numbers[0].includes(line) ? listing.numbers[0].indexOf(line) : null);
      $("filter-text").value = typeof text === "string" ? text.slice(0, LONGEST) : "";
      choose("filter-tool", tool);
      choose("filter-operation", operation);
      $("filter-kind").value = KINDS.includes(kind) ? kind : "";
      const ranges = this.app.ranges(only);
      this.only = ranges.length ? ranges : null;
      const [first, last] = Array.isArray(lines) ? lines : [];
      this.set_lines(row(first), row(last));
    }

    apply() {
      const {app} = this,
        {tree} = app,
        text = $("filter-text").value.trim().toLowerCase(),
        tool = $("filter-tool").value,
        operation = $("filter-operation").value,
        kind = $("filter-kind").value,
        [first, last] = this.lines;
      tree.narrow(text, tool, operation);
      const by_line = first !== null || last !== null,
        by_sample = Boolean(text || tool || operation || kind || this.only);
      this.rows = null;
      if (by_line || by_sample) {
        const mask = new Uint8Array(app.samples).fill(1);
        if (tool) this.intersect(mask, tree.tools.find(t => String(t.tool) === tool).spans);
        if (operation) this.intersect(mask, spans(tree.nodes.find(n => String(n.id) === operation)));
        if (text) this.intersect(mask, tree.named().flatMap(spans));
        if (this.only) this.intersect(mask, this.only);
        const [low, high] = [first ?? -Infinity, last ?? Infinity];
        for (let i = 0; i < mask.length; i++) {
          const row = app.rows[i];
          if (by_line && (row < low || row > high)) mask[i] = 0;
          if ((kind === "feed" && app.kind[i]) || (kind === "rapid" && app.kind[i] !== OLP.RAPID)) mask[i] = 0;
        }
        this.rows = new Uint8Array(app.listing.n);
        for (let i = 0; i < mask.length; i++) if (mask[i] && app.rows[i] >= 0) this.rows[app.rows[i]] = 1;
        // lines without a move are kept as well where lines alone are asked for
        if (!by_sample) this.rows.fill(1, first ?? 0, (last ?? app.listing.n) + 1);
        app.set_mask(mask);
      } else app.set_mask(null);
      tree.draw();
    }

    intersect(mask, ranges) {
      const own = new Uint8Array(mask.length);
      for (const [a, b] of ranges) own.fill(1, Math.max(0, a), b + 1);
      for (let i = 0; i < mask.length; i++) mask[i] &= own[i];
    }

    // What is selected or passes the filter, by the table's figures of its lines.
    summary() {
      const {app} = this,
        kept = app.kept(),
        {um} = OLP.colour;
      if (!kept) {
        $("selection").textContent = "Click a feature to go there, or drag along the strip below the picture.";
        return;
      }
      const {points, rows} = app.rows_of(kept),
        lines = rows.reduce((a, b) => a + b, 0),
        largest = app.pictures.list.map(picture => {
          const most = Math.max(...picture.layers.map(name => app.largest_of(rows, name)));
          return most < 0 ? null : `${picture.label} ${um(most)}`;
        });
      $("selection").textContent =
        `${app.state.chosen.length ? "Selected" : `Filtered${this.between()}`}: ${points.toLocaleString("en")} points of ` +
        `${lines.toLocaleString("en")} ${lines === 1 ? "line" : "lines"}; largest, µm: ${largest.filter(Boolean).join(" → ") || "–"}`;
    }

    between() {
      const [first, last] = ["filter-first", "filter-last"].map(id => $(id).value);
      return this.lines.every(row => row === null) ? "" : `, lines ${first || "first"} to ${last || "last"}`;
    }
  }

  OLP.Filter = Filter;
})();
