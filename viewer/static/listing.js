"use strict";
// Program text, nominal beside corrected, with the line numbers of the files. Only visible rows exist, and the scroll is
// scaled where a million rows would be higher than a browser can lay out. Text enters by textContent alone.
(() => {
  const LINE = 19,
    TALLEST = 8e6, // px
    WIDEST = 16, // characters of a line's name
    LOOKED = 4000, // lines whose length decides on the layout
    USUAL = 0.9, // of them are to fit
    MORE = " …",
    ERROR = [104, 156]; // px for the deviations of two and of three pictures

  class Listing {
    constructor(app) {
      const {listing} = app.manifest,
        get = name => (name == null ? null : app.arrays.get(name));
      this.app = app;
      this.texts = [get(listing.nominal), get(listing.corrected)];
      this.numbers = [get(listing.row_nominal), get(listing.row_corrected)];
      this.names = get(listing.names); // of the nominal lines, where they were unrolled from others
      this.errors = [listing.uncorrected_um, listing.corrected_um, listing.measured_um].map(get); // below 0: not known
      this.state = get(listing.state); // of each row: 0 within, 1 above, 2 shown and not judged, 3 no move
      this.n = this.numbers[0].length;
      this.box = document.getElementById("listing");
      this.inner = document.getElementById("listing-inner");
      this.host = document.getElementById("listing-rows");
      this.top = 0; // first visible row, may be a part
      this.rows = [];
      this.current = this.selected = -1;
      const longest = String(Math.max(this.texts[0].n, this.texts[1]?.n ?? 0)).length,
        digits = Math.max(longest, Math.min(listing.names_width ?? 0, WIDEST));
      this.panel = document.getElementById("panel-program");
      this.panel.style.setProperty("--number", `${12 + 7 * Math.max(3, digits)}px`);
      this.panel.style.setProperty("--error", `${ERROR[this.errors[2] ? 1 : 0]}px`);
      const ruler = this.box.appendChild(Object.assign(document.createElement("span"), {textContent: "0".repeat(50)}));
      this.ruler = ruler;
      ruler.style.cssText = "position:absolute;visibility:hidden";
      this.usual = this.usual_length();
      this.lay_out();
      this.listen();
      new ResizeObserver(() => this.lay_out()).observe(this.box);
      OLP.on("filter", () => this.paint());
    }

    // Length of line that most lines do not exceed.
    usual_length() {
      const step = Math.max(1, Math.floor(this.n / LOOKED)),
        lengths = [];
      for (let row = 0; row < this.n; row += step) lengths.push(Math.max(this.text(row, 0).length, this.text(row, 1).length));
      return lengths.sort((p, q) => p - q)[Math.floor(USUAL * (lengths.length - 1))] ?? 0;
    }

    // Both texts side by side where usual lines fit, else one above the other.
    lay_out() {
      const digit = this.ruler.getBoundingClientRect().width / 50;
      if (!digit || !this.box.clientWidth) return;
      const number = parseFloat(getComputedStyle(this.panel).getPropertyValue("--number")),
        error = ERROR[this.errors[2] ? 1 : 0],
        wide = this.box.clientWidth - error - 10;
      const beside = Math.floor((wide - 2 * number) / 2 / digit) - 2,
        one = Math.floor((wide - number) / digit) - 2;
      this.layout = !this.texts[1] ? "single" : this.usual <= beside ? "beside" : "stacked";
      this.characters = Math.max(8, this.layout === "beside" ? beside : one);
      this.more = this.layout === "stacked" ? Math.floor(error / digit) : 0; // the lower line has the whole width
      this.row_height = this.layout === "stacked" ? 2 * LINE + 1 : LINE;
      this.height = Math.min(this.n * this.row_height, TALLEST);
      this.inner.style.height = this.height + "px";
      for (const name of ["single", "stacked"]) this.box.classList.toggle(name, this.layout === name);
      this.heading();
      this.repaint();
    }

    // A text that fits: whole words, and a mark where there is more.
    fit(text, characters) {
      if (text.length <= characters) return text;
      const cut = text.slice(0, characters - 1),
        end = cut.search(/[\s,]+[^\s,]*$/);
      return (end > characters / 3 ? cut.slice(0, end) : cut) + MORE;
    }

    get scaled() {
      return this.n * this.row_height > TALLEST;
    }
    get room() {
      return this.box.clientHeight / this.row_height;
    }
    get highest() {
      return Math.max(0, this.n - this.room);
    }

    heading() {
      const head = document.getElementById("listing-head"),
        two = Boolean(this.texts[1]);
      for (const name of ["single", "stacked"]) head.classList.toggle(name, this.layout === name);
      const {program, corrected} = this.app.manifest;
      const titles =
        this.layout === "stacked"
          ? [`${program}, below it ${corrected || "the corrected program"}`, "µm"]
          : two
            ? ["line", program, "line", corrected || "corrected", "µm"]
            : ["line", program, "µm"];
      head.replaceChildren(
        ...titles.map(text => Object.assign(document.createElement("span"), {textContent: text, title: text})),
      );
      const shown = ["uncorrected", "corrected", "measured"].filter((_, k) => this.errors[k]);
      head.lastChild.title = `Largest deviation of the line, ${shown.join(" → ")}`;
    }

    // Line of the file at a row: side 0 nominal, 1 corrected; "" where that side has none.
    text(row, side) {
      const line = this.numbers[side]?.[row] ?? 0;
      return line > 0 && this.texts[side] ? this.texts[side].line(line - 1) : "";
    }

    // What a row's line is called: its number, or the line that it was unrolled from.
    number(row, side) {
      const line = this.numbers[side]?.[row] || "";
      return line && side === 0 && this.names ? this.names.line(line - 1) : line;
    }

    error(row) {
      const values = this.errors.filter(Boolean).map(e => (e[row] >= 0 ? e[row] : NaN));
      return values.every(Number.isNaN) ? "" : values.map(OLP.colour.um).join(" → ");
    }

    make_row() {
      const row = document.createElement("div");
      row.className = "row";
      row.setAttribute("role", "option");
      row.cells = ["number", "code", "number", "code", "error"].map(name =>
        row.appendChild(Object.assign(document.createElement("span"), {className: name})),
      );
      if (!this.texts[1]) row.cells[2].hidden = row.cells[3].hidden = true;
      this.host.append(row);
      return row;
    }

    paint() {
      if (!this.row_height) return;
      const first = Math.max(0, Math.floor(this.top)),
        count = Math.min(this.n - first, Math.ceil(this.room) + 1);
      while (this.rows.length < count) this.rows.push(this.make_row());
      this.rows.forEach((row, i) => {
        row.hidden = i >= count;
        if (row.hidden) return;
        const k = first + i,
          [a, b, c, d, e] = row.cells;
        row.style.transform = `translateY(${(k - this.top) * this.row_height}px)`;
        row.style.height = this.row_height + "px";
        if (row.k !== k) {
          row.k = k;
          row.dataset.row = k;
          row.id = `row-${k}`;
          const nominal = this.text(k, 0),
            corrected = this.texts[1] ? this.text(k, 1) : "";
          a.textContent = this.number(k, 0);
          b.textContent = this.fit(nominal, this.characters);
          if (this.texts[1]) {
            c.textContent = this.number(k, 1);
            this.show_change(d, nominal, corrected);
          }
          e.textContent = this.error(k);
          e.classList.toggle("over", this.state?.[k] === 1);
          e.title = ["within", "above", "shown, not judged", ""][this.state?.[k] ?? 3];
          row.classList.toggle("inserted", !this.number(k, 0));
        }
        row.classList.toggle("selected", k === this.selected);
        row.classList.toggle("current", k === this.current);
        row.classList.toggle("kept", this.app.filter?.rows?.[k] === 1);
        row.setAttribute("aria-selected", k === this.selected);
      });
      if (this.selected >= first && this.selected < first + count) this.box.setAttribute("aria-activedescendant", `row-${this.selected}`);
      else this.box.removeAttribute("aria-activedescendant");
    }

    repaint() {
      for (const row of this.rows) row.k = -1;
      this.paint();
    }

    // The corrected line with its differences from the nominal one marked.
    show_change(cell, nominal, corrected) {
      const text = this.fit(corrected, this.characters + this.more);
      cell.textContent = "";
      cell.classList.toggle("same", nominal === corrected);
      if (nominal === corrected || !nominal) {
        cell.textContent = text;
        return;
      }
      const whole = text !== corrected ? text.slice(0, -MORE.length) : text;
      for (const [part, changed] of OLP.difference(nominal, whole))
        cell.append(changed ? Object.assign(document.createElement("b"), {textContent: part}) : part);
      cell.append(text.slice(whole.length));
    }

    scroll_to(top) {
      this.top = Math.max(0, Math.min(this.highest, top));
      const span = this.height - this.box.clientHeight;
      this.scrolled = this.scaled ? (this.top / Math.max(1e-9, this.highest)) * span : this.top * this.row_height;
      this.box.scrollTop = this.scrolled;
      this.scrolled = this.box.scrollTop;
      this.paint();
    }

    // Makes a row visible.
    show(row) {
      if (!this.row_height) return;
      if (row < this.top + 1 || row > this.top + this.room - 2) this.scroll_to(row - this.room / 2 + 0.5);
      else this.paint();
    }

    listen() {
      this.box.addEventListener("scroll", () => {
        if (this.box.scrollTop === this.scrolled) return;
        const span = this.height - this.box.clientHeight;
        this.top = this.scaled ? (this.box.scrollTop / Math.max(1, span)) * this.highest : this.box.scrollTop / this.row_height;
        this.paint();
      });
      this.box.addEventListener(
        "wheel",
        e => {
          if (!this.scaled) return; // a scaled scroll would skip thousands of rows
          e.preventDefault();
          this.scroll_to(this.top + e.deltaY / this.row_height);
        },
        {passive: false},
      );
      this.host.addEventListener("click", e => {
        const row = e.target.closest(".row");
        if (row) this.app.select_row(+row.dataset.row);
      });
      this.box.addEventListener("keydown", e => {
        const step = {
          ArrowDown: 1,
          ArrowUp: -1,
          PageDown: Math.floor(this.room),
          PageUp: -Math.floor(this.room),
          Home: -this.n,
          End: this.n,
        }[e.key];
        if (!step) return;
        e.preventDefault();
        e.stopPropagation();
        this.app.select_row(Math.max(0, Math.min(this.n - 1, Math.max(0, this.selected) + step)));
      });
    }

    // First row of a nominal line by its name, or -1.
    row_named(name) {
      for (let row = 0; row < this.n; row++) if (this.number(row, 0) === name) return row;
      return -1;
    }

    // Row of a 1-based line of the nominal (0) or corrected (1) file, or -1.
    row_of_line(line, side = 0) {
      if (side === 0 && this.names) return this.row_named(String(line));
      return line > 0 && this.numbers[side] ? this.numbers[side].indexOf(line) : -1;
    }

    // Next row after `from` with the text on either side, in a circle; -1 where there is none.
    search(text, from) {
      const wanted = text.toLowerCase();
      for (let step = 1; step <= this.n; step++) {
        const row = (from + step + this.n) % this.n;
        if (
          this.text(row, 0).toLowerCase().includes(wanted) ||
          (this.texts[1] && this.text(row, 1).toLowerCase().includes(wanted))
        )
          return row;
      }
      return -1;
    }
  }

  OLP.Listing = Listing;
})();
