"use strict";
// Notes on points of the path; saving the page with them; a view in the address.
(() => {
  const $ = id => document.getElementById(id),
    make = (...a) => OLP.make(...a),
    MOST_RANGES = 2000; // of a selection in a link

  class Notes {
    constructor(app) {
      this.app = app;
      $("callout").onclick = () => this.ask();
      $("save").onclick = () => this.save();
      $("share").onclick = () => this.share();
      $("note").addEventListener("close", () => {
        const text = $("note-text").value.trim();
        if ($("note").returnValue === "ok" && text) this.add(text);
      });
      window.addEventListener("hashchange", () => this.restore());
      this.list();
    }

    ask() {
      const {app} = this,
        line = app.listing.number(app.state.row, 0);
      $("note-where").textContent = `${line ? `line ${line}, ` : ""}${app.state.time.toFixed(3)} s`;
      $("note-text").value = "";
      $("note").returnValue = "";
      $("note").showModal();
    }

    add(text) {
      this.app.state.notes.push({sample: Math.round(this.app.state.sample_at), text, layer: this.app.pictures.layer.name});
      this.changed();
    }

    remove(i) {
      this.app.state.notes.splice(i, 1);
      this.changed();
    }

    changed() {
      this.list();
      this.app.overlay.show();
    }

    list() {
      const {app} = this,
        {notes} = app.state;
      $("notes").replaceChildren(
        ...notes.map((note, i) => {
          const go = make(
            "button",
            {
              className: "finding info",
              onclick: () => {
                app.set_sample(note.sample);
                app.select_row(app.row_at(), true);
                app.camera.reveal(app.tool_point());
              },
            },
            make("b", {textContent: i + 1}),
            make("span", {textContent: note.text}),
          );
          return make(
            "div",
            {className: "note"},
            go,
            make("button", {className: "icon", title: "Remove", textContent: "✕", onclick: () => this.remove(i)}),
          );
        }),
      );
      if (!notes.length)
        $("notes").append(
          make("p", {
            className: "empty",
            textContent: "None yet. C writes one on the current point; Save keeps them in the file.",
          }),
        );
    }

    // The page as it was sent, with the current notes in its manifest.
    html() {
      const {head, body} = OLP.shell,
        scripts = [...document.querySelectorAll("body > script")].slice(1);
      const manifest = JSON.stringify({...this.app.manifest, notes: this.app.state.notes}).replaceAll("<", "\\u003c");
      const open = '<script type="application/json" id="olp-manifest">';
      const parts = scripts.map(s => (s.id === "olp-manifest" ? open + manifest + "</" + "script>" : s.outerHTML));
      return `<!DOCTYPE html>\n<html lang="en">\n${head}\n<body>${body}\n${parts.join("\n")}\n</body>\n</html>\n`;
    }

    save() {
      const name = `${(this.app.manifest.program || "review").replace(/[^\w.-]+/g, "-").replace(/\.\w+$/, "")}-review.html`;
      const address = URL.createObjectURL(new Blob([this.html()], {type: "text/html"})),
        link = make("a", {href: address, download: name});
      link.click();
      setTimeout(() => URL.revokeObjectURL(address), 10000);
      this.app.toast(`Saved as ${name}`, 4000);
    }

    // What a link holds. Of a selection of very many parts an address is too short.
    view() {
      const {state, pictures, camera, section, plots, filter} = this.app,
        short = ranges => (ranges && ranges.length <= MOST_RANGES ? ranges : null),
        kept = filter.view();
      return {
        time: state.time,
        chosen: short(state.chosen) ?? [],
        filter: {...kept, only: short(kept.only)},
        trail: state.trail,
        abscissa: plots.abscissa,
        motion: plots.motion,
        metric: state.metric,
        layers: state.layers,
        theme: state.theme,
        notes: state.notes,
        camera: camera.save(),
        picture: pictures.at,
        basis: pictures.basis,
        display_um: pictures.display_um,
        same: pictures.same,
        enlargement: pictures.list.map(p => p.chosen ?? null),
        section,
        strip: plots.kind,
      };
    }

    hash() {
      const bytes = new TextEncoder().encode(JSON.stringify(this.view()));
      return (
        "#view=" +
        btoa(Array.from(bytes, code => String.fromCharCode(code)).join(""))
          .replaceAll("+", "-")
          .replaceAll("/", "_")
          .replaceAll("=", "")
      );
    }

    share() {
      history.replaceState(null, "", this.hash());
      navigator.clipboard?.writeText(location.href).catch(() => {});
      const {state, filter} = this.app,
        whole = [state.chosen, filter.only ?? []].every(ranges => ranges.length <= MOST_RANGES);
      this.app.toast(`The address now holds this view and its notes${whole ? "" : ", but the selection has too many parts for it"}`, 4000);
    }

    // Restores the view in the address; one that cannot be read is ignored.
    restore() {
      const text = /^#view=([\w-]+)$/.exec(location.hash)?.[1];
      if (!text) return false;
      let view;
      try {
        const raw = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
        view = JSON.parse(new TextDecoder().decode(Uint8Array.from(raw, c => c.charCodeAt(0))));
      } catch {
        this.app.toast("The view in the address cannot be read", 4000);
        return false;
      }
      if (view === null || typeof view !== "object") return false;
      this.apply(view);
      return true;
    }

    // Takes of a view what can be; the rest stays as it is.
    apply(view) {
      const {app} = this,
        {pictures} = app,
        list = v => (Array.isArray(v) ? v : []),
        last = app.samples - 1,
        whole = v => Number.isInteger(v) && v >= 0 && v <= last,
        text = (v, other) => (typeof v === "string" ? v : other);
      if (["dark", "light"].includes(view.theme)) app.set_theme(view.theme);
      for (const [name, on] of Object.entries(view.layers ?? {})) app.set_layer(name, on);
      list(view.enlargement).forEach((k, i) => {
        if (pictures.list[i]) pictures.list[i].chosen = Number.isFinite(k) && k >= 1 ? Math.min(1e5, k) : null;
      });
      pictures.same = view.same === true;
      pictures.set_basis(view.basis, view.display_um);
      app.set_metric(text(view.metric, app.state.metric));
      if (Number.isFinite(view.picture)) pictures.show(view.picture);
      if (Array.isArray(view.notes))
        app.state.notes = view.notes
          .filter(n => n && whole(n.sample))
          .map(n => ({sample: n.sample, text: text(n.text, "").slice(0, 500), layer: text(n.layer, "")}));
      this.list();
      if (Number.isFinite(view.time)) app.set_time(view.time);
      if (view.filter && typeof view.filter === "object") app.filter.restore(view.filter);
      app.choose(app.ranges(view.chosen));
      if (typeof view.trail === "boolean") app.set_trail(view.trail);
      if (view.camera && typeof view.camera === "object") app.camera.restore(view.camera);
      if (view.section && typeof view.section === "object") {
        const {axis, at, flip} = view.section;
        app.display.set_section({axis: ["X", "Y", "Z"].includes(axis) ? axis : "", at: Number.isFinite(at) ? at : null, flip: flip === true});
      }
      app.plots.set_strip(view.strip);
      app.plots.set_motion(view.motion);
      app.plots.set_abscissa(view.abscissa);
      OLP.emit("row");
      OLP.emit("picture");
    }
  }

  OLP.Notes = Notes;
})();
