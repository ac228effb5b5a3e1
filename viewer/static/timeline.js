"use strict";
// Play, scrub, rate and steps on the re-timed time.
(() => {
  const $ = id => document.getElementById(id);
  const LONGEST_FRAME = 0.25; // s: a page that was asleep does not jump

  function clock(s) {
    const minutes = Math.floor(s / 60),
      hours = Math.floor(minutes / 60),
      seconds = (s - 60 * minutes).toFixed(3).padStart(6, "0");
    return hours ? `${hours}:${String(minutes % 60).padStart(2, "0")}:${seconds}` : `${minutes}:${seconds}`;
  }

  class Timeline {
    constructor(app) {
      this.app = app;
      this.bar = $("time");
      Object.assign(this.bar, {min: app.time[0], max: app.end});
      this.bar.oninput = () => app.set_time(+this.bar.value);
      const by_feed = app.manifest.time_source === "feed";
      this.source = by_feed ? " by feed" : "";
      $("time-value").title = by_feed ? "At the programmed feed: the motion is not planned" : "As planned";
      $("play").onclick = () => this.play(!app.state.playing);
      $("step-back").onclick = () => app.step(-1);
      $("step-forward").onclick = () => app.step(1);
      $("trail").onchange = e => app.set_trail(e.target.checked);
      OLP.on("time", () => this.show());
    }

    play(on) {
      const {app} = this;
      app.state.playing = on;
      $("play").textContent = on ? "❚❚" : "▶";
      $("play").setAttribute("aria-label", on ? "Pause" : "Play");
      if (!on) return;
      if (app.state.time >= app.end) app.set_time(app.time[0]);
      this.last = performance.now();
      requestAnimationFrame(now => this.tick(now));
    }

    tick(now) {
      const {app} = this;
      if (!app.state.playing) return;
      const passed = Math.min(LONGEST_FRAME, Math.max(0, (now - this.last) / 1000));
      this.last = now;
      app.set_time(app.state.time + passed * +$("rate").value);
      if (app.state.time >= app.end) this.play(false);
      else requestAnimationFrame(next => this.tick(next));
    }

    show() {
      const {state, end} = this.app;
      this.bar.value = state.time;
      this.bar.style.setProperty(
        "--done",
        `${(100 * (state.time - this.app.time[0])) / Math.max(1e-9, end - this.app.time[0])}%`,
      );
      $("time-value").textContent = `${clock(state.time)} / ${clock(end)}${this.source}`;
    }
  }

  OLP.Timeline = Timeline;
})();
