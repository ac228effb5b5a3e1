"""The non-rigid field of a machine as a deviation map: a grid fine enough for interpolation at run time,
with standard uncertainties."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from olp.calibration.estimator.nonrigid import NonRigid
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.grid_interpolation import Grid
from olp.core.machine import Vector
from olp.core.units import UM_PER_MM
from olp.errormodel.calibration import Calibration
from olp.errormodel.sources.maps import DeviationMap
from olp.findings.catalogue import Finding

#: How far interpolation may be off where the user states nothing, mm.
WITHIN_MM = 2e-4
#: Levels along an axis, at least.
FEWEST = 5
#: Levels along an axis, at most.
MOST = 41
#: Levels along an axis at which uncertainties are computed.
SIGMA_LEVELS = 7
#: Offsets of the reflector that differ by less than this are one.
_ONE_MM = 1.0


def residual_map(result: NonRigid, calibration: Calibration, within_mm: float = WITHIN_MM) -> DeviationMap:
    """The map of a field over the box of its calibration, smooth between nodes ("cubic"), and nowhere more
    than `within_mm` from the field in any coordinate, as checked between all nodes.

    Its sigma is what has to be added, squared, to the variance of the curves with the map's tool so that the
    sum is that of curves and field together. Raises CannotCompute where no grid of a sensible size does.
    """
    box = calibration.box_mm
    counts = [FEWEST, FEWEST, FEWEST]
    while True:
        knots = [np.linspace(low, high, n) for (low, high), n in zip(box.tolist(), counts, strict=True)]
        grid = Grid.through(knots, _values(result, knots), "cubic")
        missed = [_missed(result, grid, axis) for axis in range(3)]
        # interpolation errors along the axes add up within a cell
        if sum(missed) <= within_mm:
            break
        worst = int(np.argmax(missed))
        counts[worst] += max(2, counts[worst] // 4)
        if counts[worst] > MOST:
            raise CannotCompute(
                f"a grid of {MOST} levels along {'XYZ'[worst]} is {missed[worst] * UM_PER_MM:.2g} um off the "
                f"map; expected at most {within_mm * UM_PER_MM:g} um; state a larger within_um"
            )
    x, y, z = (np.asarray(np.round(k, 6), float) for k in knots)
    tool = tool_of(result)
    sigma = _sigma(result, knots, np.array(tool))
    return DeviationMap(
        knots_mm=(x, y, z),
        values=np.round(grid.values, 7) + 0.0,
        tool_mm=tool,
        interpolation="cubic",
        name="map",
        sigma=np.round(sigma, 7),
    )


def tool_of(result: NonRigid) -> Vector:
    """The offset of the reflector nearest to the mean of all."""
    tools = result.tools_mm
    x, y, z = tools[int(np.argmin(np.linalg.norm(tools - tools.mean(axis=0), axis=1)))].tolist()
    return (x, y, z)


def _places(knots: list[Array]) -> Array:
    return np.array(list(product(*(k.tolist() for k in knots))))


def _values(result: NonRigid, knots: list[Array]) -> Array:
    return result.value(_places(knots)).reshape(*(len(k) for k in knots), 3)


def _sigma(result: NonRigid, knots: list[Array], tool: Array) -> Array:
    """At the nodes, from a coarser grid: uncertainties change slowly."""
    coarse = [np.linspace(k[0], k[-1], SIGMA_LEVELS) for k in knots]
    positions = _places(coarse)
    rest = result.sigma(positions, tool) ** 2 - result.fit.sigma(positions, tool) ** 2
    values = np.sqrt(np.maximum(rest, 0.0)).reshape(*(len(k) for k in coarse), 3)
    return Grid.through(coarse, values, "linear")(_places(knots)).reshape(*(len(k) for k in knots), 3)


def _missed(result: NonRigid, grid: Grid, axis: int) -> float:
    """By how much the grid misses the field between its levels along one axis, the others at their levels."""
    knots = list(grid.knots)
    k = knots[axis]
    knots[axis] = (k[:-1, None] + np.diff(k)[:, None] * np.array([0.25, 0.5, 0.75])).ravel()
    return float(np.abs(grid(_places(knots)) - _values(result, knots).reshape(-1, 3)).max())


def map_summary(result: NonRigid, described: DeviationMap | None) -> dict[str, Any]:
    """The report of a map, or of why there is none."""
    report: dict[str, Any] = {"written": described is not None}
    if described is None:
        report["why_not"] = result.reason
    if result.best is not None:
        report["log_evidence"] = result.best.evidence
    report["noise_over_stated"] = result.noise
    if result.figures is not None:
        figures = result.figures
        report |= {
            "residual_before_sigma": figures.residual_before,
            "residual_after_sigma": figures.residual_after,
            "held_out_before_sigma": figures.held_out_before,
            "held_out_after_sigma": figures.held_out_after,
        }
    if described is not None:
        assert described.sigma is not None
        report |= {
            "nodes": " x ".join(str(len(k)) for k in described.knots_mm),
            "max_um": float(np.linalg.norm(described.values, axis=-1).max()) * UM_PER_MM,
            "sigma_um": float(np.sqrt(np.mean((described.sigma**2).sum(axis=-1)))) * UM_PER_MM,
            "tool_mm": list(described.tool_mm),
            "processes": [
                {
                    "name": p.coordinate,
                    "size_um": p.size_mm * UM_PER_MM,
                    "length_mm": list(p.lengths_mm),
                    "log_evidence": p.evidence,
                }
                for p in result.processes
            ],
        }
    return report


def map_findings(result: NonRigid, described: DeviationMap | None) -> Iterator[Finding]:
    """The findings about a map."""
    if described is None:
        yield Finding("OLP842", result.reason)
        return
    assert result.figures is not None
    figures = result.figures
    largest = float(np.linalg.norm(described.values, axis=-1).max()) * UM_PER_MM
    names = ", ".join(process.coordinate for process in result.processes)
    yield Finding(
        "OLP841",
        f"{names}: up to {largest:.1f} um that no curve holds; held-out readings are predicted within "
        f"{figures.held_out_after:.2f} of their sigma, without the map within {figures.held_out_before:.2f}",
    )
    size = np.linalg.svd(result.tools_mm - result.tools_mm.mean(axis=0), compute_uv=False)
    offsets = int(np.sum(size > _ONE_MM * np.sqrt(len(result.tools_mm))))
    if offsets < 2:
        tool = ", ".join(f"{v:g}" for v in described.tool_mm)
        what = "lie on one line" if offsets else "are one"
        yield Finding(
            "OLP843",
            f"the offsets of the reflector {what}: curves and map together hold for tools near [{tool}] mm; "
            "effects of angles that are not observable on other tools are in neither",
        )
