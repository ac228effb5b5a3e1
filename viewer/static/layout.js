"use strict";
// Panels as tabs, the width of the program, plots that fold, the theme.
(() => {
  const $ = id => document.getElementById(id),
    TABS = ["parts", "program", "display", "findings"],
    WIDE = matchMedia("(min-width: 1200px)");

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

    grip() {
      const grip = $("grip");
      grip.onpointerdown = e => {
        grip.setPointerCapture(e.pointerId);
        e.preventDefault();
      };
      grip.onpointermove = e => {
        if (!grip.hasPointerCapture(e.pointerId)) return;
        const width = Math.min(innerWidth * 0.6, Math.max(240, innerWidth - e.clientX));
        document.documentElement.style.setProperty("--right", `${Math.round(width)}px`);
      };
    }
  }

  OLP.Layout = Layout;
})();
