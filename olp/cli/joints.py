"""What the verbs do where the machine has rotary joints: the same options, as far as they are built for
it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from olp.cli.common import (
    DIALECT,
    KNOWN,
    STREAM,
    default_output,
    diagnostic,
    exit_for,
    files_of,
    options_of,
    put,
    refuse_early,
    refuse_twice,
    source,
    sources_of_call,
    takes_colour,
)
from olp.core.errors import InputError, UsageError

if TYPE_CHECKING:
    from olp.calibration.design.choosing import Criterion
    from olp.core.progress import Progress
    from olp.files.write import Content
    from olp.review.job import Review
    from olp.workflows.calibrate_plan_joints import PlannedPoses
    from olp.workflows.compare import CompareOptions, Comparison
    from olp.workflows.joints.loaded import JointRun
    from olp.workflows.joints.retime import JointRetiming

#: Words of a call that every verb takes on such a machine.
ALWAYS = ("program", "programs", "nominal", "corrected", "machine", "job", "dialect", "flatten",
           "expand_cycles", "peck_clearance_mm", "output", "tolerance_um", "tolerance_urad", "outside_box",
           "date", "accept", "fail_on", "as_json", "quiet", "force", "step_mm",
           "part_tolerance_um")  # fmt: skip


#: What `olp correct` takes beside these.
CORRECT = ("report_file", "review_file", "times", "show_diff")

#: What `olp check` takes beside these.
CHECK = ("select", "ignore", "form")

#: What `olp retime` takes beside these.
RETIME = (
    "kind", "cycle_ms", "blend_mm", "blend_study", "report_file", "feed_override", "gains", "plot",
    "plot_span", "stretch", "lines", "slow", "write_feed", "shared_feed", "block_delete",
)  # fmt: skip

#: What `olp view` takes.
VIEW = ("live", "port", "no_time", "measured")


_LOG = (
    "a log of axis values is a list of positions there; olp simulate LOG.csv makes tips of it, with the "
    "machine's errors, and olp compare takes these"
)
#: Why an option is not for such machines, and how to go on, by its word.
WHY_NOT = {
    "add_errors": _LOG,
    "at": "their position is more than X, Y and Z; show a place of the machine file with --axes, such as "
          "--axes C=30",
    "axes": "a program has many positions; name the machine file alone, as in "
            "olp inspect machine.toml --axes C=30",
    "clearances": "clearances are those of three linear axes; a simulation of the cell checks collisions",
    "columns": "a list names its columns in its first line, as axes with units, such as X_mm,C_deg",
    "contour": "there the path of a contour is not known; program the path of the tool without G41 and G42",
    "controller": (
        "the planners that are known are those of three linear axes; the report has the time at the limits "
        "of the axes"
    ),
    "frame_name": "work offsets turn with the table there; set the frame at the control",
    "log": "controls are timed for three linear axes; leave it out",
    "log_profile": "controls are timed for three linear axes; leave it out",
    "max_inertial_um": (
        "compliance to accelerations is stated for three linear axes; lower the accelerations in the machine "
        "file"
    ),
    "only_sure_components": (
        "their calibration is one fit, whose errors belong together; the report states what is not known "
        "as an uncertainty of poses"
    ),
    "part_frame": "work offsets turn with the table there; set the frame at the control",
    "plot": "the curves are those of the machine; name the machine file alone, as in "
            "olp inspect machine.toml --plot curves.svg",
    "positions": _LOG,
    "program": "readings are a plan, not a run of a program; leave it out",
    "profile": "a list names its columns in its first line, as axes with units, such as X_mm,C_deg",
    "proof": "the budget of accelerations is that of three linear axes; leave it out",
    "reflector": "the plan of readings states where reflectors sit; leave it out",
    "settings": "controls are timed for three linear axes; leave it out",
    "sigma_um": "the plan of readings states its sigma_um; leave it out",
    "split_rapids": "rapids are driven from end to end; program a feed move where the way counts",
    "tool": "a program states its tools; name the machine file alone, with --axes",
    "unit": "a list names its columns in its first line with units, such as X_mm,C_deg",
}  # fmt: skip


#: Said of the options of other verbs.
_OTHER = "it is about three linear axes; leave it out"


def on_joints(machine: str | None, job: str | None, also: Collection[str] = ()) -> bool:
    """Whether the machine of a call has rotary joints. Raises UsageError for --tolerance-urad elsewhere, and
    for options that are not built for such a machine: a verb takes some `also`."""
    context = click.get_current_context()
    given = [
        name for name in context.params if context.get_parameter_source(name) is ParameterSource.COMMANDLINE
    ]
    if context.meta.get(KNOWN) or not _is_of_joints(machine, job):
        if "tolerance_urad" in given:
            raise UsageError("--tolerance-urad is for machines with rotary joints; leave it out")
        return False
    wrong = [name for name in given if name not in ALWAYS and name not in also]
    if wrong:
        option = next(p for p in context.command.params if p.name == wrong[0])
        raise UsageError(
            f"{option.opts[0]} is not for machines with rotary joints: {WHY_NOT.get(wrong[0], _OTHER)}"
        )
    return True


def refuse_joints(machine: str | None, job: str | None, why: str) -> None:
    """Raises UsageError, which says `why`, where the machine of a call has rotary joints."""
    if not click.get_current_context().meta.get(KNOWN) and _is_of_joints(machine, job):
        raise UsageError(f"the machine has rotary joints: {why}")


def _is_of_joints(machine: str | None, job: str | None) -> bool:
    from olp.files.config import have_joints

    return have_joints(machine, job, sources_of_call().read)


def run_of(program: str | None, machine: str | None, job: str | None) -> JointRun:
    """What a call is about."""
    from olp.workflows.joints.loaded import JointRun

    sources = sources_of_call()
    if program is not None and program != STREAM and Path(program).is_dir():
        raise InputError("is a folder; expected a program in it", file=program)
    given = None if program is None else source(sources, program)
    dialect = click.get_current_context().meta.get(DIALECT)
    return JointRun.of(given, machine, job, dialect=dialect, sources=sources)


def correct(program: str | None, machine: str | None, job: str | None, words: dict[str, Any]) -> None:
    """`olp correct`."""
    run = run_of(program, machine, job)
    name = program or run.program.name
    output = words["output"] or default_output(name)
    if words["as_json"] and (output == STREAM or words["show_diff"]):
        raise UsageError("JSON on stdout excludes -o - and --diff; write the report to a file with --report")
    report_file, review_file = words["report_file"], words["review_file"]
    if review_file == STREAM:
        raise UsageError("--review writes a file and cannot be -; name a file, or use olp view -o -")
    refuse_twice(files_of(output, report_file, review_file))
    refuse_early(files_of(output, report_file, review_file), run.files, force=words["force"])

    from olp.files.write import write_files
    from olp.reports.report import to_json
    from olp.workflows.joints.correct import JointCorrection, JointOptions, correction_of
    from olp.workflows.joints.report import filed

    options = options_of(JointOptions, words)
    done = correction_of(run, options)
    if options.times or report_file is not None:
        from olp.workflows.joints import correct_time

        if options.times:
            done.report["time"] = correct_time.times(run, done)
        correct_time.with_time(run, done)
    result = JointCorrection.of(run, done)
    written: dict[Path, Content] = {Path(file): result.data for file in files_of(output)}
    written |= {Path(file): filed(result.report, file, words["date"]) for file in files_of(report_file)}
    if review_file is not None:
        from olp.review.joints import page_of
        from olp.workflows.correct_time import timed

        time = timed(len(done.nominal), asked=options.times)
        written[Path(review_file)] = page_of(run, done, options, output, time=time).parts()
    write_files(written, force=words["force"], inputs=run.files)
    if output == STREAM:
        put(result.data)
    if words["show_diff"]:
        from olp.cli.joint_diff import render

        colour = takes_colour(sys.stderr if output == STREAM else sys.stdout)
        put(render(done, colour=colour), err=output == STREAM)
    if words["as_json"] or report_file == STREAM:
        put(to_json(result.report))
    elif not words["quiet"]:
        put(result.to_text(), err=output == STREAM)
    if not words["quiet"]:
        for file in written:
            diagnostic(f"wrote {file}")
    exit_for(result.findings, words["fail_on"])


def verify(nominal: str, corrected: str, machine: str | None, job: str | None, words: dict[str, Any]) -> None:
    """`olp verify`."""
    run = run_of(nominal, machine, job)

    from olp.reports.report import to_json
    from olp.workflows.joints.correct import JointOptions
    from olp.workflows.joints.verify import verified

    result = verified(run, source(run.sources, corrected), options_of(JointOptions, words))
    if words["as_json"]:
        put(to_json(result.report))
    elif not words["quiet"]:
        put(result.to_text())
    exit_for(result.findings, words["fail_on"])


def check(program: str | None, machine: str | None, job: str | None, words: dict[str, Any]) -> None:
    """`olp check` of one program: it is corrected in memory, or proved against its nominal one."""
    nominal, output, form = words["nominal"], words["output"], words["form"]
    if nominal is not None and program is None:
        raise UsageError("--nominal goes with the corrected program; name that too")
    run = run_of(program if nominal is None else nominal, machine, job)
    inputs = (*run.files, *files_of(program))
    refuse_early(files_of(output), inputs, force=words["force"])

    from olp.files.write import write_files
    from olp.reports.check import FORMATS
    from olp.workflows import refusals
    from olp.workflows.joints.check import JointCheckOptions, examined

    corrected = None if nominal is None or program is None else source(run.sources, program)
    result = examined(run, corrected, options_of(JointCheckOptions, words))
    text = FORMATS[form](result.report, words["fail_on"])
    write_files({Path(name): text.encode() for name in files_of(output)}, force=words["force"], inputs=inputs)
    if output == STREAM and not (words["quiet"] and form == "text"):
        # text for people is in the coding of the console, the other formats in their own
        put(text if form == "text" else text.encode())
    elif output != STREAM and not words["quiet"]:
        diagnostic(f"wrote {output}")
    if result.refused is not None:
        raise refusals.short(result.refused).in_file(
            "<stdin>" if STREAM in (program, nominal) else run.program.name
        )
    exit_for(result.findings, words["fail_on"])


def simulate(
    program: str | None, machine: str | None, job: str | None, output: str | None, step_mm: float,
    words: dict[str, Any],
) -> None:  # fmt: skip
    """`olp simulate`."""
    run = run_of(program, machine, job)
    refuse_early(files_of(output), run.files, force=words["force"])

    from olp.files.write import write_bytes
    from olp.reports.report import to_json
    from olp.workflows.joints.simulate import JointSimulateOptions, simulated

    result = simulated(run, options_of(JointSimulateOptions, words), step_mm)
    if output not in (None, STREAM):
        write_bytes(output, result.to_csv(), force=words["force"], inputs=run.files)
        if not words["quiet"]:
            diagnostic(f"wrote {output}: {len(result.points_mm)} poses in workpiece coordinates")
    if words["as_json"]:
        put(to_json(result.report))
    elif output in (None, STREAM):
        put(result.to_csv())


def retime(
    program: str | None, machine: str | None, job: str | None, words: dict[str, Any]
) -> tuple[Callable[[Progress | None], JointRetiming], tuple[str, ...]]:
    """`olp retime`: what plans the motion, and the files that it reads."""
    run = run_of(program, machine, job)
    nominal = words["nominal"]

    def make(show: Progress | None) -> JointRetiming:
        from olp.workflows.joints.retime import JointRetimeOptions, retimed

        options = options_of(JointRetimeOptions, words | {"study_blend": words["blend_study"]})
        other = None if nominal is None else source(run.sources, nominal)
        return retimed(run, options, show, other)

    return make, (*run.files, *files_of(nominal))


def flatten(
    program: str | None, machine: str | None, job: str | None, words: dict[str, Any]
) -> tuple[Callable[[], bytes], tuple[str, ...]]:
    """`olp flatten`: what unrolls the program, and the files that it reads."""
    run = run_of(program, machine, job)

    def make() -> bytes:
        from olp.workflows.flatten import UnrollOptions

        return run.unrolled(run.program, options_of(UnrollOptions, words))

    return make, run.files


def plan(
    machine: str, count: int, output: str | None, among: str | None,
    reflector: tuple[tuple[float, float, float], ...], sigma_um: float | None, criterion: Criterion, *,
    force: bool,
) -> PlannedPoses:  # fmt: skip
    """`olp calibrate plan --next`, written to the file `output`."""
    from olp.files.write import write_files
    from olp.workflows.calibrate_plan_joints import SIGMA_UM, plan_poses

    refuse_early(files_of(output), files_of(machine, among), force=force)
    result = plan_poses(
        machine, count, reflector_mm=reflector[0] if reflector else (0.0, 0.0, 0.0),
        sigma_um=SIGMA_UM if sigma_um is None else sigma_um, criterion=criterion, among=among,
    )  # fmt: skip
    if output is not None:
        write_files(result.files(output), force=force, inputs=result.inputs)
        diagnostic(f"wrote {output}")
    return result


def view(
    program: str | None, machine: str | None, job: str | None, corrected: str | None,
    measured: Sequence[str], words: dict[str, Any], *, time: bool,
) -> tuple[Callable[[], Review], tuple[str, ...], str]:  # fmt: skip
    """`olp view`: what makes the page, its inputs, and the name of the program."""
    runs = [run_of(program, machine, job)]
    first = runs[0]

    def make() -> Review:
        from olp.review.joints import reviewed
        from olp.workflows.joints.correct import JointOptions

        # files may have changed since the last call
        run = runs.pop() if runs else run_of(program, machine, job)
        second = None if corrected is None else source(run.sources, corrected)
        return reviewed(run, options_of(JointOptions, words), second, measured, time=time)

    meshes = [mesh.file for mesh in first.job.meshes]
    return make, (*first.files, *files_of(corrected, *measured), *meshes), program or first.program.name


def compare(
    nominal: str, measured: Sequence[str], machine: str | None, job: str | None, options: CompareOptions
) -> Comparison:
    """`olp compare`, up to what is written."""
    from olp.workflows.joints.compare import compare_with

    return compare_with(run_of(nominal, machine, job), measured, options)


def inspect(program: str | None, machine: str | None, job: str | None, words: dict[str, Any]) -> None:
    """`olp inspect` of a program."""
    from olp.reports.outline import outline
    from olp.reports.report import plain, to_json
    from olp.workflows.flatten import UnrollOptions
    from olp.workflows.joints.inspect import program_summary

    values = program_summary(run_of(program, machine, job), options_of(UnrollOptions, words))
    put(to_json(values) if words["as_json"] else outline(plain(values)))
