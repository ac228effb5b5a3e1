"""Best-fit rigid transforms: of points onto points, and of points onto a path."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.values import dataclass

#: A motion that moves the points across their path by less than this share of it is not determined: noise
#: would be amplified a hundredfold.
_LOOSE = 1e-2
#: Points that are narrower than this share of their length are on a line.
_NARROW = 1e-3
#: The six motions, in the order of the columns of the fit.
_DOF = ("shift in X", "shift in Y", "shift in Z", "turn about X", "turn about Y", "turn about Z")


@dataclass(frozen=True, slots=True, eq=False)
class Rigid:
    """point -> `rotation` (3, 3) @ point + `shift_mm` (3,)."""

    rotation: Array
    shift_mm: Array

    @staticmethod
    def identity() -> Rigid:
        return Rigid(np.eye(3), np.zeros(3))

    def __call__(self, points_mm: Array) -> Array:
        """(n, 3) points moved."""
        return np.asarray(points_mm @ self.rotation.T + self.shift_mm, float)

    def after(self, first: Rigid) -> Rigid:
        """This transform behind `first`."""
        return Rigid(self.rotation @ first.rotation, self.rotation @ first.shift_mm + self.shift_mm)

    def inverse(self) -> Rigid:
        return Rigid(self.rotation.T, -self.rotation.T @ self.shift_mm)

    @property
    def angle_rad(self) -> float:
        """Size of the rotation."""
        skew = self.rotation - self.rotation.T
        sine = 0.5 * float(np.linalg.norm((skew[2, 1], skew[0, 2], skew[1, 0])))
        return float(np.arctan2(sine, (np.trace(self.rotation) - 1.0) / 2.0))

    @property
    def angles_deg(self) -> tuple[float, float, float]:
        """A, B, C about X, Y, Z in degrees with rotation = Rz(C) Ry(B) Rx(A), B from -90 to 90."""
        r = self.rotation
        b = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
        if np.hypot(r[0, 0], r[1, 0]) < 1e-12:
            a, c = np.arctan2(-r[1, 2], r[1, 1]), 0.0
        else:
            a, c = np.arctan2(r[2, 1], r[2, 2]), np.arctan2(r[1, 0], r[0, 0])
        return float(np.degrees(a)), float(np.degrees(b)), float(np.degrees(c))


def rotation_of(vector_rad: Array) -> Array:
    """(3, 3) rotation by |vector| about it (Rodrigues)."""
    angle = float(np.linalg.norm(vector_rad))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector_rad) / angle
    k = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k), float)


def fit_points(measured_mm: Array, nominal_mm: Array) -> Rigid:
    """The transform that brings measured points (n, 3) onto nominal ones with the least sum of squares.

    By singular values (Arun, Huang, Blostein 1987), never a reflection.
    """
    a, b = measured_mm.mean(axis=0), nominal_mm.mean(axis=0)
    u, _, v = np.linalg.svd((measured_mm - a).T @ (nominal_mm - b))
    turn = np.diag((1.0, 1.0, np.sign(np.linalg.det(v.T @ u.T))))
    rotation = v.T @ turn @ u.T
    return Rigid(rotation, b - rotation @ a)


def line_of_points(points_mm: Array) -> Array | None:
    """(3,) the direction of the line that all points (n, 3) are on, None where they are on none."""
    _, spread, ways = np.linalg.svd(points_mm - points_mm.mean(axis=0), full_matrices=False)
    return np.asarray(ways[0]) if len(points_mm) < 3 or spread[1] <= _NARROW * spread[0] else None


def fit_frame(measured_mm: Array, nominal_mm: Array) -> Rigid:
    """As `fit_points`; raises CannotCompute for fewer than three points, or where they lie on one line."""
    if len(measured_mm) < 3:
        raise CannotCompute(f"a frame of {len(measured_mm)} points; expected at least three; measure more")
    if line_of_points(nominal_mm) is not None:
        raise CannotCompute("the points of a frame lie on one line; measure at least one point off that line")
    return fit_points(measured_mm, nominal_mm)


def fit_path(measured_mm: Array, foot_mm: Array, along: Array) -> tuple[Rigid, tuple[str, ...]]:
    """One Gauss-Newton step of the transform that brings measured points (m, 3) onto their path.

    Only distances across the path count: `foot_mm` (m, 3) are the nearest points of it, `along` (m, 3) its
    unit tangents there. Also returns the motions that the path does not determine, such as the shift along a
    straight line; they are zero.
    """
    centre = measured_mm.mean(axis=0)
    arm = measured_mm - centre
    size = max(float(np.sqrt((arm * arm).sum(axis=1).mean())), 1e-9)
    away = foot_mm - measured_mm
    away -= np.einsum("ij,ij->i", away, along)[:, None] * along
    # columns: d(point)/d(shift, turn); the part along the path is of no interest
    jacobian = np.zeros((len(arm), 3, 6))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = jacobian[:, 2, 2] = 1.0
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        # turn about axis k moves axis i by -arm_j and axis j by +arm_i
        jacobian[:, i, 3 + k] = -arm[:, j] / size
        jacobian[:, j, 3 + k] = arm[:, i] / size
    jacobian -= np.einsum("ni,nj,njk->nik", along, along, jacobian)
    flat = jacobian.reshape(-1, 6)
    values, vectors = np.linalg.eigh(flat.T @ flat)
    firm = values > _LOOSE**2 * values[-1]
    step = vectors[:, firm] @ ((vectors[:, firm].T @ (flat.T @ away.reshape(-1))) / values[firm])
    loose = tuple(_DOF[int(np.argmax(np.abs(vectors[:, i])))] for i in np.flatnonzero(~firm))
    rotation = rotation_of(step[3:] / size)
    return Rigid(rotation, centre + step[:3] - rotation @ centre), loose
