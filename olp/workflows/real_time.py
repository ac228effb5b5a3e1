"""Controls that correct in real time: what is left to correct there, and what must not run on them."""

from __future__ import annotations

from olp.compensation.stamp import find_real_time, find_stamp, is_of, line_of
from olp.core.errors import AlreadyCorrected, ConfigError, ProgramError
from olp.core.machine import Machine
from olp.errormodel.calibration import Calibration
from olp.files.sources import Source


def corrected(machine: Machine, calibration: Calibration, digest: str) -> Calibration:
    """What remains of a calibration whose errors the control takes off in every servo cycle: its box. Raises
    ConfigError where the control does so by another calibration."""
    from olp.files.real_time import refuse_other

    assert machine.real_time is not None
    refuse_other(machine.real_time, digest, machine.calibration)
    return Calibration(
        calibration.machine, calibration.box_mm, datum_mm=calibration.datum_mm,
        payload_kg=calibration.payload_kg, temperature_degC=calibration.temperature_degC,
        measured=calibration.measured, valid_until=calibration.valid_until,
    )  # fmt: skip


def refuse_stamped(real_time: str | None, digest: str, program: Source) -> None:
    """Raises AlreadyCorrected for a program that was corrected, on a control that corrects too; ProgramError
    for one that needs a control which corrects by its calibration, on another."""
    data = program.data
    if real_time is not None and (stamp := find_stamp(data)) is not None:
        raise AlreadyCorrected(
            f"the program has the stamp `{stamp.group().decode()}` of a correction. The control corrects in "
            f'real time too (real_time = "{real_time}"): both would apply the model twice; run the '
            "nominal program, or switch the correction of the control off and leave real_time out",
            line=line_of(data, stamp),
            code="OLP560",
        )
    needs = find_real_time(data)
    if needs is not None and (real_time is None or not is_of(needs, digest)):
        raise ProgramError(
            f"the program has the stamp `{needs.group().decode()}`: it needs a control that corrects by this "
            "calibration in real time. The machine file does not state that (real_time); correct the program "
            "without the stamp, or state what the control does",
            line=line_of(data, needs),
            code="OLP560",
        )


def refuse_correcting(machine: Machine) -> None:
    """Raises ConfigError where results would be corrected of a control that corrects too."""
    if machine.real_time is not None:
        raise ConfigError(
            f'real_time = "{machine.real_time}": the control corrects in real time, so its results hold no '
            "error that the model knows; leave real_time out where they were measured without it"
        )
