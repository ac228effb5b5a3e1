"use strict";
// What the reader chooses of the picture: which one, colours, enlargement, layers, section plane. None of it changes a verdict.
(() => {
  const $ = id => document.getElementById(id);
  const ROLES = {workpiece: "Workpiece", fixture: "Fixture", machine: "Machine", tool: "Tool"};

  class Display {
    constructor(app) {
      this.app = app;
      this.section = {axis: "", at: 0, flip: false};
      this.switch();
      this.scales();
      this.layers();
      this.sections();
      OLP.on("picture", () => this.show());
      for (const event of ["scale", "exaggeration", "metric"]) OLP.on(event, () => this.show());
      OLP.on("layers", () => this.tick());
      OLP.on("theme", () => this.swatches());
    }

    // The pictures as a row of buttons, and the blend between them.
    switch() {
      const {pictures} = this.app;
      this.buttons = pictures.list.map((picture, k) =>
        OLP.make("button", {
          textContent: picture.label[0].toUpperCase() + picture.label.slice(1),
          title: `Picture: ${picture.label} (${"QER"[k] ?? ""})`,
          onclick: () => pictures.show(k),
        }),
      );
      this.buttons.forEach((button, k) => {
        button.setAttribute("role", "radio");
        button.id = `picture-${pictures.list[k].name}`;
        button.onkeydown = e => {
          const step = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[e.key];
          if (!step || e.shiftKey || e.ctrlKey || e.metaKey || e.altKey) return;
          e.preventDefault();
          e.stopPropagation();
          const to = (k + step + this.buttons.length) % this.buttons.length;
          pictures.show(to);
          this.buttons[to].focus();
        };
      });
      $("pictures").replaceChildren(...this.buttons);
      Object.assign($("blend"), {max: Math.max(0, pictures.list.length - 1), hidden: pictures.list.length < 2});
      $("blend").oninput = e => pictures.show(+e.target.value);
      $("switch").hidden = !pictures.list.length;
    }

    scales() {
      const {app} = this,
        {metrics, pictures, manifest} = app,
        select = $("metric"),
        option = m => new Option(m.label, m.name),
        by_source = new Set(manifest.sources ?? []),
        own = metrics.list.filter(m => !by_source.has(m.name)),
        sources = metrics.list.filter(m => by_source.has(m.name));
      select.append(...own.map(option));
      if (sources.length) select.append(OLP.make("optgroup", {label: "by error source"}, ...sources.map(option)));
      select.onchange = () => app.set_metric(select.value);
      $("basis").append(new Option("what the picture is judged by", "own"));
      if (manifest.part_tolerance_um > 0)
        $("basis").append(new Option(`part tolerance, ${OLP.colour.number(manifest.part_tolerance_um)} µm`, "part"));
      $("basis").append(new Option("display tolerance", "display"));
      $("basis").onchange = e => {
        pictures.set_basis(e.target.value);
        if (e.target.value === "display" && pictures.basis !== "display") $("display-um").focus();
      };
      $("display-um").onchange = e => {
        const value = OLP.colour.parse(e.target.value);
        pictures.set_basis(value > 0 ? "display" : "own", value);
      };
      $("exaggeration").onchange = e => {
        const value = OLP.colour.parse(e.target.value);
        pictures.set_exaggeration(Number.isFinite(value) ? value : null);
      };
      $("exaggeration-auto").onclick = () => pictures.set_exaggeration(null);
      $("exaggeration-slider").oninput = e => pictures.set_exaggeration(+(10 ** +e.target.value).toPrecision(2));
      $("same").onchange = e => pictures.set_same(e.target.checked);
    }

    show() {
      const {app} = this,
        {pictures} = app,
        k = pictures.exaggeration();
      this.buttons.forEach((button, i) => {
        const on = pictures.list[i] === pictures.current;
        button.setAttribute("aria-checked", on);
        button.tabIndex = on ? 0 : -1;
      });
      $("blend").value = pictures.at;
      const words = pictures.list.map((p, i) => [p.label, pictures.weight(i)]).filter(([, w]) => w > 0);
      $("blend").setAttribute("aria-valuetext", words.map(([label, w]) => `${label} ${Math.round(100 * w)} %`).join(", "));
      $("metric").value = app.state.metric;
      $("basis").value = pictures.basis;
      $("basis").disabled = $("display-um").disabled = !app.metric?.judged;
      $("display-um").value = pictures.display_um === null ? "" : String(pictures.display_um);
      $("same").checked = pictures.same;
      $("exaggeration").value = k.toLocaleString("en", {maximumFractionDigits: 2, useGrouping: true});
      $("exaggeration-slider").value = Math.log10(k);
    }

    // Layers that belong to no picture, and bodies.
    layers() {
      const {app} = this,
        free = [...app.layers.values()].filter(l => !app.pictures.of_layer(l.name)),
        entries = free.map(l => [l.name, l.label, Boolean(app.state.layers[l.name])]);
      entries.push(["whiskers", "whiskers from the nominal path", true], ["rapids", "rapid moves", true]);
      for (const [role, {labels}] of Object.entries(app.meshes.shown))
        entries.push([role, role !== "tool" && labels.length === 1 && labels[0] ? labels[0] : (ROLES[role] ?? role), role !== "machine"]);
      for (const [name, label, on] of entries) {
        app.state.layers[name] = on;
        if (Object.hasOwn(app.meshes.shown, name)) app.meshes.set_visible(name, on);
        const box = OLP.make("input", {
          type: "checkbox",
          id: "layer-" + name,
          checked: on,
          onchange: () => app.set_layer(name, box.checked),
        });
        const swatch = OLP.make("span", {className: "swatch"});
        swatch.dataset.layer = name;
        $("layers").append(
          OLP.make("label", {title: label}, box, swatch, OLP.make("span", {textContent: label, className: "name"})),
        );
      }
    }

    swatches() {
      const {app} = this;
      for (const swatch of $("layers").querySelectorAll(".swatch")) {
        const {layer: name} = swatch.dataset,
          layer = app.layers.get(name),
          mesh = app.meshes.shown[name];
        if (mesh) {
          swatch.classList.add("solid");
          swatch.style.background = `#${mesh.objects[0].material.color.getHexString()}`;
        } else {
          swatch.style.borderTopStyle = name === "rapids" || layer?.dashes[1] ? "dashed" : "solid";
          swatch.style.borderTopColor = `var(${name === "rapids" ? "--rapid" : "--nominal"})`;
        }
      }
    }

    tick() {
      for (const [name, on] of Object.entries(this.app.state.layers)) {
        const box = $("layer-" + name);
        if (box) box.checked = on;
      }
    }

    sections() {
      const {app, section} = this;
      $("section-axis").onchange = e => this.set_section({axis: e.target.value, at: null});
      $("section-at").onchange = e => {
        const value = OLP.colour.parse(e.target.value);
        if (Number.isFinite(value)) this.set_section({at: value});
        else this.set_section({});
      };
      $("section-slider").oninput = e => this.set_section({at: +e.target.value});
      $("section-flip").onclick = () => this.set_section({flip: !section.flip});
      this.set_section({});
      app.section = section;
    }

    // Leaves out what is beyond the plane across an axis at a place in mm of the frame shown; `at` null is its middle.
    set_section(change) {
      const {app} = this,
        {box} = app.camera,
        section = Object.assign(this.section, change);
      const j = "XYZ".indexOf(section.axis);
      if (section.axis === "" || j < 0) section.axis = "";
      const on = section.axis !== "";
      for (const id of ["section-at", "section-slider", "section-flip"]) $(id).disabled = !on;
      $("section-axis").value = section.axis;
      $("section-flip").setAttribute("aria-pressed", Boolean(section.flip));
      if (on) {
        const origin = app.manifest.origin_mm[j],
          [low, high] = [box[0][j] + origin, box[1][j] + origin];
        if (!Number.isFinite(section.at)) section.at = (low + high) / 2;
        Object.assign($("section-slider"), {min: low, max: high, value: section.at});
        $("section-at").value = String(+section.at.toFixed(3));
        const sign = section.flip ? -1 : 1,
          normal = [0, 0, 0];
        normal[j] = sign;
        app.scene.set_plane([...normal, sign * (section.at - origin)]);
      } else {
        $("section-at").value = "";
        app.scene.set_plane(null);
      }
    }
  }

  OLP.Display = Display;
})();
