"use strict";
// A live page asks its own server, and nothing else, whether the inputs have changed.
(() => {
  const EVERY_MS = 1000;

  OLP.watch = app => {
    const {live, digest} = app.manifest;
    if (!live) return;
    const ask = async () => {
      try {
        const answer = (await (await fetch(live, {cache: "no-store"})).text()).trim();
        if (answer && answer !== digest) {
          history.replaceState(null, "", app.notes.hash());
          location.reload();
          return;
        }
        app.toast(null, 0, "lost");
      } catch {
        app.toast("The server is gone; this is its last answer", 0, "lost");
      }
      setTimeout(ask, EVERY_MS);
    };
    setTimeout(ask, EVERY_MS);
  };
})();
