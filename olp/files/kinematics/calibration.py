"""Reads the calibration of a machine of any joints: what files state as errors of joints and bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np

from olp.core.errors import ConfigError, InputError
from olp.core.interpolation import Interpolant
from olp.core.machine import Vector
from olp.core.units import MM_PER_UM, shifted
from olp.files.kinematics.calibration_schema import (
    ElasticityTable,
    HarmonicTable,
    JointCalibrationFile,
    JointCurveTable,
    LocationTable,
)
from olp.files.kinematics.curves import component_of, in_base, read_motions, unit_of
from olp.files.problems import Problem, config_error, validate
from olp.files.toml_text import Path, line_of, read_toml
from olp.files.write import PathLike, Reader, read_bytes
from olp.kinematics.errors import (
    OWN,
    Gravity,
    Harmonic,
    JointErrors,
    LegErrors,
    MachineErrors,
    Mass,
    MotionCurve,
    Payload,
    Yield,
)
from olp.kinematics.machine import JointCalibration
from olp.kinematics.structure import FRAME, Joint, Structure
from olp.kinematics.weight import gravity_problems

#: Squareness errors by the name of ISO 230-1: the axis that they tilt, and the key of its location.
_SQUARE = {"C0Y": ("Y", "C_urad"), "B0Z": ("Z", "B_urad"), "A0Z": ("Z", "A_urad")}
#: um per kN as a power of ten of mm per N: 1e-3 mm per um, 1e-3 kN per N.
_UM_KN = -6
#: Nothing is held.
NO_PAYLOAD = Payload()
#: Ends of a periodic curve agree within this, mm or rad.
_SAME_END = 1e-9


def load_joint_calibration(
    path: PathLike, structure: Structure, payload: Payload = NO_PAYLOAD, read: Reader = read_bytes
) -> JointCalibration:
    """The calibration of a machine of any joints, with the payload of the job. Raises InputError where a file
    cannot be read, and ConfigError with all that is wrong."""
    values, lines = read_toml(read(path), str(path))
    file = validate(JointCalibrationFile, values, lines, str(path))
    reading = _Reading(structure, file, path, lines, read)
    errors = reading.errors(payload)
    reading.finish()
    return JointCalibration(
        errors,
        reading.box(),
        file.measured,
        file.valid_until,
        file.temperature_degC,
        file.datum_mm,
        file.covariance.growth_per_year,
        Payload(file.payload_kg, file.payload_centre_mm),
        file.covariance.misfit_um * MM_PER_UM,
    )


class _Reading:
    """A calibration while it is read; it collects what is wrong."""

    def __init__(
        self,
        structure: Structure,
        file: JointCalibrationFile,
        path: PathLike,
        lines: Mapping[Path, int],
        read: Reader,
    ) -> None:
        self._structure, self._file, self._path = structure, file, path
        self._lines, self._read = lines, read
        self._problems: list[Problem] = []
        if file.machine != structure.name:
            self._wrong(("machine",), f'machine = "{file.machine}" is not "{structure.name}" of the machine')

    def finish(self) -> None:
        """Raises ConfigError where anything was wrong."""
        for key in self._file.box:
            if key not in self._box_keys():
                expected = ", ".join(self._box_keys())
                self._wrong(("box", key), f"box.{key} is no axis of the machine; expected {expected}")
        for key in self._box_keys():
            if key not in self._file.box:
                self._wrong(("box",), f"box states no {key}; expected the calibrated values of every axis")
        if self._problems:
            raise config_error(self._problems, str(self._path))

    def box(self) -> dict[str, tuple[float, float]]:
        return {name: self._file.box[key] for key, name in self._box_keys().items()}

    def _box_keys(self) -> dict[str, str]:
        return {f"{joint.name}_{joint.unit}": name for name, joint in self._structure.joints.items()}

    def _wrong(self, key: Path, sentence: str) -> None:
        self._problems.append((line_of(key, self._lines), sentence))

    def errors(self, payload: Payload) -> MachineErrors:
        file, structure = self._file, self._structure
        joints = {name: self._located(name, joint) for name, joint in structure.joints.items()}
        for index, curve in enumerate(file.curves):
            self._curve(index, curve, joints)
        for index, harmonic in enumerate(file.cyclic):
            self._harmonic(index, harmonic, joints)
        self._backlash(joints)
        gauge = file.location.get("gauge", LocationTable())
        for name in file.location:
            if name != "gauge" and name not in joints:
                self._wrong(("location", name), f"location.{name} is no axis of the machine, nor the gauge")
        legs = {}
        for index, leg in enumerate(file.legs):
            platform = structure.platforms.get(leg.platform)
            if platform is None or leg.leg > len(platform.legs):
                self._wrong(("legs", index), f"legs[{index}] names a leg that the machine does not have")
            legs[leg.platform, leg.leg - 1] = LegErrors(
                _mm(leg.base_um), _mm(leg.platform_um), shifted(leg.length_um, -3)
            )
        errors = MachineErrors(
            joints=joints,
            gauge_shift_mm=_shift(gauge),
            gauge_tilt_rad=_tilt(gauge),
            legs=legs,
            yields=dict(self._yields()),
            masses=tuple(self._masses()),
            payload=payload,
            gravity=tuple(self._gravity()),
        )
        if file.payload_kg and errors.yields:
            self._wrong(
                ("payload_kg",),
                "payload_kg stands beside [elasticity], by which each payload acts in full; leave it out",
            )
        for index, sentence in gravity_problems(structure, errors):
            self._wrong(("gravity", index, "angles"), sentence)
        return errors

    def _located(self, name: str, joint: Joint) -> JointErrors:
        """Where the line of an axis really is."""
        table = self._file.location.get(name, LocationTable())
        stated = {key: value for key, value in vars(table).items() if value is not None}
        for square, (axis, key) in _SQUARE.items():
            value = vars(self._file.squareness)[f"{square}_urad"]
            if axis != name or value is None:
                continue
            if key in stated:
                self._wrong(("location", name, key), f"location.{name}.{key} and squareness {square} are one")
            stated[key] = value
        direction = np.array(joint.direction)
        zero = "zero_urad" if joint.kind == "rotary" else "zero_um"
        for key in stated:
            if key.startswith("zero") and key != zero:
                self._wrong(("location", name, key), f"location.{name}.{key}: expected {zero} of this axis")
            elif not key.startswith("zero") and abs(direction["XYZABC".index(key[0]) % 3]) > 1.0 - 1e-9:
                self._wrong(
                    ("location", name, key),
                    f"location.{name}.{key} is along or about the axis itself; expected {zero}",
                )
        if joint.kind != "rotary" and any(key in stated for key in ("X_um", "Y_um", "Z_um")):
            self._wrong(
                ("location", name),
                f"location.{name} shifts the line of a linear axis, which changes nothing; expected tilts",
            )
        table = LocationTable(**stated)
        shift, tilt = np.array(_shift(table)), np.array(_tilt(table))
        tilt = tilt - direction * (direction @ tilt)
        return JointErrors(
            point_mm=joint.point_mm,
            shift_mm=_vector(shift),
            tilt_rad=_vector(tilt),
            zero=in_base(stated.get(zero, 0.0), zero.removeprefix("zero_")),
            datum=float(direction @ np.array(self._file.datum_mm)),
        )

    def _curve(self, index: int, table: JointCurveTable, joints: dict[str, JointErrors]) -> None:
        key: Path = ("curves", index, "file")
        where = FilePath(self._path).parent / table.file
        try:
            name, values, motions = read_motions(where, self._structure, self._read)
        except ConfigError as error:
            self._problems += [(None, f"{where}: {problem}") for problem in error.problems]
            return
        except InputError as error:
            self._wrong(key, f'curves[{index}].file = "{table.file}": {error.message}')
            return
        joint = self._structure.joints[name]
        if table.periodic:
            if joint.kind != "rotary" or abs(values[-1] - values[0] - 360.0) > 1e-9:
                self._wrong(key, f"curves[{index}] is periodic; expected values over 360 degrees of an axis")
            elif np.any(np.abs(motions[-1] - motions[0]) > _SAME_END):
                self._wrong(key, f"curves[{index}] is periodic; expected the same errors at both ends")
        on_table = name in self._structure.workpiece_side
        follows = joint.kind == "linear" and on_table and table.point_mm is None
        follows = follows and table.reference == "functional-point"
        curve = MotionCurve(
            Interpolant.through(values, motions, table.interpolation),
            self._functional_point(index, name, table),
            follows,
            table.periodic,
        )
        joints[name] = replace(joints[name], curves=(*joints[name].curves, curve))

    def _functional_point(self, index: int, name: str, table: JointCurveTable) -> Vector:
        structure, joint = self._structure, self._structure.joints[name]
        if table.point_mm is not None or joint.kind != "linear" or name not in structure.chain:
            return table.point_mm or joint.point_mm
        line = table.line_mm or {}
        unknown = sorted(line.keys() - structure.joints.keys())
        if unknown:
            self._wrong(
                ("curves", index, "line_mm"),
                f"curves[{index}].line_mm names {', '.join(unknown)}; expected linear axes of the machine",
            )
        datum = np.array(self._file.datum_mm)
        point = np.array(structure.gauge.point_mm) + table.tool_mm
        for other in structure.chain[structure.chain.index(name) + 1 :]:
            if other != FRAME and other in structure.joints:
                direction = np.array(structure.joints[other].direction)
                if structure.joints[other].kind == "linear":
                    point = point + line.get(other, float(direction @ datum)) * direction
        if table.reference == "table" and name in structure.workpiece_side:
            direction = np.array(joint.direction)
            point = point + float(direction @ datum) * direction
        return _vector(point)

    def _harmonic(self, index: int, table: HarmonicTable, joints: dict[str, JointErrors]) -> None:
        key: Path = ("cyclic", index, "component")
        owner = [
            name for name in joints if table.component[2:] == name or table.component == f"E{name}{name}"
        ]
        joint = self._structure.joints[owner[0]] if owner else None
        component = component_of(table.component, joint) if joint else "expected an error of an axis"
        if joint is None or isinstance(component, str):
            self._wrong(key, f'cyclic[{index}].component = "{table.component}"; {component}')
            return
        unit = unit_of(component, joint)
        period = table.period_deg if joint.unit == "deg" else table.period_mm
        amplitude = table.amplitude_urad if unit == "urad" else table.amplitude_um
        given = sum(v is not None for v in (table.period_deg, table.period_mm))
        given += sum(v is not None for v in (table.amplitude_urad, table.amplitude_um))
        if period is None or amplitude is None or given != 2:
            self._wrong(
                key, f"cyclic[{index}]: expected period_{joint.unit} and amplitude_{unit}, and no other"
            )
            return
        wave = Harmonic(component, period, in_base(amplitude, unit), table.phase_rad)
        joints[joint.name] = replace(joints[joint.name], harmonics=(*joints[joint.name].harmonics, wave))

    def _backlash(self, joints: dict[str, JointErrors]) -> None:
        units = {
            name: "urad" if joint.kind == "rotary" else "um" for name, joint in self._structure.joints.items()
        }
        names = {f"{name}_{unit}": name for name, unit in units.items()}
        for key, value in self._file.backlash.items():
            if key not in names:
                self._wrong(("backlash", key), f"backlash.{key}: expected one of {', '.join(names)}")
                continue
            name = names[key]
            joints[name] = replace(joints[name], backlash=in_base(value, units[name]))

    def _yields(self) -> Iterator[tuple[str, Yield]]:
        for name, table in self._file.elasticity.items():
            joint = self._structure.joints.get(name)
            if joint is None:
                self._wrong(("elasticity", name), f"elasticity.{name} is no axis of the machine")
                continue
            rotary = joint.kind == "rotary"
            if table.own_um_kN if rotary else table.own_urad_Nm:
                wanted = "own_urad_Nm" if rotary else "own_um_kN"
                self._wrong(("elasticity", name), f"elasticity.{name}: expected {wanted} of this axis")
            yield name, _yield(table, rotary)

    def _gravity(self) -> Iterator[Gravity]:
        for index, table in enumerate(self._file.gravity):
            owner = [
                name
                for name, joint in self._structure.joints.items()
                if joint.kind == "rotary" and component_of(table.component, joint) == OWN
            ]
            if not owner:
                self._wrong(
                    ("gravity", index, "component"),
                    f'gravity[{index}].component = "{table.component}"; expected the own turn of a rotary '
                    'axis, such as "EJ2J2"',
                )
                continue
            sine, cosine = shifted(table.sin_urad, -6), shifted(table.cos_urad, -6)
            yield Gravity(owner[0], tuple(table.angles), sine, cosine)

    def _masses(self) -> Iterator[Mass]:
        for index, table in enumerate(self._file.masses):
            if table.on not in self._structure.joints:
                self._wrong(("masses", index, "on"), f'masses[{index}].on = "{table.on}" is no axis')
            yield Mass(table.on, table.kg, table.centre_mm)


def _yield(table: ElasticityTable, rotary: bool) -> Yield:
    tilt = (table.A_urad_Nm, table.B_urad_Nm, table.C_urad_Nm)
    shift = (table.X_um_kN, table.Y_um_kN, table.Z_um_kN)
    own = shifted(table.own_urad_Nm, -6) if rotary else shifted(table.own_um_kN, _UM_KN)
    return Yield(own, _vector([shifted(v, -6) for v in tilt]), _vector([shifted(v, _UM_KN) for v in shift]))


def _shift(table: LocationTable) -> Vector:
    return _mm((table.X_um or 0.0, table.Y_um or 0.0, table.Z_um or 0.0))


def _tilt(table: LocationTable) -> Vector:
    return _vector([shifted(v or 0.0, -6) for v in (table.A_urad, table.B_urad, table.C_urad)])


def _mm(vector_um: Vector) -> Vector:
    return _vector([shifted(value, -3) for value in vector_um])


def _vector(values: object) -> Vector:
    x, y, z = (float(v) for v in values)  # type: ignore[attr-defined]
    return (x, y, z)
