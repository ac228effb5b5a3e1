"""The paper's test A: the tool point is held on one point while the machine takes several postures, and the
errors of the tool vectors follow.

P are axis positions, t is the tool vector in the frame of the head, and R the turn of the head (the identity
on a machine that cannot turn it). Every posture gives  P + e(P, R t) + R (t + dt) = s, the point. Unknown are
s and dt of each tool. Where the head never turns, a shift of s and of all tools together changes nothing:
then only the differences between tools are determined.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import Vector
from olp.core.units import AXES, UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding

#: Share of an unknown in the null space from which on it is not determined.
_SHARE = 1e-6
#: Singular values below this share of the largest count as zero.
_RANK = 1e-9
#: A residual of so many times the stated uncertainty is reported.
_TOO_MUCH = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """Rows of one test: axis positions (n, 3) with the tool point on the one point, and the name of the tool
    of each row. `vector_mm` (n, 3) is its nominal vector in the frame of the head, `turn` (n, 3, 3) the turn
    of the head. `sigma` is that of one coordinate of a reading in mm (0: not stated). Raises ConfigError."""

    axis_mm: Array
    tool: tuple[str, ...]
    vector_mm: Array
    turn: Array
    sigma: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        n = len(self.axis_mm)
        columns = (self.tool, self.vector_mm, self.turn)
        if n < 2 or self.axis_mm.shape != (n, 3) or any(len(c) != n for c in columns):
            raise ConfigError(f"{n} postures; expected at least 2", file=self.source)
        for name in self.tools:
            rows = [i for i, own in enumerate(self.tool) if own == name]
            if np.ptp(self.vector_mm[rows], axis=0).max() > 0.0:
                raise ConfigError(
                    f"tool {name} has two nominal vectors; expected one, in the frame of the head",
                    file=self.source,
                )

    @property
    def tools(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(self.tool))

    @property
    def tool_vector_mm(self) -> Array:
        """(n, 3) nominal tool vectors in the machine's frame."""
        return np.asarray(np.einsum("nij,nj->ni", self.turn, self.vector_mm))


@dataclass(frozen=True, slots=True, eq=False)
class PostureFit:
    """`point_mm` (3,), and by tool the error of its vector (3,) with standard uncertainty, in the frame of
    the head; a coordinate that is not determined is NaN. `before` and `residual` (n, 3) in mm: the deviation
    of each posture from the mean point, with the nominal tools, and with their errors removed."""

    postures: Postures
    point_mm: Array
    error_mm: Mapping[str, Array]
    sigma_mm: Mapping[str, Array]
    reference: str | None
    before: Array
    residual: Array
    noise: float
    dof: int

    @property
    def findings(self) -> Iterator[Finding]:
        for name, value in self.error_mm.items():
            missing = [axis for axis, v in zip(AXES, value, strict=True) if not np.isfinite(v)]
            if missing:
                yield Finding(
                    "OLP856",
                    f"tool {name}: error in {', '.join(missing)} of the head not determined; take postures "
                    "with the head turned about two axes, or name a reference tool",
                )
        if self.postures.sigma > 0.0 and self.dof > 0 and self.noise > _TOO_MUCH * self.postures.sigma:
            yield Finding(
                "OLP857",
                f"postures: residual {self.noise * UM_PER_MM:.2f} um rms, stated uncertainty "
                f"{self.postures.sigma * UM_PER_MM:.2f} um; the residual includes errors of the machine "
                "between the postures",
            )

    def as_dict(self) -> dict[str, Any]:
        def listed(values: Array) -> list[float | None]:
            return [float(v) * UM_PER_MM if np.isfinite(v) else None for v in values]

        return {
            "file": self.postures.source,
            "postures": len(self.postures.axis_mm),
            "point_mm": [float(v) if np.isfinite(v) else None for v in self.point_mm],
            "reference": self.reference,
            "before_rms_um": _rms(self.before) * UM_PER_MM,
            "before_max_um": float(np.linalg.norm(self.before, axis=1).max()) * UM_PER_MM,
            "after_rms_um": _rms(self.residual) * UM_PER_MM,
            "after_max_um": float(np.linalg.norm(self.residual, axis=1).max()) * UM_PER_MM,
            "noise_um": self.noise * UM_PER_MM,
            "tools": [
                {
                    "name": name,
                    "error_um": listed(value),
                    "sigma_um": listed(self.sigma_mm[name]),
                    "gauge_to_tip_mm": _corrected(self.postures, name, value),
                }
                for name, value in self.error_mm.items()
            ],
        }


