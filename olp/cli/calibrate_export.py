"""`olp calibrate export`."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING, Any

import click

from olp.cli.calibrate_import import table_options
from olp.cli.common import STREAM, diagnostic, exit_for, files_of, machine_given, put, refuse_early
from olp.cli.options import (
    Count,
    doubt_options,
    fail_on_option,
    json_option,
    output_option,
    program_options,
)
from olp.core.errors import UsageError

if TYPE_CHECKING:
    from olp.errormodel.calibration import Reference
    from olp.files.control_tables.base import Sense


@click.command("export")
@program_options
@click.option("-c", "--calibration", metavar="FILE", help="A calibration alone, without a machine.")
@click.option("--format", "kind", metavar="FORMAT", help="One of: olp calibrate formats.")
@output_option("FILE", "The table; further files go beside it.")
@click.option("--compare", is_flag=True, help="Write nothing; show the residual error of every format.")
@click.option("--program", metavar="PROGRAM", help="Also show the residual error along this program.")
@click.option("--most-rows", type=Count(min=2), help="Rows that the control takes in one table.")
@click.option("--self-test", is_flag=True, help="Compile written code here and compare it with the model.")
@doubt_options
@json_option()
@fail_on_option
@table_options
def command(
    machine: str | None,
    job: str | None,
    calibration: str | None,
    kind: str | None,
    output: str | None,
    compare: bool,
    program: str | None,
    most_rows: int | None,
    self_test: bool,
    date: datetime.date | None,
    accept: tuple[str, ...],
    as_json: bool,
    fail_on: str,
    sense: Sense | None,
    comp_type: int | None,
    names: dict[str, str],
    reference: Reference | None,
    chain: str | None,
    force: bool,
    **unrolling: Any,
) -> None:
    """Write a calibration as the compensation table of a control, or as code that corrects in real time.

    The residual error is shown next to that of a corrected program, so that you can choose.
    """
    from olp.files.write import write_files
    from olp.workflows.calibrate_export import compare_tables, export_table
    from olp.workflows.calibrate_export_joints import given_joints, joint_inputs

    if compare == (kind is not None):
        raise UsageError("give either --format with -o, or --compare")
    if machine is None and job is None:
        described: tuple[str, ...] = ()
    elif (of_joints := given_joints(machine, job)) is not None:
        described = joint_inputs(of_joints, job)
    else:
        described = machine_given(machine, job)[1]
    inputs = (*files_of(calibration, program), *described)
    common: dict[str, Any] = {
        "calibration": calibration, "program": program, "reference": reference, "most_rows": most_rows,
        "chain": chain, "date": date, "accept": accept, **unrolling,
    }  # fmt: skip
    if kind is None:
        _put(compare_tables(machine, job, **common), as_json)
        return
    if output is None or output == STREAM:
        raise UsageError("a table is written to files; name the first one with -o")
    refuse_early([output], inputs, force=force)
    exported = export_table(
        machine, kind, output, job, sense=sense, comp_type=comp_type, axis_names=names,
        self_test=self_test, **common,
    )  # fmt: skip
    write_files(exported.files, force=force, inputs=inputs)
    _put(exported.report, as_json)
    for finding in exported.findings:
        diagnostic(f"{finding.severity.name.lower()}: {finding.code} {finding.message}")
    for note in exported.notes:
        diagnostic(f"note: {note}")
    for path in exported.files:
        diagnostic(f"wrote {path}")
    exit_for(exported.findings, fail_on)


def _put(report: dict[str, Any], as_json: bool) -> None:
    from olp.reports.report import table, to_json
    from olp.workflows.calibrate_export import parts_rows, residual_rows, turns

    if as_json:
        put(to_json(report))
        return
    header = ["residual with", "rms um", "max um", "in frame"]
    if "program" in report:
        header += ["path rms", "path max", "in frame"]
    if turns(report):
        header += ["rms urad", "max urad"]
    box = report["box"]
    over = f"{box['points']} points over the box, {len(box['tools_mm'])} tool(s)"
    lines = [f"{over}; in frame: rms after a best-fit frame"]
    lines += table(header, residual_rows(report))
    if rows := parts_rows(report):
        lines += table(["left of each kind by itself", "rms um", "max um", "rms urad", "max urad"], rows)
    if report.get("program", {}).get("refused"):
        lines.append(f"olp correct refuses the program: {report['program']['refused']}")
    for key, form in report.get("formats", {}).items():
        for finding in form["findings"]:
            lines.append(f"{key}: {finding['message']}")
    if "self_test" in report:
        lines.append(f"self-test: {report['self_test']}")
    if "real_time" in report:
        lines += ["once the control runs it, in the machine file:", f'real_time = "{report["real_time"]}"']
    if "compensated_by_controller" in report:
        listed = ", ".join(f'"{name}"' for name in report["compensated_by_controller"])
        lines += ["with this table active, in the machine file:", f"compensated_by_controller = [{listed}]"]
    put("\n".join(lines) + "\n")
