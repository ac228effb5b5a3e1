"""What `olp inspect` says of maps, loads and temperatures of a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from olp.core.units import RAD_PER_URAD, UM_PER_MM

if TYPE_CHECKING:
    from olp.errormodel.calibration import Calibration
    from olp.errormodel.structure import Structure


def grid_summary(calibration: Calibration, chain: str) -> dict[str, Any]:
    """Maps, loads, temperatures and the random part, each where there is any."""
    out: dict[str, Any] = {}
    if calibration.maps:
        out["maps"] = [
            {
                "name": m.name,
                "kind": m.kind,
                "interpolation": m.interpolation,
                "nodes": " x ".join(str(len(k)) for k in m.knots_mm),
                "tool_mm": list(m.tool_mm),
                "max_um": float(np.sqrt((m.values**2).sum(axis=-1)).max()) * UM_PER_MM,
            }
            for m in calibration.maps
        ]
    tables = [*calibration.compliance, *(b.table(calibration.box_mm, chain) for b in calibration.beams)]
    if tables:
        out["load"] = [
            {
                "name": f"{table.name}: {name}",
                "by_position_of": " and ".join(table.arguments),
                "max_um_kg" if name[1] in "XYZ" else "max_urad_kg": float(np.abs(values).max())
                * (UM_PER_MM if name[1] in "XYZ" else 1.0 / RAD_PER_URAD),
            }
            for table in tables
            for name, values in table.columns.items()
        ]
        out["load_measured_with"] = {"payload_kg": calibration.payload_kg}
    if calibration.structure is not None:
        out |= _structure(calibration.structure)
    if calibration.repeatability_mm is not None:
        out["repeatability"] = {
            f"{axis}_um": sigma * UM_PER_MM
            for axis, sigma in zip("XYZ", calibration.repeatability_mm, strict=True)
        }
    return out


def _structure(structure: Structure) -> dict[str, Any]:
    sensors = [
        {
            "name": s.name,
            "reference_degC": s.reference_degC,
            "lowest_degC": s.range_degC[0],
            "highest_degC": s.range_degC[1],
            "lag_s": s.lag_s,
        }
        for s in structure.sensors
    ]
    distortions = []
    for d in structure.distortions:
        unit, scale = ("urad", 1.0 / RAD_PER_URAD) if d.component[1] in "ABC" else ("um", UM_PER_MM)
        distortions.append(
            {
                "name": f"{d.component} by {d.sensor}",
                f"offset_{unit}_K": d.offset * scale,
                f"growth_{unit}_m_K": d.growth * scale * 1e3,
                f"bow_{unit}_K": d.bow * scale,
            }
        )
    return {"sensors": sensors, "distortions": distortions}
