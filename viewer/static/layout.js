"use strict";
// Panels as tabs, the width of the program, plots that fold, the theme.
(() => {
  const $ = id => document.getElementById(id),
    TABS = ["parts", "program", "display", "findings"],
    WIDE = matchMedia("(min-width: 1200px)"),
    NARROWEST = 240, // px of the program
    STEP = 16, // px of a key
    widest = () => 0.6 * innerWidth;

  class Layout {
    constructor(app) {
      this.app = app;
      for (const name of TABS) {
        const tab = $("tab-" + name);
        tab.onclick = () => this.open(name);
        tab.onkeydown = e => {
          const step = {ArrowRight: 1, ArrowLeft: -1}[e.key];
          if (!step) return;
          e.preventDefault();
          e.stopPropagation();
          const shown = TABS.filter(n => n !== "program" || !WIDE.matches),
            to = shown[(shown.indexOf(this.tab) + step + shown.length) % shown.length];
          this.open(to);
          $("tab-" + to).focus();
        };
      }
      WIDE.addEventListener("change", () => this.open(this.tab));
      $("toggle-plots").onclick = () => this.plots(document.body.classList.contains("no-plots"));
      $("theme").onclick = () => app.set_theme(app.state.theme === "dark" ? "light" : "dark");
      this.grip();
      this.open(app.manifest.tree?.nodes.length ? "parts" : "display");
    }

    // Shows a panel; on a wide page the program is always there.
    open(name) {
      if (name === "program" && WIDE.matches) {
        $("listing").focus();
        name = this.tab === "program" ? "parts" : this.tab;
      }
      this.tab = TABS.includes(name) ? name : "parts";
      for (const one of TABS) {
        const on = one === this.tab;
        $("tab-" + one).setAttribute("aria-selected", on);
        $("tab-" + one).tabIndex = on ? 0 : -1;
        $("panel-" + one).hidden = !on && !(one === "program" && WIDE.matches);
      }
      this.app.listing?.paint();
    }

    plots(on) {
      document.body.classList.toggle("no-plots", !on);
      $("toggle-plots").setAttribute("aria-expanded", on);
      $("toggle-plots").textContent = on ? "▾" : "▴";
    }

    // The edge of the program: dragged, or moved by keys; its value is the width of the program in px.
    grip() {
      const grip = $("grip");
      grip.onpointerdown = e => {
        grip.setPointerCapture(e.pointerId);
        e.preventDefault();
        grip.focus();
      };
      grip.onpointermove = e => {
        if (grip.hasPointerCapture(e.pointerId)) this.widen(innerWidth - e.clientX);
      };
      grip.onkeydown = e => {
        if (e.ctrlKey || e.metaKey || e.altKey) return;
        const width = $("panel-program").offsetWidth,
          to = {ArrowLeft: width + STEP, ArrowRight: width - STEP, Home: NARROWEST, End: widest()}[e.key];
        if (to === undefined) return;
        e.preventDefault();
        e.stopPropagation();
        this.widen(to);
      };
      new ResizeObserver(() => this.say_width()).observe($("panel-program"));
    }

    widen(width) {
      const to = Math.round(Math.min(widest(), Math.max(NARROWEST, width)));
      document.documentElement.style.setProperty("--right", `${to}px`);
      this.say_width();
    }

    say_width() {
      for (const [name, value] of [["now", $("panel-program").offsetWidth], ["min", NARROWEST], ["max", Math.round(widest())]])
        $("grip").setAttribute(`aria-value${name}`, value);
    }
  }

  OLP.Layout = Layout;
})();
