"""`init`: the first files of a new machine, from what is stated of it."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import field, replace

import numpy as np

from olp.core.errors import UsageError
from olp.core.machine import Machine, Setup, Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.errormodel.known import KnownErrors
from olp.files import starter
from olp.files.machine_settings.base import Settings
from olp.files.machine_settings.registry import read_settings
from olp.files.sources import Sources
from olp.program.rs274.first_program import first_program
from olp.program.rs274.profiles.base import Profile
from olp.workflows.session import Session

#: Travel of a small machine in mm, where none is stated and nothing was measured.
TRAVEL_MM = {"X": (0.0, 500.0), "Y": (0.0, 400.0), "Z": (-300.0, 0.0)}
#: The chain and the control where they are not stated.
CHAIN = "FXYZ"
CONTROLLER = "linuxcnc"
#: File name of the first program, without its ending.
FIRST = "first"


@dataclass(frozen=True, slots=True)
class InitOptions:
    """What a person states of a machine; None and absent axes are left to the settings of the control.

    `known` are errors that the person knows as numbers, `measured` is their day.
    """

    name: str | None = None
    chain: str | None = None
    controller: str | None = None
    travel_mm: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    zero_mm: Vector | None = None
    known: KnownErrors = field(default_factory=KnownErrors)
    measured: datetime.date | None = None


@dataclass(frozen=True, slots=True)
class FirstFiles:
    """The machine, its files by name, and notes on what is assumed, one sentence each."""

    machine: Machine
    files: Mapping[str, bytes]
    notes: tuple[str, ...]


def settings_in(file: str, sources: Sources | None = None) -> Settings:
    """What the configuration of a control states. Raises InputError where it is none that is known."""
    return read_settings(file, (sources or Sources()).read)


def stated_travel(options: InitOptions, settings: Settings | None) -> dict[str, tuple[float, float]]:
    """The travels that a person or a file states, in mm; the person's count."""
    own = {} if settings is None else {a: s.travel_mm for a, s in settings.axes.items() if s.travel_mm}
    return own | dict(options.travel_mm)


def run(folder: str, options: InitOptions, settings: Settings | None = None) -> FirstFiles:
    """The files of a machine that would go into a folder of that name. Raises UsageError for what has to be
    stated, and is not."""
    notes = [] if settings is None else list(settings.notes)
    travel = _travel(options, settings, notes)
    controller = options.controller or (CONTROLLER if settings is None else settings.controller)
    if options.chain is None:
        notes.append(f"The chain {CHAIN} is assumed: no axis moves the workpiece. State yours with --chain.")
    if options.zero_mm is None and not (settings and settings.work_offsets):
        notes.append("G54 is the middle of the travel: put the offsets there that your control shows.")
    if not (settings and settings.tools):
        notes.append("Tool 1 is taken as 100 mm long: put the tools there that your control shows.")
    if not options.known:
        notes.append(
            "The calibration holds zeros, and olp correct refuses it: make one with olp calibrate fit, or "
            "put measured errors and their date there."
        )
    machine = starter.starter_machine(
        options.name or _name(settings, folder), options.chain or CHAIN, travel, controller,
        settings=settings, zero_mm=options.zero_mm,
    )  # fmt: skip
    program, ending = _first(machine, notes)
    name = f"{FIRST if program else 'part'}.{ending}"
    texts = starter.starter_set(machine, _known(options, machine), notes, name)
    files = {file: text.encode() for file, text in texts.items()}
    return FirstFiles(machine, files | ({name: program} if program else {}), tuple(notes))


def _name(settings: Settings | None, folder: str) -> str:
    return (settings.name if settings is not None else "") or folder or "machine"


def _travel(
    options: InitOptions, settings: Settings | None, notes: list[str]
) -> dict[str, tuple[float, float]]:
    stated = stated_travel(options, settings)
    missing = [axis for axis in AXES if axis not in stated]
    if not missing:
        return stated
    words = " ".join(f"--travel {axis} MIN MAX" for axis in missing)
    if settings is not None:
        raise UsageError(f"the settings state no travel of {', '.join(missing)}; state it with {words}")
    if options.known:
        raise UsageError(f"measured errors need the travel that they hold for; state it with {words}")
    notes.append(f"The travel of {', '.join(missing)} is only an example: put that of your machine there.")
    return TRAVEL_MM | stated


def _known(options: InitOptions, machine: Machine) -> Calibration | None:
    """The calibration of the numbers that a person knows: it covers the whole travel."""
    if not options.known:
        return None
    if options.measured is None:
        raise UsageError("measured errors need their day; state it with --measured, such as --measured today")
    travel = np.array([machine.axes[axis].travel_mm for axis in AXES])
    return replace(options.known.calibration(machine.name, travel), measured=options.measured)


def _first(machine: Machine, notes: list[str]) -> tuple[bytes | None, str]:
    """The first program for a control, and the ending of its file; a note where there is none."""
    control = Session(Setup(machine)).control()
    if not isinstance(control, Profile):
        notes.append(f"No first program is written for {control.title}: take one of your own.")
        return None, control.signs.endings[0] if control.signs.endings else "nc"
    program = first_program(control, machine, machine.default_work_offset)
    if program is None:
        notes.append("No first program is written: the travel is too short, or the work offset is turned.")
    return program, control.written_ending
