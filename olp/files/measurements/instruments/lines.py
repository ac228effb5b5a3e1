"""Readings along lines by lasers, levels, autocollimators, straightedges: tables [[lines]]."""

from __future__ import annotations

import re
from pathlib import Path

from olp.calibration.observations.lines import Line
from olp.core.arrays import Index
from olp.core.errors import ConfigError
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.files.measurements.instruments.base import UM_M, Instrument, Plan, SeenFile
from olp.files.measurements.line_keys import LineTable
from olp.files.measurements.line_merging import as_line, merged, stated_of
from olp.files.measurements.line_profile import load_line_profile, read_line
from olp.files.measurements.readings import check_component
from olp.files.toml_text import toml_lines

#: A component in the name of a file, such as eyz-left.csv.
_COMPONENT = re.compile(r"(?<![A-Z])(E[XYZABC][XYZ])(?![A-Z])")


class LineFiles(Instrument[LineTable, Line]):
    key = "lines"
    table = LineTable
    words = "tables [[lines]]"
    gives = Line
    plans = True
    marks = ("target_mm",)
    asks = ("component",)

    def proposed(self, seen: SeenFile) -> dict[str, object] | None:
        if super().proposed(seen) is None or "start_mm" in seen.stated:
            return None
        if seen.component is not None or "component" in seen.stated:
            return {"component": seen.component or seen.stated["component"].strip("\"'")}
        named = _COMPONENT.search(Path(seen.name).stem.upper())
        angular = any(name.endswith("_urad") for name in seen.header)
        fits = named is not None and (named[1][1] in "ABC") == angular
        return {"component": named[1]} if named is not None and fits else {}

    def read(self, table: LineTable, plan: Plan) -> Line:
        path = plan.beside(table.file)
        profile = table.profile or plan.defaults.profile
        readings = read_line(path, load_line_profile(plan.beside(profile)) if profile else None)
        stated, key_lines = stated_of(readings.keys, str(path))
        component = table.component or stated.component or readings.component
        if component is None:
            raise ConfigError("component is missing; expected a name such as EXX in the plan or the file")
        check_component(readings, component)
        keys = merged(table, stated, plan.defaults, key_lines, str(path))
        if readings.sense_known and table.sense is not None:
            raise ConfigError(
                "sense is stated in the profile and in the plan; expected it once", file=str(plan.path)
            )
        return as_line(readings, component, keys, plan.vertical, plan.chain, str(path))

    def asked(self, taken: Line, name: str) -> list[str]:
        angle = taken.quantity == "angle"
        sigma = round(taken.sigma / RAD_PER_URAD if angle else taken.sigma * UM_PER_MM, 6)
        values: dict[str, object] = {
            "file": name,
            "component": taken.component,
            "line_mm": {a: taken.line_mm[k] for k, a in enumerate(AXES) if a != taken.component[2]},
            "tool_mm": list(taken.tool_mm),
            "sense": "actual-minus-commanded",
            "square": taken.square,
            "sigma_urad" if angle else "sigma_um": sigma,
            "sigma_scale_um_m": round(taken.sigma_scale * UM_M, 6) if taken.sigma_scale else None,
        }
        return ["[[lines]]", *toml_lines(values)]

    def empty(self, taken: Line, rows: Index) -> bytes:
        lines = [f"target_mm,run,direction,value_{'urad' if taken.quantity == 'angle' else 'um'}"]
        columns = zip(
            taken.target_mm[rows].tolist(), taken.run[rows].tolist(), taken.direction[rows].tolist(),
            strict=True,
        )  # fmt: skip
        lines += [f"{q:g},{run},{side}," for q, run, side in columns]
        return ("\n".join(lines) + "\n").encode()
