"use strict";
// A live page asks its own server, and no other, whether the inputs have changed.
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
        app.toast("The server does not answer; this is its last page", 0, "lost");
      }
      setTimeout(ask, EVERY_MS);
    };
    setTimeout(ask, EVERY_MS);
  };
})();
