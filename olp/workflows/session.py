"""A session: machine, job, calibration and programs of a run, each opened once. Files become values here."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence, Sized
from contextlib import contextmanager
from dataclasses import field, replace
from operator import index
from pathlib import Path
from typing import Any, Literal, TypeVar

from olp.compensation.stamp import stamp_line
from olp.core.errors import ConfigError, InputError, UsageError
from olp.core.machine import Setup
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.known import KnownErrors
from olp.errormodel.uncertainty import Uncertainty
from olp.files.calibration.covariance import load_uncertainty
from olp.files.calibration.reader import files_beside, load_calibration
from olp.files.config import read_setup
from olp.files.sources import Source, Sources
from olp.program.dialect import Dialect
from olp.program.registry import DIALECTS, dialect_of, find
from olp.workflows import real_time
from olp.workflows.known import Stated, described_by

PathLike = str | Path
Outside = Literal["refuse", "hold"]
T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """Everything loaded that a run needs. `dialect` is that of the control until a program is read
    (`reading`). `skip` are components that the control corrects. `left_out` are those that are not corrected
    because they are within their own uncertainty; `model` has neither. `stated` is what the call states in
    place of files, None where files do."""

    setup: Setup
    dialect: Dialect
    calibration: Calibration
    model: ErrorModel
    digest: str
    uncertainty: Uncertainty | None
    skip: frozenset[str]
    left_out: frozenset[str] = frozenset()
    stated: Stated | None = None

    @property
    def full(self) -> ErrorModel:
        """The model with the components that are left out because they are within their own uncertainty."""
        if not self.left_out:
            return self.model
        return build(self.calibration, self.setup.machine.chain, outside="hold", skip_components=self.skip)

    def held(self) -> Loaded:
        """The same with the error at the face of the calibrated box outside of it, as a proof takes it."""
        skip = self.skip | self.left_out
        model = build(self.calibration, self.setup.machine.chain, outside="hold", skip_components=skip)
        return replace(self, model=model)

    def part_tolerance_um(self, given: float | None) -> float | None:
        """The tolerance of the part: what a call gives, else what the job states."""
        return self.setup.job.part_tolerance_um if given is None else given

    def heads(self) -> dict[str, dict[str, Any]]:
        """The parts of a report on the machine and its calibration."""
        machine, calibration = self.setup.machine, self.calibration
        return {
            "machine": {"name": machine.name, "chain": machine.chain, "controller": machine.controller},
            "calibration": {
                "measured": calibration.measured,
                "valid_until": calibration.valid_until,
                "model": calibration.model,
                "temperature_degC": calibration.temperature_degC,
                "sha256": self.digest,
            },
        }

    def stamp(self, accepted: Sequence[str] = ()) -> bytes:
        """The stamp of a program for this machine, with the codes of accepted doubts."""
        by_control = self.setup.machine.real_time is not None
        return stamp_line(self.digest, self.dialect.comment, accepted, real_time=by_control)

    def reading(self, program: Source) -> Loaded:
        """The same for a program: its dialect is detected here, also for later versions of it. Raises
        ProgramError where it cannot be detected, or where the program is corrected and the control corrects
        too, UsageError for an unknown name."""
        real_time.refuse_stamped(self.setup.machine.real_time, self.digest, program)
        setup, dialect = _settled(self.setup, self.dialect, program)
        return replace(self, setup=setup, dialect=dialect)


def content_of(sources: Sources, calibration: PathLike) -> bytes:
    """The bytes of a calibration file and of the files that it names."""
    files = (calibration, *files_beside(calibration, sources.read))
    return b"".join(sources.read(file) for file in files)


def digest_of(content: bytes, chain: str, left_out: frozenset[str] = frozenset()) -> str:
    """The hash of a calibration, on a chain and without the components that are left out."""
    digest = hashlib.sha256(content)
    digest.update(repr(chain).encode())
    if left_out:
        digest.update(repr(sorted(left_out)).encode())
    return digest.hexdigest()


@dataclass(frozen=True, slots=True, eq=False)
class Session:
    """Machine and job of a run, and the files that it reads, each opened once. The calibration is loaded when
    it is first asked for, unless it is `stated` by the call."""

    setup: Setup
    sources: Sources = field(default_factory=Sources)
    stated: Stated | None = None
    _loaded: dict[tuple[Outside, bool], Loaded] = field(default_factory=dict, repr=False)
    _calibrations: list[Calibration] = field(default_factory=list, repr=False)
    _once: dict[str, Any] = field(default_factory=dict, repr=False)

    @staticmethod
    def start(
        machine: PathLike | Setup | KnownErrors | None,
        job: PathLike | None = None,
        *,
        dialect: str | None = None,
        sources: Sources | None = None,
    ) -> Session:
        """The setup that a caller has, that of a machine file and a job file, or that of a machine of which
        only some errors are known. `dialect` is the name of the program's dialect, or the file that describes
        it. Raises InputError, ConfigError, UsageError."""
        sources = sources or Sources()
        if isinstance(machine, Setup):
            return Session(machine, sources)
        if isinstance(machine, KnownErrors):
            if job is not None:
                raise UsageError(
                    "goes with no errors that are stated without files; leave it out", file=str(job)
                )
            setup, stated = described_by(machine, None if dialect is None else find(dialect))
        else:
            setup, stated = read_setup(machine, job, sources.read, sources.exists), None
        if dialect is not None:
            from olp.files.described import described

            own = described(dialect, read=sources.read)
            named = replace(setup.machine, assumed=False)
            setup = replace(setup, machine=named, job=replace(setup.job, dialect=dialect, described=own))
        return Session(setup, sources, stated)

    def of(self, setup: Setup) -> Session:
        """A session of another setup that reads the same files."""
        return Session(setup, self.sources, self.stated)

    def reading_from(self, sources: Sources) -> Session:
        """The same session with its calibration as it is loaded; further files come from other sources."""
        return replace(self, sources=sources)

    def beside_calibration(self) -> list[str]:
        """The files that the calibration file names. Raises InputError where that cannot be read."""
        path = self.setup.machine.calibration
        with _named_by_the_machine(path):
            return [] if path is None else [str(file) for file in files_beside(path, self.sources.read)]

    def inputs(self) -> tuple[str, ...]:
        """The paths from the root of the files that were read, and of those that machine, job and calibration
        name: none is ever overwritten. Raises as `beside_calibration`."""
        job = self.setup.job
        meshes = (mesh.file for mesh in job.meshes)
        named = (job.machine, self.setup.machine.calibration, job.sensor_log, *meshes)
        every = (*self.sources.files, *filter(None, named), *self.beside_calibration())
        return tuple(dict.fromkeys(str(Path(path).absolute()) for path in every))

    def control(self) -> Dialect:
        """The dialect of the machine's control."""
        name = self.setup.machine.controller
        dialect = find(name)
        if dialect is None:
            from olp.files.described import described

            dialect = described(name, read=self.sources.read)
        if dialect is None:
            raise ConfigError(f"controller {name!r} has no dialect; expected one of {', '.join(DIALECTS)}")
        return dialect

    def reading(self, program: Source) -> tuple[Setup, Dialect]:
        """The dialect of a program, and the setup with it named, so that later versions of the program are
        read in the same way. Raises as `Loaded.reading`."""
        own = self.setup.job.described
        return _settled(self.setup, own if isinstance(own, Dialect) else self.control(), program)

    def calibration(self) -> Calibration:
        """The calibration of the machine, as its file states it. Raises ConfigError where there is none, or
        it is wrong."""
        if self.stated is not None:
            return self.stated.calibration
        if not self._calibrations:
            machine, job = self.setup.machine, self.setup.job
            if machine.calibration is None:
                raise ConfigError(
                    f"machine {machine.name!r} names no calibration; give the key calibration in its file"
                )
            temperatures = dict(job.temperatures_degC)
            with _named_by_the_machine(machine.calibration):
                self._calibrations.append(
                    load_calibration(machine.calibration, machine, temperatures, read=self.sources.read)
                )
        return self._calibrations[0]

    def loaded(self, outside: Outside, *, only_sure: bool = False) -> Loaded:
        """Calibration and error model beside machine and job; `only_sure` leaves out components within their
        own uncertainty. Raises InputError, ConfigError."""
        key = (outside, only_sure)
        if key not in self._loaded:
            self._loaded[key] = self._load(outside, only_sure)
        return self._loaded[key]

    def _load(self, outside: Outside, only_sure: bool) -> Loaded:
        machine, stated = self.setup.machine, self.stated
        if machine.calibration is not None and "all" in machine.compensated_by_controller:
            raise ConfigError(
                'compensated_by_controller = "all": the control corrects everything already, so a corrected '
                "program would be corrected twice; list the components that it corrects, or switch its "
                "tables off"
            )
        calibration = self._at_temperatures(self.calibration())
        skip = frozenset(machine.compensated_by_controller - calibration.active_during_measurement)
        uncertainty = None
        if machine.calibration is not None:
            uncertainty = load_uncertainty(machine.calibration, calibration, read=self.sources.read)
        left_out: frozenset[str] = frozenset()
        if only_sure:
            if uncertainty is None:
                raise ConfigError(
                    "states no uncertainty, which --only-sure-components needs; give the file of "
                    "[covariance] or sigma columns, or leave --only-sure-components out",
                    file=machine.calibration,
                )
            from olp.uncertainty.components import improbable

            left_out = improbable(calibration, uncertainty) - skip
        if machine.real_time is not None:
            calibration = real_time.corrected(machine, calibration, self._digest(frozenset()))
        model = build(calibration, machine.chain, outside=outside, skip_components=skip | left_out)
        digest = self._digest(left_out)
        control = self.control()
        return Loaded(self.setup, control, calibration, model, digest, uncertainty, skip, left_out, stated)

    def _at_temperatures(self, calibration: Calibration) -> Calibration:
        """The calibration with its thermal structure at the temperatures of the job. Raises ConfigError where
        the job names sensors that it does not have, or leaves some out."""
        structure, job = calibration.structure, self.setup.job
        if structure is None:
            if job.sensors_degC or job.sensor_log:
                raise ConfigError(
                    "the job states temperatures of sensors, and the calibration has no thermal structure; "
                    "give [thermal] structure in the calibration file, or leave the sensors out"
                )
            return calibration
        if job.sensors_degC is not None:
            structure = structure.at(job.sensors_degC)
        elif job.sensor_log is not None:
            from olp.files.calibration.structure import read_drift_log, sensors_of

            log = read_drift_log(job.sensor_log, read=self.sources.read)
            sensors = sensors_of(log, dict.fromkeys(s.name for s in structure.sensors))
            structure = structure.settled(log.time_s, sensors, job.sensor_log_at_s)
        return replace(calibration, structure=structure)

    def _digest(self, left_out: frozenset[str]) -> str:
        """Hash of the calibration file, the files that it names and the machine values that decide the
        model; of a stated calibration its statement."""
        calibration = self.setup.machine.calibration
        statement = self.stated.statement.encode() if self.stated else b""
        content = statement if calibration is None else content_of(self.sources, calibration)
        return digest_of(content, self.setup.machine.chain, left_out)

    def once(self, name: str, make: Callable[[], T]) -> T:
        """What `make` gives, which depends on machine, job and calibration alone; it is made once."""
        if name not in self._once:
            self._once[name] = make()
        value: T = self._once[name]
        return value

    def tool_vector(self, tool: int | Sequence[float] | None) -> tuple[float, float, float]:
        """Gauge point to tip in mm of a tool number, of a vector, or of the tool in the spindle at the start.
        Raises ConfigError for a tool without vector, UsageError for a vector that is none."""
        if isinstance(tool, Sized):
            if len(tool) != 3:
                raise UsageError(f"tool has {len(tool)} values; expected a tool number, or X, Y, Z in mm")
            x, y, z = map(float, tool)
            return x, y, z
        number = self.setup.machine.default_tool if tool is None else index(tool)
        if not number:
            return (0.0, 0.0, 0.0)
        described = self.setup.tool(number)
        if described is None or described.tool_vector_mm is None:
            raise ConfigError(
                f"tool {number} has no tool vector; give tools.{number}.Z_mm or gauge_to_tip_mm in the "
                "machine file"
            )
        return described.tool_vector_mm


@contextmanager
def _named_by_the_machine(calibration: str | None) -> Iterator[None]:
    """Says of a calibration that cannot be read where its name comes from."""
    try:
        yield
    except InputError as error:
        if type(error) is InputError and error.file == calibration:
            error.message += "; the key calibration of the machine file names it"
        raise


def opened(
    program: PathLike | bytes,
    machine: PathLike | Setup | KnownErrors,
    job: PathLike | None,
    role: str | None = None,
) -> tuple[Session, Source]:
    """Session and program of a call from Python; the program is read first. `role` as in `Source.errors`.
    Raises InputError, ConfigError, UsageError."""
    sources = Sources()
    source = sources.source(program)
    source.load()
    with source.errors(role):
        return Session.start(machine, job, sources=sources), source


def _settled(setup: Setup, control: Dialect, program: Source) -> tuple[Setup, Dialect]:
    """The dialect of a program on a control, and the setup with it named."""
    own = setup.job.described
    if isinstance(own, Dialect):
        return setup, own
    dialect = dialect_of(setup.job.dialect, control, program.data, program.name)
    own = None if find(dialect.name) is not None else dialect
    return replace(setup, job=replace(setup.job, dialect=dialect.name, described=own)), dialect
