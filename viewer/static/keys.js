"use strict";
// The keyboard, and the search box.
(() => {
  const $ = id => document.getElementById(id);
  const TURN = Math.PI / 12, // rad
    NEARER = 1.25;

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
        ...app.pictures.list.slice(0, 3).map((p, k) => [["qer"[k]], `picture: ${p.label}`, () => app.pictures.show(k)]),
        [["b"], "blend to the next picture", () => this.blend()],
        [["g"], "go to the worst place of the picture", () => app.go_to_flag()],
        [["+", "="], "enlarge deviations more", () => this.enlarge(1)],
        [["-"], "enlarge deviations less", () => this.enlarge(-1)],
        ...OLP.VIEWS.map((name, k) => [[String(k + 1)], `view: ${name}`, () => app.set_view(name)]),
        [["f"], "show everything", press("fit")],
        [["o"], "orthographic or perspective", press("ortho")],
        [["Shift ArrowLeft"], "turn to the left", () => app.camera.turn(-TURN, 0)],
        [["Shift ArrowRight"], "turn to the right", () => app.camera.turn(TURN, 0)],
        [["Shift ArrowUp"], "turn up", () => app.camera.turn(0, -TURN)],
        [["Shift ArrowDown"], "turn down", () => app.camera.turn(0, TURN)],
        [["PageUp"], "nearer", () => app.camera.turn(0, 0, NEARER)],
        [["PageDown"], "farther", () => app.camera.turn(0, 0, 1 / NEARER)],
        [["m"], "measure", press("measure")],
        [["Enter"], "measure: take the current point", () => app.pointer.take_current()],
        [["x"], "section plane: next axis", () => this.section()],
        [["i"], "save the view as a picture", press("picture")],
        [["c"], "note on the current point", press("callout")],
        [["t"], "travelled path only", press("trail")],
        [
          ["/"],
          "go to line, search",
          () => {
            app.layout.open("program");
            $("find").focus();
            $("find").select();
          },
        ],
        [["["], "parts", () => app.layout.open("parts")],
        [["]"], "program", () => app.layout.open("program")],
        [["\\"], "display", () => app.layout.open("display")],
        [["n"], "findings and notes", () => app.layout.open("findings")],
        [["p"], "plots", press("toggle-plots")],
        [["d"], "dark or light", press("theme")],
        [
          ["Escape"],
          "clear the selection",
          () => {
            app.choose(OLP.NONE);
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
      if ((e.key === " " || e.key === "Enter") && e.target.closest("a,button,summary,[type=checkbox]")) return;
      // keys that scroll a page do so where nothing of the picture has the focus
      if (/^(Arrow|Page| )/.test(e.key) && document.scrollingElement.scrollHeight > innerHeight && !e.target.closest("#centre,#listing")) return;
      if (/^(Arrow|Page|Home|End)/.test(e.key) && e.target.closest("[type=range]")) return;
      const key = e.shiftKey && e.key.startsWith("Arrow") ? `Shift ${e.key}` : e.key,
        entry = this.table.find(([keys]) => keys.includes(key));
      if (!entry) return;
      e.preventDefault();
      entry[2]();
    }

    wire() {
      const {app} = this;
      $("view-iso").onclick = () => app.set_view("iso");
      $("view-six").onchange = e => {
        if (e.target.value) app.set_view(e.target.value);
        e.target.value = "";
      };
      $("fit").onclick = () => app.camera.fit();
      $("ortho").onclick = () => {
        app.camera.set_ortho(!app.camera.ortho);
        $("ortho").setAttribute("aria-pressed", app.camera.ortho);
      };
      $("help-open").onclick = () => $("help").showModal();
      $("worst").onclick = () => this.worst(1);
      $("find").onkeydown = e => {
        if (e.key === "Enter") this.find();
        if (e.key === "Escape") $("listing").focus();
      };
      $("find-next").onclick = () => this.find();
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

    // From the current picture half of the way to the next, and on.
    blend() {
      const {pictures} = this.app,
        last = pictures.list.length - 1;
      pictures.show(pictures.at >= last ? 0 : Math.min(last, Math.floor(pictures.at * 2 + 1e-9) / 2 + 0.5));
    }

    section() {
      const {display} = this.app,
        axes = ["", "X", "Y", "Z"];
      display.set_section({axis: axes[(axes.indexOf(display.section.axis) + 1) % axes.length], at: null});
    }

    enlarge(direction) {
      const {pictures} = this.app,
        now = pictures.exaggeration(),
        power = Math.floor(Math.log10(now) + 1e-9),
        steps = [1, 2, 5, 10, 20].map(m => m * 10 ** power),
        before = [0.5, ...steps.slice(0, 3)].map(m => (m < 1 ? 0.5 * 10 ** power : m));
      pictures.set_exaggeration(
        direction > 0 ? steps.find(m => m > now * 1.001) : (before.findLast(m => m < now * 0.999) ?? 1),
      );
    }

    help() {
      const arrows = {ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓"},
        names = {" ": "space", Escape: "esc", ...arrows};
      for (const [key, sign] of Object.entries(arrows)) names[`Shift ${key}`] = `shift ${sign}`;
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
  }

  OLP.Keys = Keys;
})();
