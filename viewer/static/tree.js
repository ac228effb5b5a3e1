"use strict";
// The part in its own terms: operations and features with their deviations and verdicts, which the file states.
(() => {
  const $ = id => document.getElementById(id),
    make = (...a) => OLP.make(...a);
  const SYMBOL = {true: "●", false: "▲", null: "○"},
    WORDS = {true: "within", false: "above", null: "not judged"};

  class Tree {
    constructor(app) {
      this.app = app;
      const tree = app.manifest.tree ?? {nodes: [], kinds: {}, unlisted: 0};
      this.ranges = tree.samples ? app.arrays.get(tree.samples) : [];
      this.nodes = tree.nodes.map(node => ({...node, samples: this.samples(node), children: [], open: false, shown: true, wanted: true}));
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
      this.draw();
    }

    // Ranges [first, last] of the samples of a node, from those of all nodes.
    samples({ranges: [begin, end]}) {
      return Array.from({length: end - begin}, (_, k) => [this.ranges[2 * (begin + k)], this.ranges[2 * (begin + k) + 1]]);
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
      const label = make("span", {className: "label", title: `${node.label} ${node.detail ?? ""}, lines ${node.lines}`}, `${node.label} `);
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
        this.app.filter.set_tool(tool.tool);
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
      const ranges = node.samples;
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

    // Shows the nodes that pass the filter, those above them, and all below an operation that does.
    narrow(text, tool, operation) {
      const wanted = node =>
        (!tool || String(node.tool) === tool) &&
        (!text || `${node.label} ${node.detail ?? ""}`.toLowerCase().includes(text));
      const show = (node, under) => {
        const children = node.children.map(n => show(n, under)).some(Boolean);
        node.wanted = under && wanted(node);
        node.shown = children || node.wanted;
        if (text && children) node.open = true;
        return node.shown;
      };
      for (const root of this.roots) show(root, !operation || String(root.id) === operation);
    }

    // The nodes that pass the filter themselves.
    named() {
      return this.nodes.filter(n => n.wanted);
    }
  }

  OLP.Tree = Tree;
})();
