"""`olp init`."""

from __future__ import annotations

import os
from pathlib import Path

import click

from olp.cli.common import diagnostic
from olp.cli.options import NUMBER, force_option
from olp.core.errors import UsageError

#: Travel of a small machine in mm, to be replaced by that of the real one.
TRAVEL_MM = {"X": (0.0, 500.0), "Y": (0.0, 400.0), "Z": (-300.0, 0.0)}

Travel = tuple[tuple[str, float, float], ...]


@click.command("init")
@click.argument("folder", metavar="DIR")
@click.option("--name", help="Name of the machine. Default: the folder's name.")
@click.option("--chain", default="FXYZ", show_default=True, help="Axes from workpiece to tool, F the frame.")
@click.option("--controller", help="Dialect of the control, such as linuxcnc, fanuc, haas or grbl.")
@click.option(
    "--travel",
    type=(click.Choice("XYZ"), NUMBER, NUMBER),
    multiple=True,
    metavar="AXIS MIN MAX",
    help="Travel of an axis in mm, such as --travel X 0 2000; once per axis.",
)
@click.option("--from-linuxcnc", "ini", metavar="INI", help="Take the machine from a LinuxCNC configuration.")
@force_option("files in DIR")
def command(
    folder: str,
    name: str | None,
    chain: str,
    controller: str | None,
    travel: Travel,
    ini: str | None,
    force: bool,
) -> None:
    """Write the first files of a new machine into DIR: machine, calibration of zeros, curves, job."""
    from dataclasses import replace

    from olp.files import starter
    from olp.files.write import make_folder, write_files

    notes: tuple[str, ...] = ()
    if ini is not None:
        if travel or controller:
            raise UsageError("--from-linuxcnc states travel and control; leave out --travel and --controller")
        imported = starter.from_linuxcnc(ini, chain)
        notes = imported.notes
        machine = replace(
            imported.machine, name=name or imported.machine.name, calibration="calibration.toml"
        )
    else:
        limits = TRAVEL_MM | {axis: (low, high) for axis, low, high in travel}
        machine = starter.starter_machine(
            name or Path(os.path.realpath(folder)).name or "machine", chain, limits, controller or "linuxcnc"
        )
    texts = starter.starter_set(machine)
    if notes:
        texts["machine.toml"] = starter.machine_toml(machine, notes)
    make_folder(Path(folder))
    files = {Path(folder) / file: text.encode() for file, text in texts.items()}
    write_files(files, force=force)
    for path in files:
        diagnostic(f"wrote {path}")
    for note in notes:
        diagnostic(f"note: {note}")
