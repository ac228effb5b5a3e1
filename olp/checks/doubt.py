"""What makes the inputs of a run implausible: a wrong unit, file, sign or decimal point, before anything is
computed from them. A doubt is a finding; as an error it stops the run unless it is accepted."""

from __future__ import annotations

import datetime

from olp.checks.doubt_calibration import calibration_doubts
from olp.checks.doubt_program import program_doubts
from olp.checks.doubt_setup import setup_doubts
from olp.checks.doubt_size import size_doubts
from olp.checks.state import calibration_findings
from olp.core.machine import Machine, Setup
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.calibration import Calibration
from olp.errormodel.uncertainty import Uncertainty
from olp.findings.catalogue import Finding
from olp.program.program import Program


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """What a run is given: machine and job, the program as read, and the day of the run. Calibration and
    model are None for a run without them, and `uncertainty` where none is stated. Where the call states the
    errors in place of files, `assumed` is what it assumes, and `by_height` whether they depend on Z."""

    setup: Setup
    program: Program
    calibration: Calibration | None
    model: ErrorModel | None
    date: datetime.date | None
    uncertainty: Uncertainty | None
    assumed: tuple[str, ...] = ()
    by_height: bool = False


def doubts(inputs: Inputs) -> tuple[Finding, ...]:
    """Every doubt about the inputs of a run."""
    setup, path = inputs.setup, inputs.program.toolpath
    findings = [*program_doubts(inputs.program, setup), *setup_doubts(path, setup, inputs.calibration)]
    if inputs.assumed:
        from olp.checks.doubt_assumed import assumption_findings

        assert inputs.calibration is not None
        findings += assumption_findings(path, inputs.assumed, by_height=inputs.by_height)
        findings += calibration_doubts(inputs.calibration, setup.machine, None, None, made=False)
    elif inputs.calibration is not None:
        findings += stated_doubts(inputs.calibration, setup.machine, inputs.date, inputs.uncertainty)
    if inputs.calibration is not None and inputs.model is not None:
        findings += size_doubts(path, inputs.model, inputs.calibration, setup.machine)
    return tuple(findings)


def stated_doubts(
    calibration: Calibration, machine: Machine, date: datetime.date | None, uncertainty: Uncertainty | None
) -> list[Finding]:
    """Doubts about what a calibration states, on the day of the run."""
    days = machine.sanity.calibration_days
    return [
        *calibration_findings(calibration, date, days),
        *calibration_doubts(calibration, machine, date, uncertainty),
    ]
