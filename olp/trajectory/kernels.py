"""Sums of overlapping cubic kernels over sorted breaks, without cancellation.

Prefix sums would spread the rounding of the narrowest kernel (third derivative du/w^2) over the whole path.
Each half of a kernel is one cubic over a range of pieces. It is added to the O(log) nodes of a binary tree
that make up this range, as its Taylor polynomial at the start of the node. The sums then go down the tree to
the pieces. So a piece adds only the kernels that reach it.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index


def deviations(
    x: Array, centre: Array, width: Array, bend: Array, begin: Index, middle: Index, end: Index
) -> Array:
    """(k, 4, axes) sum of kernels and its first three derivatives at the start of each piece, valid over it.

    `x` (k + 1,) rising breaks; kernel i is bend_i w g((x - centre_i) / w), g(z) = (1 - |z|)^3 / 6. Its first
    half covers the pieces begin..middle, the second middle..end (half open, cut to the breaks given).
    """
    k = len(x) - 1
    depth = max(k - 1, 0).bit_length()
    size = 1 << depth
    start = np.concatenate((x[:-1], np.full(size - k, x[-1])))
    axes = bend.shape[1]
    tree = np.zeros((4 * axes, 2 * size))
    top = depth
    for lo, hi, edge, sign in (
        (begin, middle, centre - width, 1.0),
        (middle, end, centre + width, -1.0),
    ):
        top = min(top, _lay(tree, size, start, lo, hi, edge, sign, 1.0 / (width * width), bend))
    for level in range(top, depth):
        base = 1 << level
        parent = tree[:, base : 2 * base].reshape(4, axes, base)
        first_child = tree[:, 2 * base : 4 * base : 2].reshape(4, axes, base)
        second_child = tree[:, 2 * base + 1 : 4 * base : 2].reshape(4, axes, base)
        span = size >> (level + 1)
        d = start[span :: 2 * span] - start[:: 2 * span]
        f, f1, f2, f3 = parent
        tree[:, 2 * base : 4 * base : 2] = (first_child + parent).reshape(4 * axes, base)
        shifted = np.stack(
            (f + d * (f1 + d * (f2 / 2.0 + d * (f3 / 6.0))), f1 + d * (f2 + d * (f3 / 2.0)), f2 + d * f3, f3)
        )
        tree[:, 2 * base + 1 : 4 * base : 2] = (second_child + shifted).reshape(4 * axes, base)
    return np.ascontiguousarray(tree[:, size : size + k].T).reshape(k, 4, axes)


def _lay(
    tree: Array, size: int, start: Array, begin: Index, end: Index, edge: Array, sign: float, third: Array,
    bend: Array,
) -> int:  # fmt: skip
    """Add sign * bend * third * (x - edge)^3 / 6 to the nodes of begin..end; the highest level used."""
    lo, hi = begin + size, end + size
    shift = 0
    level = size.bit_length() - 1
    top = level
    kernel = np.flatnonzero(lo < hi)
    lo, hi = lo[kernel], hi[kernel]
    while kernel.size:
        base = size >> shift
        odd_low, odd_high = (lo & 1).astype(bool), (hi & 1).astype(bool)
        node = np.concatenate((lo[odd_low], hi[odd_high] - 1))
        if node.size:
            top = level - shift
            i = np.concatenate((kernel[odd_low], kernel[odd_high]))
            y = start[(node << shift) - size] - edge[i]
            f3 = sign * third[i]
            f2 = f3 * y
            f1 = f2 * y / 2.0
            spot = node - base
            for order, f in enumerate((f1 * y / 3.0, f1, f2, f3)):
                for axis in range(bend.shape[1]):
                    tree[bend.shape[1] * order + axis, base : 2 * base] += np.bincount(
                        spot, weights=f * bend[i, axis], minlength=base
                    )
        lo, hi = (lo + 1) >> 1, hi >> 1
        shift += 1
        on = lo < hi
        kernel, lo, hi = kernel[on], lo[on], hi[on]
    return top


def least_over(value: Array, begin: Index, end: Index) -> Array:
    """(m,) least of `value` (k,) over each range begin..end (half open), inf over none: a sparse table."""
    result = np.full(len(begin), np.inf)
    length = end - begin
    table = value
    span = 1
    while (length >= span).any():
        here = np.flatnonzero((length >= span) & (length < 2 * span))
        result[here] = np.minimum(table[begin[here]], table[end[here] - span])
        if span >= len(value):
            break
        table = np.minimum(table[:-span], table[span:]) if len(table) > span else table[:1]
        span *= 2
    return result
