"""What few targets cost: how far curves may be off between targets, beside at them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.calibration.estimator.curves import sigma_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.observations.base import rms, unit_of
from olp.calibration.observations.lines import SAME_MM, targets_of
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS
from olp.findings.catalogue import Finding

#: Targets are far apart where the uncertainty between them is so many times that at them.
_TIMES = 3.0
#: um or urad; less between targets is not told.
_LEAST = 1.0
#: Curves that the finding lists, at most.
_LISTED = 8


def targets_apart(fit: Fit) -> Iterator[Finding]:
    """One finding on the curves that more targets would tell far better than more runs."""
    costs = []
    for name in COMPONENTS:
        q = _targets(fit, name)
        if len(q) < 2:
            continue
        unit, scale = unit_of(name)
        between = rms(sigma_of(fit, name, 0.5 * (q[1:] + q[:-1]))) * scale
        # ripple right beside a target is not at it
        at = rms(np.sqrt(np.maximum(sigma_of(fit, name, q) ** 2 - fit.between_targets(name, q), 0.0))) * scale
        if between > max(_TIMES * at, _LEAST):
            apart = f"{len(q)} targets up to {np.diff(q).max():.0f} mm apart"
            costs.append((between, f"{name} {between:.2g} {unit} between {apart}, {at:.2g} {unit} at them"))
    if costs:
        ordered = [words for _, words in sorted(costs, reverse=True)]
        more = f" and {len(ordered) - _LISTED} more" if len(ordered) > _LISTED else ""
        yield Finding("OLP813", "; ".join(ordered[:_LISTED]) + more)


def _targets(fit: Fit, name: str) -> Array:
    """The targets of all lines of a component, ascending, each once."""
    own = [targets_of(line) for line in fit.measurements.lines if line.component == name]
    q = np.sort(np.concatenate([np.zeros(0), *own]))
    return np.asarray(q[np.diff(q, prepend=-np.inf) > SAME_MM])