def fit(postures: Postures, error_mm: Array | None = None, reference: str | None = None) -> PostureFit:
    """Errors of the tool vectors by least squares.

    `error_mm` (n, 3) is the error of the machine at each posture where a calibration gives it. `reference`
    names a tool whose vector is right; without one, and where the head never turns, the first tool is taken,
    as only differences are determined. Raises ConfigError.
    """
    names = postures.tools
    if reference is not None and reference not in names:
        raise ConfigError(
            f"reference tool {reference} is not among the postures; expected one of {', '.join(names)}",
            file=postures.source,
        )
    n = len(postures.axis_mm)
    turned = bool(np.ptp(postures.turn, axis=0).max() > 1e-9)
    if reference is None and not turned and len(names) > 1:
        reference = names[0]
    tip = postures.axis_mm + postures.tool_vector_mm + (0.0 if error_mm is None else error_mm)
    before = tip - tip.mean(axis=0)
    fitted = [name for name in names if name != reference]
    design = np.zeros((n, 3, 3 + 3 * len(fitted)))
    design[:, :, :3] = np.eye(3)
    for k, name in enumerate(fitted):
        rows = np.array([own == name for own in postures.tool])
        design[rows, :, 3 + 3 * k : 6 + 3 * k] = -postures.turn[rows]
    system, right = design.reshape(3 * n, -1), before.reshape(-1)
    _, singular, v = np.linalg.svd(system, full_matrices=True)
    rank = int((singular > _RANK * singular[0]).sum())
    hidden = np.abs(v[rank:]).max(axis=0, initial=0.0) > _SHARE
    inverse = np.linalg.pinv(system, rcond=_RANK)
    estimate = inverse @ right
    residual = (right - system @ estimate).reshape(n, 3)
    dof = 3 * n - rank
    noise = float(np.sqrt((residual**2).sum() / dof)) if dof > 0 else postures.sigma
    if dof <= 0 and postures.sigma == 0.0:
        raise ConfigError(
            f"{n} postures are just enough for what is unknown, and sigma_um is not stated; expected "
            "repeated postures, or the uncertainty of a coordinate",
            file=postures.source,
        )
    sigma = max(noise, postures.sigma) * np.sqrt(np.diag(inverse @ inverse.T))
    value, spread = np.where(hidden, np.nan, estimate), np.where(hidden, np.nan, sigma)
    errors = {name: value[3 + 3 * k : 6 + 3 * k] for k, name in enumerate(fitted)}
    sigmas = {name: spread[3 + 3 * k : 6 + 3 * k] for k, name in enumerate(fitted)}
    return PostureFit(
        postures, tip.mean(axis=0) + value[:3], errors, sigmas, reference, before, residual, noise, dof
    )  # fmt: skip


def turn_of(a_deg: Array, b_deg: Array, c_deg: Array) -> Array:
    """(n, 3, 3) turns of the head Rz(c) Ry(b) Rx(a), right-handed, in degrees (n,) each."""
    a, b, c = (np.radians(np.asarray(v, float)) for v in (a_deg, b_deg, c_deg))
    sa, ca, sb, cb, sc, cc = np.sin(a), np.cos(a), np.sin(b), np.cos(b), np.sin(c), np.cos(c)
    rows = (
        (cb * cc, sa * sb * cc - ca * sc, ca * sb * cc + sa * sc),
        (cb * sc, sa * sb * sc + ca * cc, ca * sb * sc - sa * cc),
        (-sb, sa * cb, ca * cb),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def program(
    tools: Sequence[int], point_mm: Vector, *, clearance_mm: float, feed_mm_min: float, runs: int = 3
) -> str:
    """RS-274 text that brings each tool, its length active, to one point of the active work offset from above
    and stops there. You then set the axes until the tip is on the point, and read them."""
    x, y, z = (f"{v:.4f}" for v in point_mm)
    above = f"{point_mm[2] + clearance_mm:.4f}"
    lines = [
        f"(postures: {len(tools)} tools, {runs} runs, point X{x} Y{y} Z{z} of the active work offset)",
        "(at each stop set the tip onto the point and note the axis positions)",
        "G21 G90 G94 G61",
    ]
    for run in range(1, runs + 1):
        for tool in tools:
            lines += [
                f"(run {run} tool {tool})", f"T{tool} M6", f"G43 H{tool}", f"G0 Z{above}", f"G0 X{x} Y{y}",
                f"G1 Z{z} F{feed_mm_min:g}", "M0", f"G0 Z{above}",
            ]  # fmt: skip
    return "\n".join([*lines, "M2"]) + "\n"


def _corrected(postures: Postures, name: str, error: Array) -> list[float] | None:
    if not np.isfinite(error).all():
        return None
    row = postures.tool.index(name)
    return [float(v) for v in postures.vector_mm[row] + error]


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).sum(axis=1).mean()))
