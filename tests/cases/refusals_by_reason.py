"""Every real program of the corpus in RS-274, Sinumerik and APT, read after a user followed the remedies.

    python tests/cases/refusals_by_reason.py CORPUS        # prints the table

Tools and offsets are given, zero where nothing is known of them. The axes have a start, contours are taken as
tool paths, and what is parametric is unrolled.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from judge import machines
from judge.machines import Recipe

import olp
from olp.core.errors import OlpError, ProgramError

#: The control that each folder of the corpus was written for.
FOLDERS = {
    "gcode_cncjs": "grbl",
    "gcode_fanuc": "fanuc",
    "gcode_fanuc_haas_nist": "haas",
    "apt_cldata": "apt",
    "gcode_sinumerik": "sinumerik",
}
FAMILIES = {"apt_cldata": "APT", "gcode_sinumerik": "Sinumerik"}
_NAMED = re.compile(rb'(?i)\bT\d*[ \t]*=[ \t]*"([^"]+)"')
#: Radius of all tools in mm: that of the smallest cutter that cuts a contour in the corpus, which is 1/8 inch
#: wide. A larger one does not fit into the arcs, and the control stops there.
RADIUS_MM = 1.5875


@dataclass(frozen=True)
class Outcome:
    """What became of a program: `code` and `line` of its refusal, empty and 0 where it was read. `kept` says
    that a machine without errors changed none of its bytes; what was unrolled is not compared."""

    folder: str
    name: str
    code: str = ""
    line: int = 0
    why: str = ""
    kept: bool = True

    @property
    def family(self) -> str:
        return FAMILIES.get(self.folder, "RS-274")


def machine(folder: Path, control: str, called: list[str] | None = None) -> tuple[Path, Path]:
    """A machine without errors, with tools that are `called` by name, and the job that says where the axes
    start."""
    names = [
        *(f"G{n}" for n in (*range(54, 60), *range(505, 600))),
        *(f"CSYS{n}" for n in range(1, 10)),
        "MCS",
    ]
    offsets = {name: {"set_by": "true"} for name in names}
    recipe = Recipe(
        controller=control,
        travel=((-5000.0, 5000.0),) * 3,
        tools={
            **{n: {"Z_mm": 0.0, "radius_mm": RADIUS_MM} for n in range(1, 100)},
            **{
                100 + k: {"Z_mm": 0.0, "radius_mm": RADIUS_MM, "name": name}
                for k, name in enumerate(called or ())
            },
        },
        work_offsets=offsets,
    )
    path = machines.zero_machine(folder, recipe)
    # `X0Y50` is beside `X50.Y0` in these
    text = path.read_text().replace('decimal_point = "increment"', 'decimal_point = "calculator"')
    path.write_text(text)
    job = folder / "job.toml"
    start = "start_mm = { X = 0.0, Y = 0.0, Z = 100.0 }"
    job.write_text(f'schema = "olp-job-1"\nmachine = "machine.toml"\n{start}\n')
    return path, job


def outcomes(corpus: Path) -> list[Outcome]:
    """What becomes of every program."""
    every = []
    for folder, control in FOLDERS.items():
        with tempfile.TemporaryDirectory() as place:
            paths = sorted(p for p in (corpus / folder).iterdir() if p.is_file())
            called = {name.decode("latin-1") for path in paths for name in _NAMED.findall(path.read_bytes())}
            setup = olp.load_setup(*machine(Path(place), control, sorted(called)))
            for path in paths:
                every.append(_outcome(path, setup))
    return every


def _outcome(path: Path, setup: olp.Setup) -> Outcome:
    error: OlpError | None = None
    for flatten in (False, True):
        try:
            data = olp.correct(path, setup, flatten=flatten).data
            return Outcome(path.parent.name, path.name, kept=flatten or data == path.read_bytes())
        except OlpError as refusal:
            error = error or refusal
            if isinstance(refusal, ProgramError) and (flatten or refusal.code != "OLP511"):
                error = refusal
                break
    code = getattr(error, "code", "") or type(error).__name__
    line = getattr(error, "line", None) or 0
    return Outcome(path.parent.name, path.name, code, line, getattr(error, "message", str(error)))


def table(every: list[Outcome]) -> str:
    """Counts by reason, and each refusal."""
    lines = []
    for family in ("RS-274", "APT", "Sinumerik"):
        mine = [each for each in every if each.family == family]
        read = sum(not each.code for each in mine)
        lines.append(f"{family}: {read} of {len(mine)} programs are read")
        for code, count in Counter(each.code for each in mine if each.code).most_common():
            lines.append(f"  {code}: {count}")
            lines += [f"    {e.folder}/{e.name}:{e.line}: {e.why}" for e in mine if e.code == code]
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(outcomes(Path(sys.argv[1]))))
