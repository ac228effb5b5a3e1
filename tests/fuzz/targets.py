"""What the byte fuzz calls: good inputs of every dialect and kind of side file, and what takes them."""

from __future__ import annotations

import contextlib
import itertools
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from cases.control_settings import SAMPLES
from cases.dialects import CASES, FRAMES, RS274
from cases.gate import block
from judge.machines import Recipe, random_machine

import olp
from olp.core.machine import Setup
from olp.errormodel.entry import Entry
from olp.errormodel.uncertainty import Uncertainty
from olp.files.calibration.covariance import covariance_bytes, parse_covariance
from olp.files.calibration.reader import load_calibration
from olp.files.config import load_setup, read_setup
from olp.files.control_tables import registry as control_tables
from olp.files.control_tables.base import Given
from olp.files.described import FOLDER, described, load_described
from olp.files.machine_settings.registry import read_settings
from olp.files.measurements.line_profile import load_line_profile
from olp.files.measurements.postures import read_postures
from olp.files.measurements.reader import load_measurements
from olp.files.meshes import read_mesh
from olp.files.point_profile import load_profile
from olp.files.points import parse_points
from olp.files.write import read_bytes
from olp.program import registry
from olp.program.dialect import Dialect
from olp.program.rs274.flatten.unroll import flatten
from olp.program.rs274.profiles.base import Profile
from olp.workflows.session import Session

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS, GOOD = ROOT / "programs", ROOT / "tests" / "broken" / "good"


@dataclass(frozen=True)
class Target:
    """Good inputs, and what is done with a mutated one; `share` is how often it is drawn."""

    name: str
    inputs: tuple[bytes, ...]
    call: Callable[[bytes], object]
    share: float = 1.0


def targets(folder: Path) -> list[Target]:
    """All targets; files of machines and of calls are written into `folder`."""
    return [
        *_programs(folder / "programs"),
        *_unrolled(),
        *_setups(),
        *_measured(folder / "measured"),
        *_tables(folder / "tables"),
        *_points(folder / "points"),
        *_descriptions(),
    ]


def _nasty() -> list[bytes]:
    return [path.read_bytes() for path in sorted((PROGRAMS / "nasty").glob("*.ngc"))]


def _texts(name: str) -> tuple[bytes, ...]:
    """Programs of a dialect."""
    made = CASES[name].program(np.random.default_rng(3).uniform(-50, 50, (9, 3)), 3)
    real = [path.read_bytes() for path in sorted((PROGRAMS / "apt-flavours").glob(f"*.{name}*"))]
    if name in RS274:
        real = _nasty()
    if name == "dmis":
        real = [(PROGRAMS / "dmis-housing" / "housing.dmi").read_bytes()]
    if name == "apt":
        real = [p.read_bytes() for p in sorted((PROGRAMS / "apt-flavours").iterdir()) if p.name != "job.toml"]
    return (made, *CASES[name].examples, *real)


def _programs(folder: Path) -> Iterator[Target]:
    for name in CASES:
        recipe = Recipe(controller=CASES[name].controller, work_offsets=FRAMES)
        setup = load_setup(random_machine(folder / name, 3, recipe))
        own = described(name)
        dialect = own or registry.named(name)
        job = replace(setup.job, dialect=None if own else name, described=own, start_mm=(0.0, 0.0, 0.0))
        setup, texts = replace(setup, job=job), _texts(name)
        yield Target(f"read {name}", texts, _reading(setup, dialect), 4.0)
        yield Target(f"correct {name}", texts, _corrected(setup), 0.3)
        yield Target(f"check {name}", texts, _checked(setup), 0.1)
        yield Target(f"verify {name}", texts, _verified(setup, texts), 0.1)
        if own is None:
            # programs of robots state no feed that is a speed
            yield Target(f"retime {name}", texts, _retimed(setup), 0.05)


def _reading(setup: Setup, dialect: Dialect) -> Callable[[bytes], object]:
    return lambda data: registry.read(data, setup, dialect)


def _corrected(setup: Setup) -> Callable[[bytes], object]:
    return lambda data: olp.correct(data, setup, outside_box="hold")


