"""`olp verify`."""

from __future__ import annotations

import datetime

import click

from olp.cli.common import (
    STREAM,
    exit_for,
    needed,
    proof_options,
    put,
    setup_options,
    shown,
    source,
)
from olp.exceptions import ProgramError, UsageError


@click.command("verify")
@click.argument("nominal")
@click.argument("corrected")
@setup_options
@proof_options
def command(
    nominal: str,
    corrected: str,
    machine: str | None,
    job: str | None,
    tolerance_um: float,
    outside_box: str,
    contour: bool,
    date: datetime.datetime | None,
    as_json: bool,
    fail_on: str,
) -> None:
    """Prove a corrected program from the two texts alone.

    Whoever wrote CORRECTED: it is read, run through the model of the machine's errors, and compared with the
    path of NOMINAL.
    """
    if nominal == corrected == STREAM:
        raise UsageError("NOMINAL and CORRECTED cannot both come from stdin; name one of the files")
    nominal, machine = needed(nominal, machine, job)

    from olp import api, report

    try:
        result = api.verify(
            source(nominal),
            source(corrected),
            machine,
            job,
            tolerance_um=tolerance_um,
            outside_box="hold" if outside_box == "hold" else "refuse",
            contour=contour,
            date=date.date() if date else None,
        )
    except ProgramError as error:
        raise error.in_file(shown(STREAM)) from None
    put(report.to_json(result.report) if as_json else report.to_text(result.report))
    exit_for(result.findings, fail_on)
