"""`olp init`."""

from __future__ import annotations

import datetime
import os
import sys
from pathlib import Path

import click

from olp.cli.common import KNOWN, diagnostic, is_terminal
from olp.cli.options import MM, day_option, force_option, known_errors, renamed_option
from olp.core.errors import UsageError

Travel = tuple[tuple[str, float, float], ...]


@click.command("init")
@click.argument("folder", metavar="DIR")
@click.option("--from", "settings_file", metavar="FILE", help="Settings of the control: LinuxCNC, Grbl ...")
@click.option("--urdf", metavar="FILE", help="A robot description in URDF: write its machine file alone.")
@click.option("--tip", metavar="LINK", help="The last link of the chain in the URDF file.")
@click.option(
    "--structure",
    metavar="NAME",
    help="Such as trunnion-ac, head-head, scara, arm-6, hexapod: an example of its machine file.",
)
@click.option(
    "--mdh",
    metavar="FILE",
    help="Modified Denavit-Hartenberg parameters of an arm as CSV: write its machine file alone.",
)
@click.option(
    "--trafo",
    metavar="FILE",
    help="Kinematics of a control: a HAL or INI file of LinuxCNC, or vectors of a Sinumerik ($TC_CARR or "
    "$MC_TRAFO5). Write the machine file alone.",
)
@click.option("--name", help="Name of the machine. Default: that in FILE, or the folder's name.")
@click.option("--chain", help="Axes from workpiece to tool, F the frame. Default: FXYZ.")
@click.option("--controller", help="Dialect of the control, such as linuxcnc, fanuc, haas or grbl.")
@click.option(
    "--travel",
    type=(click.Choice("XYZ"), MM, MM),
    multiple=True,
    metavar="AXIS MIN MAX",
    help="Travel of an axis in mm, such as --travel X 0 2000 or X 0 80in; once per axis.",
)
@click.option(
    "--zero", type=(MM, MM, MM), metavar="X Y Z",
    help="Axis positions of the program's zero (G54). Default: the middle of the travel.",
)  # fmt: skip
@known_errors("Known error: ")
@day_option("When these were measured, or today.", "--measured")
@renamed_option("--from-linuxcnc", "--from")
@force_option("files in DIR")
def command(
    folder: str,
    settings_file: str | None,
    urdf: str | None,
    tip: str | None,
    structure: str | None,
    mdh: str | None,
    trafo: str | None,
    name: str | None,
    chain: str | None,
    controller: str | None,
    travel: Travel,
    zero: tuple[float, float, float] | None,
    measured: datetime.date | None,
    force: bool,
) -> None:
    """Write the first files of a new machine into DIR: machine, calibration, job, a first program.

    FILE is the INI file of LinuxCNC, the answer of Grbl to $$ or of Marlin to M503, the printer.cfg of
    Klipper, or machine data of a Sinumerik or a TNC as text. What neither FILE nor an option states is asked
    on a terminal, and else noted in the files.
    """
    from olp.errormodel.known import KnownErrors
    from olp.files.write import check_targets, make_folder, write_files
    from olp.workflows import init

    sources = {"--urdf": urdf, "--structure": structure, "--mdh": mdh, "--trafo": trafo}
    given = [option for option, value in sources.items() if value is not None]
    if given or tip is not None:
        if chain is not None or travel or zero is not None or settings_file is not None:
            raise UsageError(
                f"{(given or ['--tip'])[0]} states chain and travel; leave out --from, --chain, --travel and "
                "--zero"
            )
        if len(given) != 1:
            raise UsageError(
                f"{' and '.join(given)} each describe a machine; expected one of them"
                if given
                else "--tip belongs to --urdf; name the file of the robot"
            )
        if tip is not None and urdf is None:
            raise UsageError("--tip belongs to --urdf; name the file of the robot")
        _of_joints(folder, given[0], str(sources[given[0]]), tip, name, controller, force=force)
        return
    settings = None if settings_file is None else init.settings_in(settings_file)
    limits = {axis: (low, high) for axis, low, high in travel}
    known = KnownErrors.of(**click.get_current_context().meta.get(KNOWN, {}))
    options = init.InitOptions(name, chain, controller, limits, zero, known, measured)
    if is_terminal(sys.stdin) and is_terminal(sys.stderr):
        from olp.cli.asking import asked

        options = asked(options, settings)
    result = init.run(Path(os.path.realpath(folder)).name, options, settings)
    files = {Path(folder) / file: data for file, data in result.files.items()}
    inputs = [] if settings_file is None else [settings_file]
    check_targets(files, inputs, force=force, new_folders=True)
    for place in dict.fromkeys(path.parent for path in files):
        make_folder(place)
    write_files(files, force=force, inputs=inputs)
    for path in files:
        diagnostic(f"wrote {path}")
    for note in result.notes:
        diagnostic(f"note: {note}")


def _of_joints(
    folder: str,
    option: str,
    value: str,
    tip: str | None,
    name: str | None,
    controller: str | None,
    *,
    force: bool,
) -> None:
    """Write the machine file of a machine of any joints, which `option` describes. Raises UsageError,
    InputError, ConfigError."""
    from olp.files.fields import CONTROLLER_NAMES, unknown_dialect
    from olp.files.kinematics.mdh import machine_of_mdh
    from olp.files.kinematics.structures import machine_of_structure
    from olp.files.kinematics.trafo import machine_of_trafo
    from olp.files.kinematics.urdf import machine_of_urdf
    from olp.files.write import check_targets, make_folder, write_files

    if click.get_current_context().meta.get(KNOWN, {}):
        raise UsageError("--skew, --scale and --backlash are of three linear axes; leave them out")
    if controller is not None and controller not in CONTROLLER_NAMES:
        raise UsageError(f"--controller {unknown_dialect(controller)}")
    title = name or Path(os.path.realpath(folder)).name or "machine"
    if option == "--urdf":
        made = machine_of_urdf(value, tip, name, controller)
    elif option == "--mdh":
        made = machine_of_mdh(value, title, controller)
    elif option == "--trafo":
        made = machine_of_trafo(value, title, controller)
    else:
        made = machine_of_structure(value, title, controller)
    inputs = [] if option == "--structure" else [value]
    files = {Path(folder) / "machine.toml": made.data}
    check_targets(files, inputs, force=force, new_folders=True)
    make_folder(Path(folder))
    write_files(files, force=force, inputs=inputs)
    diagnostic(f"wrote {Path(folder) / 'machine.toml'}")
    for note in made.notes:
        diagnostic(f"note: {note}")