def _checked(setup: Setup) -> Callable[[bytes], object]:
    return lambda data: olp.check(data, setup)


def _retimed(setup: Setup) -> Callable[[bytes], object]:
    return lambda data: olp.retime(data, setup)


def _verified(setup: Setup, texts: Sequence[bytes]) -> Callable[[bytes], object]:
    whole = itertools.cycle(texts)
    return lambda data: olp.verify(next(whole), data, setup)


def _unrolled() -> Iterator[Target]:
    words = (
        b"#1=0\no1 while [#1 lt 5]\nG1 X[#1*2] Y[SIN[#1*30]]\n#1=[#1+1]\no1 endwhile\nM2\n",
        b"o100 sub\nG1 X#1 F#2\no100 endsub\no100 call [1] [100]\no2 repeat [3]\nG91 G1 X1\no2 endrepeat\n",
    )
    macro_b = (
        b"O1\n#1=1\nWHILE[#1LT4]DO1\nG1 X#1 F100.\n#1=#1+1\nEND1\nIF[#1EQ4]GOTO5\nM0\nN5 M98 P2 L2\nM30\nO2\n"
        b"G65 P3 A1. B2.\nM99\nO3\nX#1 Y#2\nM99\n",
    )
    for name in RS274:
        profile = registry.named(name)
        assert isinstance(profile, Profile)
        if profile.unroller is not None:
            texts = (*(macro_b if profile.language.macro_b else words), *_nasty())
            yield Target(f"flatten {name}", texts, _flattened(profile, expand=False), 1.0)
            yield Target(f"flatten cycles {name}", texts, _flattened(profile, expand=True), 0.5)


def _flattened(profile: Profile, *, expand: bool) -> Callable[[bytes], object]:
    return lambda data: flatten(data, profile, expand_cycles=expand, limit=300_000, peck_clearance=1.0)


def _setups() -> Iterator[Target]:
    """Every file of a machine in turn, all others good."""
    for source in (GOOD, PROGRAMS / "bridge-cmm", PROGRAMS / "table-router"):
        for path in sorted(source.iterdir()):
            if path.suffix in (".toml", ".csv"):
                label = f"setup {source.name}/{path.name}"
                yield Target(label, (path.read_bytes(),), _set_up(source, path), 1.0)
    solid = block((400.0, 0.0, 0.0), (410.0, 10.0, 10.0))
    yield Target("mesh", (solid,), lambda data: read_mesh("a.stl", lambda _: data), 0.2)
    whole = covariance_bytes(Uncertainty((
        Entry("mean", "EXX", np.ones((4, 3)), np.full(4, 1e-4), np.arange(4.0)),
        Entry("mean", "EYY", np.ones((3, 3)), np.full(3, 1e-4), np.arange(3.0)),
    ), "0" * 64, "a fit"))  # fmt: skip
    yield Target("covariance", (whole,), lambda data: parse_covariance(data, "c.npz"), 2.0)


def _set_up(source: Path, mutant: Path) -> Callable[[bytes], object]:
    job = source / "job.toml"

    def call(data: bytes) -> object:
        def read(path: str | Path) -> bytes:
            return data if Path(path).name == mutant.name else read_bytes(path)

        setup = read_setup(source / "machine.toml", job if job.exists() else None, read)
        load_calibration(source / "calibration.toml", setup.machine, read=read)
        session = Session.start(setup)
        session.sources._texts[mutant] = data
        return session.loaded("hold")

    return call


def _in_file(path: Path, call: Callable[[Path], object]) -> Callable[[bytes], object]:
    def written(data: bytes) -> object:
        path.write_bytes(data)
        return call(path)

    return written


_CHECKS: dict[str, Callable[[Path], object]] = {
    "ballbar": lambda path: olp.fit_ballbar([path]),
    "diagonal": lambda path: olp.fit_diagonals([path]),
    "go-return": lambda path: olp.go_return([path]),
    "postures": read_postures,
}


