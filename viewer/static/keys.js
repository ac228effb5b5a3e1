"use strict";
// The keyboard, the search box, the panels that fold, the theme.
(() => {
  const $ = id => document.getElementById(id);

  class Keys {
    constructor(app) {
      this.app = app;
      const press = id => () => $(id).click();
      // [keys, description, call]
      this.table = [
        [[" "], "play or pause", press("play")],
        [[",", "ArrowLeft"], "previous block", press("step-back")],
        [[".", "ArrowRight"], "next block", press("step-forward")],
        [["ArrowUp"], "row above", () => app.select_row(Math.max(0, app.state.row - 1))],
        [["ArrowDown"], "row below", () => app.select_row(Math.min(app.listing.n - 1, app.state.row + 1))],
        [["w"], "next worst line", () => this.worst(1)],
        [["W"], "previous worst line", () => this.worst(-1)],
        [["+", "="], "exaggerate more", () => this.exaggerate(1)],
        [["-"], "exaggerate less", () => this.exaggerate(-1)],
        [["1"], "isometric", press("view-iso")],
        [["2"], "top", press("view-top")],
        [["3"], "front", press("view-front")],
        [["4"], "side", press("view-side")],
        [["f"], "show everything", press("fit")],
        [["o"], "orthographic or perspective", press("ortho")],
        [["m"], "measure", press("measure")],
        [["c"], "note on the current point", press("callout")],
        [["t"], "travelled path only", press("trail")],
        [
          ["/"],
          "go to line, search",
          () => {
            $("find").focus();
            $("find").select();
          },
        ],
        [["["], "layers and colours", press("toggle-left")],
        [["]"], "program", press("toggle-right")],
        [["p"], "plots", press("toggle-plots")],
        [["d"], "dark or light", press("theme")],
        [
          ["Escape"],
          "clear the selection",
          () => {
            app.set_span([-1, -1]);
            app.pointer.set_measuring(false);
          },
        ],
        [["?"], "these keys", press("help-open")],
      ];
      document.addEventListener("keydown", e => this.press(e));
      this.wire();
      this.help();
    }

    press(e) {
      if (
        e.ctrlKey ||
        e.metaKey ||
        e.altKey ||
        e.target.closest("input:not([type=checkbox],[type=range]),select,textarea,dialog")
      )
        return;
      if (e.key === " " && e.target.closest("button,summary,[type=checkbox]")) return;
      if (e.key.startsWith("Arrow") && e.target.closest("[type=range]")) return;
      const entry = this.table.find(([keys]) => keys.includes(e.key));
      if (!entry) return;
      e.preventDefault();
      entry[2]();
    }

    wire() {
      const {app} = this;
      for (const name of ["iso", "top", "front", "side"]) $("view-" + name).onclick = () => app.set_view(name);
      $("fit").onclick = () => app.camera.fit();
      $("ortho").onclick = () => {
        app.camera.set_ortho(!app.camera.ortho);
        $("ortho").setAttribute("aria-pressed", app.camera.ortho);
      };
      $("theme").onclick = () => app.set_theme(app.state.theme === "dark" ? "light" : "dark");
      $("help-open").onclick = () => $("help").showModal();
      for (const side of ["left", "right", "plots"])
        $("toggle-" + side).onclick = () => document.body.classList.toggle("no-" + side);
      $("worst").onclick = () => this.worst(1);
      $("find").onkeydown = e => {
        if (e.key === "Enter") this.find();
        if (e.key === "Escape") $("listing").focus();
      };
      $("find-next").onclick = () => this.find();
      this.grip();
    }

    find() {
      const {app} = this,
        text = $("find").value.trim();
      if (!text) return;
      const row = /^\d+$/.test(text) ? app.listing.row_of_line(+text) : app.listing.search(text, app.listing.selected);
      if (row < 0) app.toast(/^\d+$/.test(text) ? `No line ${text}` : "Not found", 2500);
      else app.select_row(row);
    }

    worst(step) {
      const {app} = this,
        point = app.worst(step),
        {um} = OLP.colour;
      if (!point) app.toast("No lines to rank", 2500);
      else
        app.toast(
          `Worst ${point.rank} of ${point.count}: ${um(point.value)} µm, ${app.layers.get(point.layer).label}, line ${app.listing.number(point.row, 0)}`,
          4000,
        );
    }

    exaggerate(direction) {
      const {state} = this.app,
        power = Math.floor(Math.log10(state.exaggeration) + 1e-9),
        steps = [1, 2, 5, 10, 20].map(m => m * 10 ** power),
        before = [0.5, ...steps.slice(0, 3)].map(m => (m < 1 ? 0.5 * 10 ** power : m));
      this.app.set_exaggeration(
        direction > 0
          ? steps.find(m => m > state.exaggeration * 1.001)
          : (before.findLast(m => m < state.exaggeration * 0.999) ?? 1),
      );
    }

    help() {
      const names = {" ": "space", ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓", Escape: "esc"};
      $("help-keys").append(
        ...this.table.map(([keys, what]) =>
          OLP.make(
            "div",
            {},
            ...keys.map(k => OLP.make("kbd", {textContent: names[k] ?? k})),
            OLP.make("span", {textContent: what}),
          ),
        ),
      );
    }

    grip() {
      const grip = $("grip");
      grip.onpointerdown = e => {
        grip.setPointerCapture(e.pointerId);
        e.preventDefault();
      };
      grip.onpointermove = e => {
        if (grip.hasPointerCapture(e.pointerId))
          $("app").style.setProperty(
            "--right",
            `${Math.round(Math.min(innerWidth * 0.6, Math.max(240, innerWidth - e.clientX)))}px`,
          );
      };
    }
  }

  OLP.Keys = Keys;
})();
