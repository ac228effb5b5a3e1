"""`olp verify`."""

from __future__ import annotations

import datetime

import click

from olp.cli.common import (
    STREAM,
    confidence_options,
    exit_for,
    given,
    proof_options,
    put,
    setup_options,
    source,
)
from olp.core.errors import UsageError


@click.command("verify")
@click.argument("nominal")
@click.argument("corrected")
@setup_options
@proof_options
@confidence_options
def command(
    nominal: str,
    corrected: str,
    machine: str | None,
    job: str | None,
    tolerance_um: float,
    contour: bool,
    within_um: float | None,
    only_sure_components: bool,
    date: datetime.date | None,
    as_json: bool,
    fail_on: str,
) -> None:
    """Prove a corrected program from the two texts alone.

    Whoever wrote CORRECTED: it is read, run through the model of the machine's errors, and compared with the
    path of NOMINAL.
    """
    if nominal == corrected == STREAM:
        raise UsageError("NOMINAL and CORRECTED cannot both come from stdin; name one of the files")
    call = given(nominal, machine, job)

    from olp.reports import report
    from olp.workflows import api

    result = api.verify(
        source(nominal),
        source(corrected),
        call.setup,
        tolerance_um=tolerance_um,
        contour=contour,
        within_um=within_um,
        only_sure_components=only_sure_components,
        date=date,
    )
    put(report.to_json(result.report) if as_json else report.to_text(result.report))
    exit_for(result.findings, fail_on)