def _measured(folder: Path) -> Iterator[Target]:
    lines, checks = PROGRAMS / "gantry-lines", PROGRAMS / "gantry-checks"
    shutil.copytree(lines, folder / "lines")
    shutil.copytree(checks, folder / "checks")
    for path in sorted((folder / "lines").iterdir()):
        if path.name == "machine.toml":
            continue
        alone = path.name in ("laser.toml",)
        call = load_line_profile if alone else _measuring(folder / "lines")
        good = path.read_bytes()
        yield Target(f"measured {path.name}", (good,), _restored(path, good, call), 0.3)
    for path in sorted((folder / "checks").iterdir()):
        reader = next(call for begin, call in _CHECKS.items() if path.name.startswith(begin))
        yield Target(f"checks {path.name}", (path.read_bytes(),), _in_file(path, reader), 0.5)


def _measuring(folder: Path) -> Callable[[Path], object]:
    return lambda _: load_measurements([folder])


def _restored(path: Path, good: bytes, call: Callable[[Path], object]) -> Callable[[bytes], object]:
    def written(data: bytes) -> object:
        path.write_bytes(data)
        try:
            return call(path)
        finally:
            path.write_bytes(good)

    return written


def _tables(folder: Path) -> Iterator[Target]:
    """Tables of controls, as they are written of a calibration."""
    folder.mkdir(parents=True)
    source = PROGRAMS / "bridge-cmm"
    calibration = load_calibration(source / "calibration.toml")
    given = Given(machine=calibration.machine, travel_mm=calibration.box_mm, sense=None)
    # a file of one screw does not name its axis
    alone = replace(given, axis="X", kind=1)
    for key, form in control_tables.FORMATS.items():
        try:
            files = control_tables.write_table(calibration, key, folder / f"table{form.ending}", given).files
        except olp.OlpError:
            continue
        for path, content in files.items():
            data = content if isinstance(content, bytes) else b"".join(content)

            stated = alone if path.suffix == ".comp" else given

            def call(mutant: bytes, key: str = key, path: Path = path, stated: Given = stated) -> object:
                return control_tables.read_table(path, key, stated, lambda _: mutant)

            with contextlib.suppress(olp.OlpError):
                # some of the files are notes beside the tables
                call(data)
                yield Target(f"table {key}", (data,), call, 0.5)
    for sample in SAMPLES:
        file = _in_file(folder / sample.name, read_settings)
        yield Target(f"settings {sample.name}", (sample.text.encode(),), file, 0.5)


def _points(folder: Path) -> Iterator[Target]:
    folder.mkdir(parents=True)
    table = b"# frame=G54\nX_mm,Y_mm,Z_mm,t_s\n" + b"".join(
        b"%d.5,%d,0,%d\n" % (k, k % 7, k) for k in range(40)
    )
    spaces = table.replace(b",", b" ").replace(b".5", b",5")
    yield Target("points", (table, spaces), lambda data: parse_points(data, "p.csv"), 2.0)
    nominal = b"X_mm,Y_mm,Z_mm\n0,0,0\n40,0,0\n40,9,0\n"

    def compared(path: Path) -> object:
        return olp.compare(nominal, [path])

    yield Target("compare", (table,), _in_file(folder / "p.csv", compared), 0.2)
    setup = load_setup(random_machine(folder / "m", 3, Recipe(work_offsets=FRAMES)))
    results = b"X_mm,Y_mm,Z_mm,nx,ny,nz\n" + b"10,20,-5,0,0,1\n" * 4
    dmis = b"DMISMN/'A',05.2\nUNITS/MM,ANGDEC\nFA(P1)=FEAT/POINT,CART,1,2,3,0,0,1\nENDFIL\n"
    call: Callable[[bytes], object] = lambda data: olp.correct_results(data, setup)  # noqa: E731
    yield Target("results", (results, dmis), call, 0.5)


def _descriptions() -> Iterator[Target]:
    """Files that describe layouts and languages."""
    profile = b'schema = "olp-points-1"\ndelimiter = "semicolon"\nunit = "m"\n[columns]\nX = "East"\nY = 2\n'
    yield Target("profile", (profile,), lambda data: load_profile("p.toml", lambda _: data), 1.0)
    for path in sorted(FOLDER.glob("*.toml")):
        call: Callable[[bytes], object] = lambda data: load_described("d.toml", lambda _: data)  # noqa: E731
        yield Target(f"language {path.stem}", (path.read_bytes(),), call, 0.3)
