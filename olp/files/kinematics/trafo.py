"""A machine file from a file of a control that sets its kinematics."""

from __future__ import annotations

from olp.files.kinematics.hal import machine_of_hal
from olp.files.kinematics.siemens import has_vectors, machine_of_vectors
from olp.files.kinematics.written import Written
from olp.files.write import PathLike, read_bytes


def machine_of_trafo(path: PathLike, name: str, controller: str | None = None) -> Written:
    """The machine file of a HAL file of LinuxCNC, or of the vectors of a Sinumerik control. Raises InputError
    where it is neither, or leaves something out."""
    vectors = has_vectors(read_bytes(path).decode("latin-1"))
    return (machine_of_vectors if vectors else machine_of_hal)(path, name, controller)
