"""`olp calibrate plan`."""

from __future__ import annotations

import datetime
from typing import Any, Literal

import click

from olp.cli.common import diagnostic, exit_for, files_of, put_result, refuse_early
from olp.cli.options import (
    MM,
    Count,
    Length,
    day_option,
    fail_on_option,
    force_option,
    json_option,
    machine_option,
    output_option,
    quiet_option,
    reflector_option,
    sigma_option,
    units_option,
)
from olp.core.errors import UsageError

METHODS = ("lines", "targets", "tracker", "lines-and-tracker", "pods", "multilateration")


@click.command("plan")
@machine_option(required=True)
@click.option(
    "--uncertainty-um", type=Length(), default=5.0, show_default=True,
    help="Residual error that a correction may leave: rms length over the box, best-fit frame.",
)  # fmt: skip
@click.option("--instrument", type=click.Choice(METHODS), help="Default: the quickest that reaches it.")
@click.option(
    "--points", type=Count(min=8), help="Number of points, with --next of a station. Default: the fewest."
)
@click.option(
    "--next", "next_", type=Count(min=1), metavar="N",
    help="The N points of a tracker, stations of lengths, lines, or targets of lines, that help most now.",
)  # fmt: skip
@click.option(
    "--component", multiple=True, metavar="EXX",
    help="With --next of lines and targets: an error that you can read; repeat it. Default: all but ECZ.",
)  # fmt: skip
@click.option(
    "--calibration", metavar="CALIBRATION",
    help="What was measured so far, for --next: a calibration with its covariance. Default: nothing.",
)  # fmt: skip
@click.option(
    "--criterion", type=click.Choice(("A", "D")), default="A", show_default=True,
    help="For --next: A lowers the mean square of the error in the box, D the volume of all uncertainty.",
)  # fmt: skip
@click.option(
    "--box", type=(MM, MM, MM, MM, MM, MM), metavar="X X Y Y Z Z",
    help="Axis positions between which to measure. Default: the travel less 1 % at each end.",
)  # fmt: skip
@click.option(
    "--among", metavar="FILE.csv",
    help="With rotary joints: postures that the machine can take. Default: random ones within its travel.",
)  # fmt: skip
@reflector_option(
    "Vector from the gauge point to a reflector in mm; three that are not on one line suffice.", several=True
)
@sigma_option("Standard uncertainty of a tracker's coordinate.  [default: 8]")
@click.option("--period-x", type=Length(), multiple=True, help="Period of the screw or scale of X in mm.")
@click.option("--period-y", type=Length(), multiple=True, help="The same of Y.")
@click.option("--period-z", type=Length(), multiple=True, help="The same of Z.")
@click.option("--dwell-s", type=Length(), help="Time of a reading; default by instrument.")
@click.option("--settle-s", type=Length(), default=1.0, show_default=True, help="Time to settle before it.")
@output_option("FOLDER", "Write the plan, CSV files to fill in, and programs.")
@day_option("Day of measuring, for the plan.")
@json_option()
@units_option
@fail_on_option
@quiet_option("No table.")
@force_option("files in FOLDER")
def command(
    machine: str,
    next_: int | None,
    among: str | None,
    reflector: tuple[tuple[float, float, float], ...],
    sigma_um: float | None,
    criterion: Literal["A", "D"],
    output: str | None,
    date: datetime.date | None,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
    **measuring: Any,
) -> None:
    """Propose what to measure, before you measure.

    Compares methods: the time they take, and the residual error of a correction made from them, by the
    covariance of the adjustment. FOLDER gets measurements.toml, CSV files whose readings are still empty, and
    a program for each run of the machine: machine coordinates, a dwell at each point.

    With --next it names single readings, each chosen by what the earlier ones leave unknown. Measure them,
    then fit all readings together, or refine the calibration with them, and ask again.
    """
    from pathlib import Path

    from olp.cli import joints
    from olp.files.write import write_files

    if joints.on_joints(machine, None, also=("next_", "criterion", "among", "reflector", "sigma_um")):
        if next_ is None or len(reflector) > 1:
            raise UsageError("a machine with rotary joints takes --next N, and one --reflector")
        poses = joints.plan(machine, next_, output, among, reflector, sigma_um, criterion, force=force)
        put_result(poses, as_json=as_json, quiet=quiet)
        return
    if among is not None:
        raise UsageError("--among is for machines with rotary joints; leave it out")
    if output is not None and not Path(output).is_dir():
        raise UsageError("is not a folder; create it first", file=output)
    plan = _of_linear_axes(machine, next_, criterion, date, tools=reflector, sigma_um=sigma_um, **measuring)
    if output is not None:
        inputs = (*plan.inputs, *files_of(machine))
        files = plan.files(output, date)
        refuse_early([str(name) for name in files], inputs, force=force)
        write_files(files, force=force, inputs=inputs)
        diagnostic(f"wrote {len(files)} files to {output}")
    put_result(plan, as_json=as_json, quiet=quiet)
    exit_for(plan.findings, fail_on)


def _of_linear_axes(
    machine: str, next_: int | None, criterion: Literal["A", "D"], date: datetime.date | None, *,
    instrument: str | None, calibration: str | None, component: tuple[str, ...],
    box: tuple[float, float, float, float, float, float] | None,
    period_x: tuple[float, ...], period_y: tuple[float, ...], period_z: tuple[float, ...], **shared: Any,
) -> Any:  # fmt: skip
    """The plan of a machine with three linear axes, or the next readings of it. Raises UsageError for options
    that do not belong together."""
    from olp.workflows.calibrate_next import NEXT, plan_next
    from olp.workflows.calibrate_plan import INSTRUMENTS, plan_measurements

    periods_mm = (period_x, period_y, period_z)
    shared["box_mm"] = None if box is None else (box[0:2], box[2:4], box[4:6])
    if next_ is None:
        if calibration is not None or criterion != "A" or component or instrument == "targets":
            raise UsageError("--calibration, --criterion, --component and targets are for --next N; add it")
        known = next((name for name in INSTRUMENTS if name == instrument), None)
        return plan_measurements(machine, instrument=known, periods_mm=periods_mm, **shared)
    if any(periods_mm) or instrument not in (None, *NEXT):
        raise UsageError(f"--next chooses for {', '.join(NEXT)}, and without --period-x, -y and -z")
    if component and instrument not in (None, "lines", "targets"):
        raise UsageError(f"--component is for lines and targets, not for {instrument}")
    offered = next((name for name in NEXT if name == instrument), None)
    return plan_next(
        machine, next_, instrument=offered, calibration=calibration, criterion=criterion,
        components=component, date=date, **shared,
    )  # fmt: skip
