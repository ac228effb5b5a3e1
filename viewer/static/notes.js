"use strict";
// Notes on points of the path; saving the page with them; a view in the address.
(() => {
  const $ = id => document.getElementById(id),
    make = (...a) => OLP.make(...a);

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
      $("callouts-box").open = app.state.callouts.length > 0;
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
      this.app.state.callouts.push({sample: Math.round(this.app.state.sample_at), text, layer: this.app.tool_layer().name});
      this.changed();
    }

    remove(i) {
      this.app.state.callouts.splice(i, 1);
      this.changed();
    }

    changed() {
      this.list();
      $("callouts-box").open = true;
      this.app.overlay.draw();
    }

    list() {
      const {app} = this,
        {callouts} = app.state;
      $("callouts-count").textContent = callouts.length || "";
      $("callouts").replaceChildren(
        ...callouts.map((note, i) => {
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
      if (!callouts.length)
        $("callouts").append(
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
      const manifest = JSON.stringify({...this.app.manifest, callouts: this.app.state.callouts}).replaceAll("<", "\\u003c");
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

    view() {
      const {state, scale, camera} = this.app;
      return {
        time: state.time,
        span: state.span,
        exaggeration: state.exaggeration,
        metric: state.metric,
        layers: state.layers,
        theme: state.theme,
        callouts: state.callouts,
        camera: camera.save(),
        scale: {min: scale.min, max: scale.max, mode: scale.mode, map: scale.map},
      };
    }

    hash() {
      const bytes = new TextEncoder().encode(JSON.stringify(this.view()));
      return (
        "#view=" +
        btoa(String.fromCharCode(...bytes))
          .replaceAll("+", "-")
          .replaceAll("/", "_")
          .replaceAll("=", "")
      );
    }

    share() {
      history.replaceState(null, "", this.hash());
      navigator.clipboard?.writeText(location.href).catch(() => {});
      this.app.toast("The address now holds this view and its notes", 4000);
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
      const {app} = this;
      app.set_theme(view.theme === "dark" ? "dark" : "light");
      for (const [name, on] of Object.entries(view.layers ?? {})) app.set_layer(name, on);
      app.set_metric(String(view.metric ?? ""));
      Object.assign(app.scale, view.scale);
      app.scale.apply();
      app.set_exaggeration(+view.exaggeration);
      app.state.callouts = (view.callouts ?? []).map(c => ({sample: +c.sample || 0, text: String(c.text), layer: c.layer}));
      this.list();
      app.set_time(+view.time || 0);
      if (view.span) app.set_span(view.span);
      if (view.camera) app.camera.restore(view.camera);
      OLP.emit("row");
      return true;
    }
  }

  OLP.Notes = Notes;
})();
