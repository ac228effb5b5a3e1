"use strict";
// The part in its own terms: operations and features with their deviations and verdicts, which the file states; what is
// filtered and selected; its points as CSV.
(() => {
  const $ = id => document.getElementById(id),
    make = (...a) => OLP.make(...a);
  const SYMBOL = {true: "●", false: "▲", null: "○"},
    WORDS = {true: "within", false: "above", null: "not judged"};

  // The lines of a node, as the listing names them.
  const lines_of = node => (node.first_line === node.last_line ? node.place : `${node.place} to ${node.last_place ?? node.last_line}`);

  class Tree {
    constructor(app) {
      this.app = app;
      const tree = app.manifest.tree ?? {nodes: [], kinds: {}, unlisted: 0};
      this.nodes = tree.nodes.map(node => ({...node, children: [], open: false, shown: true}));
      this.kinds = tree.kinds ?? {};
      this.unlisted = tree.unlisted ?? 0;
      this.tools = tree.tools ?? [];
      const by_id = new Map(this.nodes.map(n => [n.id, n]));
      for (const node of this.nodes) by_id.get(node.parent)?.children.push(node);
      this.roots = this.nodes.filter(n => !by_id.has(n.parent));
      for (const node of this.roots) node.open = this.nodes.length < 60 || this.roots.length === 1;
      this.current = null;
      this.host = $("tree");
      this.host.addEventListener("keydown", e => this.key(e));
      this.filter();
      this.draw();
      for (const event of ["chosen", "filter"]) OLP.on(event, () => this.summary());
      this.summary();
    }

    // Nodes in the order in which they are shown, those in closed ones left out.
    *visible(list = this.roots, depth = 0) {
      for (const node of list) {
        if (!node.shown) continue;
        yield [node, depth];
        if (node.open) yield* this.visible(node.children, depth + 1);
      }
    }

    draw() {
      const rows = [...this.visible()].map(([node, depth]) => this.row(node, depth)),
        here = rows.find(row => row.getAttribute("aria-selected") === "true") ?? rows[0];
      if (here) here.tabIndex = 0;
      $("tree-head").textContent = rows.length
        ? `${this.app.pictures.list.map(p => p.label).join(" → ")}, µm`
        : this.nodes.length
          ? "Nothing passes the filter."
          : "No features are listed.";
      $("tree-foot").replaceChildren(...this.tools.map(tool => this.tool(tool)));
      if (this.unlisted) $("tree-foot").append(make("p", {className: "empty", textContent: `${this.unlisted} more features are not listed.`}));
      this.host.replaceChildren(...rows);
    }

    row(node, depth) {
      const {um} = OLP.colour,
        sizes = this.app.pictures.list.map(p => this.largest(node, p)).filter(v => v !== undefined),
        row = make("div", {className: "node"});
      row.setAttribute("role", "treeitem");
      row.setAttribute("aria-level", depth + 1);
      row.setAttribute("aria-selected", node === this.current);
      if (node.children.length) row.setAttribute("aria-expanded", node.open);
      row.tabIndex = -1;
      row.style.paddingLeft = `${4 + 12 * depth}px`;
      row.dataset.id = node.id;
      const label = make("span", {className: "label", title: `${node.label} ${node.detail ?? ""}, lines ${lines_of(node)}`}, `${node.label} `);
      label.append(make("small", {textContent: node.detail ?? ""}));
      const size = make("span", {className: "figures"}, make("span", {title: "largest deviation of what counts"}, `largest ${sizes.map(um).join(" → ")}`));
      size.append(...this.figures(node));
      const fold = make("span", {className: "fold", textContent: node.children.length ? (node.open ? "▾" : "▸") : ""});
      row.append(fold, label, this.mark(node), size);
      row.onclick = e => {
        if (e.target === fold) this.fold(node, !node.open);
        else this.go(node);
      };
      return row;
    }

    // A tool with what the table says of it; a click keeps its moves.
    tool(tool) {
      const sizes = this.app.pictures.list.map(p => this.largest(tool, p)).filter(v => v !== undefined),
        row = make("button", {className: "tool", title: "Keep the moves of this tool"}, make("span", {textContent: `Tool: ${tool.label}`}));
      row.append(make("small", {textContent: `largest ${sizes.map(OLP.colour.um).join(" → ")}`}), this.mark(tool));
      row.disabled = tool.tool === null;
      row.onclick = () => {
        $("filter").open = true;
        $("filter-tool").value = String(tool.tool);
        this.apply();
      };
      return row;
    }

    // The verdict of a node or a tool.
    mark(node) {
      const mark = make("span", {className: node.ok === false ? "flagged" : "", textContent: SYMBOL[node.ok], title: WORDS[node.ok]});
      mark.setAttribute("role", "img");
      mark.setAttribute("aria-label", WORDS[node.ok]);
      return mark;
    }

    largest(node, picture) {
      const values = picture.layers.map(n => node.largest_um?.[n]).filter(v => v !== undefined && v !== null);
      return values.length ? Math.max(...values) : undefined;
    }

    // "position 12.3 → 0.4" of each figure, layer by layer.
    figures(node) {
      const {um} = OLP.colour,
        layers = this.app.pictures.list.flatMap(p => p.layers);
      return (node.figures ?? []).flatMap(figure => {
        const values = layers.filter(n => figure.by_layer[n] !== undefined && figure.by_layer[n] !== null).map(n => um(figure.by_layer[n]));
        if (!values.length) return [];
        const meaning = this.kinds[node.kind]?.figures?.[figure.name] ?? "";
        return [make("span", {title: meaning, textContent: ` · ${figure.label} ${values.join(" → ")}`})];
      });
    }

    fold(node, open) {
      node.open = open;
      this.draw();
    }

    // Selects a feature, and goes there.
    go(node) {
      const {app} = this;
      this.current = node;
      if (!node.open && node.children.length) node.open = true;
      const ranges = node.samples.map(([a, b]) => [a, b]);
      const layer = app.pictures.layer.name,
        worst = node.worst_sample?.[layer] ?? ranges[0]?.[1];
      if (worst !== undefined && worst !== null) app.set_sample(worst);
      app.choose(ranges);
      if (ranges.length) app.camera.fit(null, this.box(ranges));
      this.draw();
      this.host.querySelector(`[data-id="${node.id}"]`)?.focus({preventScroll: false});
      OLP.emit("row");
    }

    // The box of ranges of samples, at least a tenth of the job, mm.
    box(ranges) {
      const {app} = this,
        low = [Infinity, Infinity, Infinity],
        high = [-Infinity, -Infinity, -Infinity],
        least = 0.05 * app.pictures.size;
      for (const [a, b] of ranges)
        for (let i = Math.max(0, a - 1); i <= b; i++)
          for (let j = 0; j < 3; j++) {
            low[j] = Math.min(low[j], app.base[3 * i + j]);
            high[j] = Math.max(high[j], app.base[3 * i + j]);
          }
      for (let j = 0; j < 3; j++) {
        const missing = Math.max(0, least - (high[j] - low[j])) / 2;
        low[j] -= missing;
        high[j] += missing;
      }
      return [low, high];
    }

    key(e) {
      const rows = [...this.visible()].map(([node]) => node),
        at = rows.findIndex(n => String(n.id) === e.target.closest?.(".node")?.dataset.id),
        node = rows[at];
      if (!node) return;
      let to = null;
      if (e.key === "ArrowDown") to = rows[at + 1];
      else if (e.key === "ArrowUp") to = rows[at - 1];
      else if (e.key === "Home") to = rows[0];
      else if (e.key === "End") to = rows.at(-1);
      else if (e.key === "ArrowRight" && node.children.length) node.open ? (to = node.children.find(n => n.shown)) : this.fold(node, true);
      else if (e.key === "ArrowLeft") node.open && node.children.length ? this.fold(node, false) : (to = this.nodes.find(n => n.id === node.parent));
      else if (e.key === "Enter" || e.key === " ") this.go(node);
      else return;
      e.preventDefault();
      e.stopPropagation();
      this.host.querySelector(`[data-id="${(to ?? node).id}"]`)?.focus();
    }

    // -- filter ------------------------------------------------------------------------------------------------------

    filter() {
      const tools = [...new Set(this.nodes.map(n => n.tool).filter(t => t !== null && t !== undefined))].sort((p, q) => p - q);
      $("filter-tool").append(new Option("all", ""), ...tools.map(t => new Option(`T${t}`, t)));
      $("filter-operation").append(new Option("all", ""), ...this.roots.map(n => new Option(n.label, n.id)));
      for (const id of ["filter-tool", "filter-operation", "filter-first", "filter-last", "filter-kind"]) $(id).onchange = () => this.apply();
      $("filter-text").oninput = () => this.apply();
      $("filter-clear").onclick = () => this.clear();
      $("filter-chosen").onclick = () => this.keep_chosen();
      $("export").onclick = () => OLP.save_csv(this.app);
    }

    clear() {
      for (const id of ["filter-tool", "filter-operation", "filter-first", "filter-last", "filter-kind", "filter-text"]) $(id).value = "";
      this.apply();
    }

    // The rows of the listing of lines from the first to the last that are named.
    rows_of_lines() {
      const {listing} = this.app,
        end = (id, last) => {
          const text = $(id).value.trim();
          if (!text) return last ? Infinity : -Infinity;
          let row = listing.row_of_line(listing.names ? text : +text);
          if (row < 0) this.app.toast(`No line ${text}`, 2500);
          if (last && row >= 0 && listing.names) while (row + 1 < listing.n && String(listing.number(row + 1, 0)) === text) row++;
          return row < 0 ? (last ? Infinity : -Infinity) : row;
        };
      return [end("filter-first", false), end("filter-last", true)];
    }

    apply() {
      const {app} = this,
        text = $("filter-text").value.trim().toLowerCase(),
        tool = $("filter-tool").value,
        operation = $("filter-operation").value,
        kind = $("filter-kind").value,
        [first, last] = this.rows_of_lines();
      const wanted = node =>
        (!tool || String(node.tool) === tool) &&
        (!text || `${node.label} ${node.detail ?? ""}`.toLowerCase().includes(text));
      const show = (node, under) => {
        const own = under && (!operation || String(node.id) === operation || node.parent !== null),
          children = node.children.map(n => show(n, own)).some(Boolean);
        node.shown = children || (own && wanted(node));
        if (text && children) node.open = true;
        return node.shown;
      };
      for (const root of this.roots) show(root, !operation || String(root.id) === operation);
      const by_node = Boolean(tool || operation || text),
        by_line = first > -Infinity || last < Infinity;
      if (!by_node && !by_line && !kind) app.set_mask(null);
      else {
        const mask = new Uint8Array(app.samples);
        if (by_node) {
          for (const node of this.nodes)
            if (node.shown && wanted(node) && this.under(node, operation))
              for (const [a, b] of node.samples) mask.fill(1, a, b + 1);
        } else mask.fill(1);
        for (let i = 0; i < mask.length; i++) {
          const row = app.rows[i];
          if (by_line && (row < first || row > last)) mask[i] = 0;
          if ((kind === "feed" && app.kind[i]) || (kind === "rapid" && app.kind[i] !== OLP.RAPID)) mask[i] = 0;
        }
        app.set_mask(mask);
      }
      this.draw();
    }

    under(node, operation) {
      for (let at = node; at; at = this.nodes.find(n => n.id === at.parent)) if (!operation || String(at.id) === operation) return true;
      return false;
    }

    // Keeps what is selected.
    keep_chosen() {
      const {app} = this;
      if (!app.state.chosen.length) {
        app.toast("Select a feature or a line first", 3000);
        return;
      }
      const mask = new Uint8Array(app.samples);
      for (const [a, b] of app.state.chosen) mask.fill(1, Math.max(0, a), b + 1);
      app.set_mask(mask);
    }

    // What is selected or passes the filter, by the table's figures of its lines.
    summary() {
      const {app} = this,
        {chosen} = app.state,
        {um} = OLP.colour;
      if (!chosen.length && !app.mask) {
        $("selection").textContent = "Click a feature to go there.";
        return;
      }
      const rows = new Uint8Array(app.first.length);
      let count = 0;
      const take = i => {
        if (app.rows[i] >= 0) rows[app.rows[i]] = 1;
        count++;
      };
      if (chosen.length) for (const [a, b] of chosen) for (let i = Math.max(0, a); i <= b; i++) take(i);
      else for (let i = 0; i < app.mask.length; i++) if (app.mask[i]) take(i);
      const by = app.manifest.listing.by_layer ?? {};
      const parts = app.pictures.list.map(picture => {
        let most = -1;
        for (const name of picture.layers) {
          if (!by[name]) continue;
          const values = app.arrays.get(by[name].um),
            states = app.arrays.get(by[name].state);
          for (let row = 0; row < rows.length; row++) if (rows[row] && states[row] < 2 && values[row] > most) most = values[row];
        }
        return most < 0 ? null : `${picture.label} ${um(most)}`;
      });
      const lines = rows.reduce((a, b) => a + b, 0);
      $("selection").textContent =
        `${chosen.length ? "Selected" : "Filtered"}: ${count.toLocaleString("en")} points of ${lines.toLocaleString("en")} ${lines === 1 ? "line" : "lines"}; ` +
        `largest, µm: ${parts.filter(Boolean).join(" → ") || "–"}`;
    }
  }

  Object.assign(OLP, {Tree, lines_of});
})();
