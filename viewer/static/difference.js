"use strict";
// Where two texts of a line differ: the longest common sequence of their words and numbers.
(() => {
  const TOKEN = /[A-Za-z_]+|[-+]?(?:\d+\.?\d*|\.\d+)|\s+|./gu,
    MOST = 400; // tokens of a line that are compared

  // The parts of `text` as [part, whether it is not in `old`], neighbours of one kind joined.
  OLP.difference = (old, text) => {
    const a = (old.match(TOKEN) ?? []).slice(0, MOST),
      b = text.match(TOKEN) ?? [],
      n = Math.min(b.length, MOST),
      wide = n + 1,
      common = new Uint16Array((a.length + 1) * wide);
    for (let i = a.length - 1; i >= 0; i--)
      for (let j = n - 1; j >= 0; j--)
        common[i * wide + j] =
          a[i] === b[j] ? common[(i + 1) * wide + j + 1] + 1 : Math.max(common[(i + 1) * wide + j], common[i * wide + j + 1]);
    const parts = [];
    const put = (part, changed) => {
      if (parts.length && parts.at(-1)[1] === changed) parts.at(-1)[0] += part;
      else parts.push([part, changed]);
    };
    let i = 0;
    b.forEach((part, j) => {
      if (j >= n) return put(part, false);
      while (i < a.length && a[i] !== part && common[(i + 1) * wide + j] >= common[i * wide + j + 1]) i++;
      const same = i < a.length && a[i] === part;
      if (same) i++;
      put(part, !same && part.trim() !== "");
    });
    return parts;
  };
})();
