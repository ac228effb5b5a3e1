"use strict";
// The page as it was sent, so that "Save" can write it again: no script has changed the document yet. A saved page
// has no server, and may ask none.
globalThis.OLP = (() => {
  const head = document.head.cloneNode(true),
    policy = head.querySelector("[http-equiv=Content-Security-Policy]");
  policy.content = policy.content.replace("connect-src 'self'", "connect-src 'none'");
  return {shell: {head: head.outerHTML, body: document.body.innerHTML}};
})();
