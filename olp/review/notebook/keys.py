"""Key frames of a motion: the few times between which it is straight enough."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index

#: Most key frames of one thing that moves; each takes 30 to 50 bytes.
MOST = 20_000


def key_frames(time_s: Array, value: Array, tolerance: float, most: int = MOST) -> Index:
    """The samples to keep of (n,) times in order and (n, c) values: between them straight lines in time are
    within `tolerance` of every sample. At most `most` are kept, the worst first, from coarse to fine."""
    keep = np.zeros(len(time_s), bool)
    keep[[0, -1]] = True
    while True:
        kept = np.flatnonzero(keep)
        off = _distance(time_s, value, kept)
        worst = np.maximum.reduceat(off, kept)
        interval = np.cumsum(keep) - 1
        far = np.flatnonzero((off > tolerance) & (off == worst[interval]))
        new = far[np.unique(interval[far], return_index=True)[1]]
        if not len(new) or len(kept) >= most:
            return kept
        keep[new[np.argsort(-off[new], kind="stable")][: most - len(kept)]] = True


def _distance(time_s: Array, value: Array, kept: Index) -> Array:
    """(n,) from each sample to the straight line in time between the kept ones beside it."""
    after = np.clip(np.searchsorted(kept, np.arange(len(time_s)), side="right"), 1, len(kept) - 1)
    a, b = kept[after - 1], kept[after]
    span = time_s[b] - time_s[a]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(span > 0.0, (time_s - time_s[a]) / span, 0.0)
    line = value[a] + share[:, None] * (value[b] - value[a])
    off = np.sqrt(((value - line) ** 2).sum(axis=1))
    off[kept] = 0.0
    return np.asarray(off)
