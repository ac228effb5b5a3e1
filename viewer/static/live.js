"use strict";
// A live page asks its own server, and no other, whether the inputs have changed.
(() => {
  const EVERY_MS = 1000;

  OLP.watch = app => {
    const {live, digest} = app.manifest;
    if (!live) return;
    app.manifest.live = null; // a saved page has no server
    const ask = async () => {
      try {
        const answer = await fetch(live.address, {cache: "no-store", credentials: "omit", redirect: "error"}),
          [proof, newest] = (await answer.text()).split(" ");
        // whoever has taken the port of a server that has ended does not know the proof
        if (proof !== live.proof) throw new Error("another server");
        if (newest !== digest) {
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
