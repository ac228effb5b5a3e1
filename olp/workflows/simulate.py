"""`simulate`: the path of the tip that the uncompensated machine would take."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp.compensation.plan import zero_shifts
from olp.core.arrays import Array, Index, read_only
from olp.core.machine import Setup
from olp.core.progress import Progress, part, silent
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.known import KnownErrors
from olp.files.sources import Source, Sources
from olp.files.write import write_bytes
from olp.findings.catalogue import Finding
from olp.program.origin import Files, Origin, original_of
from olp.program.program import Program
from olp.program.registry import Options
from olp.program.text.columns import spans
from olp.reports.report import printable
from olp.workflows import refusals
from olp.workflows.doubt import accepted_of, doubted
from olp.workflows.flatten import UnrollOptions, above_zero
from olp.workflows.original import placed, placed_findings
from olp.workflows.session import Loaded, Outside, PathLike, Session, opened
from olp.workflows.shown import Shown


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateOptions(UnrollOptions):
    """The options of `simulate`."""

    step_mm: float = 1.0
    outside_box: Outside = "hold"
    date: datetime.date | None = None
    accept: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        above_zero(self, "step_mm", "peck_clearance_mm")


@dataclass(frozen=True, slots=True, eq=False)
class Simulation(Shown):
    """(n, 3) tip positions of the machine with its errors, in the program's first work frame, and the line of
    each. Lines count through the files of an unrolled program (`origin`). The findings are doubts about the
    inputs. The report ("olp-simulation-1") is a mapping; it judges nothing, as only one program is known.
    `inputs` are the files that were read, which `write` never overwrites."""

    points_mm: Array
    line: Index
    frame: str
    report: dict[str, Any]
    findings: tuple[Finding, ...] = ()
    origin: Origin | None = None
    inputs: tuple[str, ...] = ()

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write `to_csv` as `Correction.write` does."""
        write_bytes(path, self.to_csv(), force=force, inputs=self.inputs)
        return Path(path)

    def parts(self, progress: Progress | None = None) -> Iterator[bytes]:
        """`X_mm,Y_mm,Z_mm,line` with the frame named in a comment, in parts; `file` too where lines are of
        several."""
        files, count = Files(self.origin), len(self.line)
        yield f"# frame={printable(self.frame)}\nX_mm,Y_mm,Z_mm,line{files.head}\n".encode()
        for some in spans(count):
            (progress or silent)("write", some.start / count)
            points, lines = self.points_mm[some].tolist(), self.line[some].tolist()
            rows = (
                f"{x:.6f},{y:.6f},{z:.6f},{files.cells(n)}\n"
                for (x, y, z), n in zip(points, lines, strict=True)
            )
            yield "".join(rows).encode()

    def to_csv(self) -> bytes:
        """The file as a whole."""
        return b"".join(self.parts())


def simulate(
    program: PathLike | bytes,
    machine: PathLike | Setup | KnownErrors,
    job: PathLike | None = None,
    *,
    step_mm: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "hold",
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    progress: Progress | None = None,
) -> Simulation:
    """The path of the tip that the uncompensated machine would take, in the program's first work frame.

    `flatten`, `expand_cycles` and `peck_clearance_mm` are those of `correct`. Raises Doubtful where the
    inputs are not plausible, except for the codes of `accept` and of the stamp.
    """
    session, source = opened(program, machine, job, "<program>")
    options = SimulateOptions(
        step_mm=step_mm, outside_box=outside_box, flatten=flatten,
        expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm, date=date, accept=tuple(accept),
    )  # fmt: skip
    return run(session, source, options, progress)


def run(
    session: Session, program: Source, options: SimulateOptions, progress: Progress | None = None
) -> Simulation:
    """As `simulate`, in a session."""
    with program.errors("<program>"):
        loaded = session.loaded(options.outside_box).reading(program)
    done = simulated(session.sources, program, loaded, options, progress or silent)
    return replace(done, inputs=session.inputs())


def simulated(
    sources: Sources, program: Source, loaded: Loaded, options: SimulateOptions, tell: Progress = silent
) -> Simulation:
    """As `simulate`, of a program whose dialect is settled in `loaded`."""
    with program.errors("<program>"):
        tell("read", 0.0)
        reading = Options(tell=part(tell, 0.0, 0.5))
        program, parsed = refusals.read(
            sources, program, loaded.setup, loaded.dialect, reading, options, words=False
        )
        doubts = doubted(
            parsed, loaded, options.accept, options.date, name=program.name, stamped=program.data
        )
        parsed = parsed.in_original()
        path = parsed.toolpath
        parts = []
        for some in tips(path, loaded.model, options.step_mm):
            parts.append(some)
            tell("simulate", 0.5 + 0.5 * float(some[1][-1]) / len(path))
    if not parts:
        points_mm = np.zeros((0, 3))
        report = _report(program, parsed, loaded, options, points_mm, "", doubts)
        return Simulation(read_only(points_mm), read_only(np.zeros(0, np.int64)), "", *report, parsed.origin)
    actual, move = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    home = path.frames[int(path.frame[0])]
    known = np.isfinite(actual).all(axis=1)
    line = path.line[move[known]].astype(np.int64)
    report = _report(program, parsed, loaded, options, actual[known], home.work_offset, doubts)
    points_mm = read_only(actual[known])
    return Simulation(points_mm, read_only(line), home.work_offset, *report, parsed.origin)


def tips(path: Toolpath, model: ErrorModel, step_mm: float) -> Iterator[tuple[Array, Index]]:
    """Where the tip of the uncompensated machine is (m, 3) along a path, every `step_mm`, in its first work
    frame; NaN where a position is unknown. And the move of each point (m,). It comes in parts."""
    from olp.proof.deviation import Tracer

    shift = zero_shifts(path.frames, model)
    lengths = [f.length_mm for f in path.frames]
    for actual, move in Tracer.traced(path, model, step_mm):
        first = int(path.frame[0])
        length = path.per_frame(lengths, begin := int(move[0]), int(move[-1]) + 1)
        tip = actual - shift[first] - (length if length.ndim == 1 else length[move - begin])
        yield path.frames[first].tip_mm(tip), move


def _report(
    source: Source, program: Program, loaded: Loaded, options: SimulateOptions, points_mm: Array, frame: str,
    findings: tuple[Finding, ...],
) -> tuple[dict[str, Any], tuple[Finding, ...]]:  # fmt: skip
    """The report, and the findings with the files of their lines."""
    some = len(points_mm) > 0
    report = {
        "schema": "olp-simulation-1",
        "program": {
            "name": source.short,
            "sha256": hashlib.sha256(original_of(source.data)).hexdigest(),
            "lines": program.lines,
            "dialect": loaded.dialect.name,
            "moves": len(program.toolpath),
        },
        **loaded.heads(),
        "frame": frame,
        "step_mm": options.step_mm,
        "points": len(points_mm),
        "range_mm": [points_mm.min(axis=0).tolist(), points_mm.max(axis=0).tolist()] if some else None,
        "accepted": accepted_of(findings),
        "findings": [finding.as_dict() for finding in findings],
    }
    return placed(report, program.origin), placed_findings(findings, program.origin)
