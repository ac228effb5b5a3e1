"""Which postures of a machine of any joints to measure: those that lower what is not known of its tip most.

Readings are points of a tracker whose place is not known. Postures are chosen one after the other, by what
those before it leave (Fedorov, Theory of Optimal Experiments, 1972). A lowers the mean variance of the tip
over all candidates, D the volume of the uncertainty of all unknowns.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from olp.calibration.joints.unknowns import Model
from olp.core.arrays import Array, Index
from olp.core.machine import Vector
from olp.core.values import dataclass

Criterion = Literal["A", "D"]
#: The tracker stands anywhere: standard deviations of its place in mm, and of its turn in mm at the reach.
_ANYWHERE_MM = 1e4
#: The least reach in mm.
_REACH_MM = 1.0
#: Singular values below this share of the largest are nothing.
_SHORT = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """n postures. `table` (n, 3, k + 6) is mm of the tip by each unknown, and by six of the place of the
    tracker; `prior` is their covariance. `worth` (k + 6, k + 6) weighs a covariance to the mean variance of
    the tip over all of them, in the best frame."""

    table: Array
    worth: Array
    prior: Array

    @staticmethod
    def of(model: Model, values: Array, tool_mm: Vector) -> Candidates:
        """Those at axis values (n, axes), with a reflector at `tool_mm` of the gauge frame."""
        theta = np.zeros(len(model.unknowns))
        twists = model.twists(theta, values)
        pose = model.machine(theta).nominal(values)
        arm = pose.at(np.array(tool_mm)) - pose.position
        tip = twists[:, :3] + np.cross(twists[:, 3:], arm[:, :, None], axis=1)
        place = pose.at(np.array(tool_mm))
        place = place - place.mean(axis=0)
        reach = max(float(np.linalg.norm(place, axis=1).max()), _REACH_MM)
        frame = np.zeros((len(values), 3, 6))
        frame[:, :, :3] = np.eye(3)
        for k in range(3):
            frame[:, :, 3 + k] = np.cross(np.eye(3)[k], place) / reach
        flat = tip.reshape(-1, tip.shape[2])
        rest = flat - frame.reshape(-1, 6) @ np.linalg.lstsq(frame.reshape(-1, 6), flat, rcond=_SHORT)[0]
        worth = np.zeros((flat.shape[1] + 6,) * 2)
        worth[:-6, :-6] = rest.T @ rest / len(values)
        prior = np.diag(np.append(model.prior**2, np.full(6, _ANYWHERE_MM**2)))
        return Candidates(np.concatenate((tip, frame), axis=2), worth, prior)

    def chosen(self, count: int, sigma_mm: float, criterion: Criterion) -> Index:
        """(count,) the candidates to read, in order; one may come again."""
        covariance, picked = self.prior, []
        for _ in range(count):
            spread = self.table @ covariance
            noise = spread @ self.table.transpose(0, 2, 1) + sigma_mm**2 * np.eye(3)
            if criterion == "D":
                gain = np.linalg.slogdet(noise)[1]
            else:
                gain = np.trace(np.linalg.solve(noise, spread @ self.worth @ spread.transpose(0, 2, 1)),
                                axis1=1, axis2=2)  # fmt: skip
            best = int(np.argmax(gain))
            picked.append(best)
            covariance = covariance - spread[best].T @ np.linalg.solve(noise[best], spread[best])
        return np.array(picked, np.int64)

    def tip_mm(self, rows: Index, sigma_mm: float) -> float:
        """mm: what is not known of the tip (rms over all candidates) once some of them are read."""
        some = self.table[rows].reshape(-1, self.table.shape[2])
        normal = np.linalg.inv(self.prior) + some.T @ some / sigma_mm**2
        return float(np.sqrt(max(np.trace(np.linalg.solve(normal, self.worth)), 0.0)))
