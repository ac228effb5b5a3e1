"""A dialect that is registered under another name is read, unrolled, timed, judged and written alike."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.dialects import CASES, FRAMES, RS274
from cases.fast import left_to_a_campaign, some_fast
from cases.rs274_texts import BLOCKS, PARAMETRIC, START
from judge import machines
from judge.machines import Recipe

import olp
from olp.core.errors import OlpError
from olp.core.machine import Setup
from olp.files.config import load_setup
from olp.files.described import described
from olp.files.sources import Sources
from olp.program import registry
from olp.program.dialect import Dialect, Options
from olp.program.feeds.timing import timing
from olp.program.rs274.positions import positions_program
from olp.program.rs274.profiles.base import Profile
from olp.workflows.flatten import UnrollOptions, as_asked

ROOT = Path(__file__).resolve().parents[2]
OTHER = "another-name"
TOOLS = {
    1: {"Z_mm": 120.0, "radius_mm": 5.0},
    2: {"X_mm": 3.0, "Y_mm": -2.0, "Z_mm": 85.5, "gauge_to_tip_mm": [40.0, -60.0, -85.5]},
    3: {"X_mm": 1.0, "Z_mm": 60.0},
}
OFFSETS = {
    **FRAMES,
    **{
        name: {"X_mm": 150.0, "Y_mm": 100.0, "Z_mm": -200.0, "set_by": "true"}
        for name in ("G55", "G59.1", "G54.1 P1", "G154 P1", "G110", "COOR_0001")
    },
}
#: Path modes, offsets that the program writes, holes that are counted: what writer and findings see.
JUDGED = re.compile(r"G64|G10 L2 P1|G81.*[LK]3")
NAMES = [*registry.DIALECTS, *registry.DESCRIBED]
#: Profiles of RS-274 that others of them stand for where a law takes seconds of each dialect.
ALIKE = {*RS274} - {"linuxcnc", "fanuc", "grbl", "marlin"}


@dataclass(frozen=True)
class Pair:
    """A setup with its dialect, and the same with a copy of the dialect under another name."""

    setup: Setup
    dialect: Dialect
    other: Setup
    copy: Dialect


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Pair]]:
    folder, setups = tmp_path_factory.mktemp("bent"), {}
    with pytest.MonkeyPatch.context() as patch:
        for name in NAMES:
            recipe = Recipe(controller=name, tools=TOOLS, work_offsets=OFFSETS, off_datum=True)
            setup = load_setup(machines.random_machine(folder / name, 3, recipe))
            dialect = registry.find(name) or described(name)
            assert dialect is not None
            copy = replace(dialect, name=f"{OTHER}-{name}")
            patch.setitem(registry._KNOWN, copy.name, registry.Known("", copy.signs))
            patch.setitem(registry._LOADED, copy.name, copy)
            other = replace(setup.machine, controller=copy.name)
            setups[name] = Pair(
                replace(setup, job=replace(setup.job, dialect=name, described=described(name))),
                dialect,
                replace(setup, machine=other, job=replace(setup.job, dialect=copy.name)),
                copy,
            )
        yield setups


@pytest.mark.slow
def test_the_copies_are_registered_and_only_here(pairs: Mapping[str, Pair]) -> None:
    assert {pair.copy.name for pair in pairs.values()} <= registry.DIALECTS.keys()
    assert all(registry.named(pair.copy.name) is pair.copy for pair in pairs.values())


def plain(value: Any) -> Any:
    """A value of any kind as plain data that can be compared; of a dialect nothing."""
    if isinstance(value, Dialect | Setup):
        return None
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    return [plain(v) for v in value] if isinstance(value, list | tuple) else repr(value)


def outcome(run: Callable[[], Any], dialect: Dialect, name: str) -> Any:
    """What a run returns or how it refuses, with `name` for the name of its dialect."""
    try:
        result = json.dumps(plain(run()), default=repr)
    except OlpError as error:
        result = f"{type(error).__name__} {error} {getattr(error, 'line', None)}"
    return result.replace(dialect.name, name)


def alike(run: Callable[[Setup, Dialect], Any], pair: Pair) -> str:
    own = outcome(lambda: run(pair.setup, pair.dialect), pair.dialect, pair.dialect.name)
    assert outcome(lambda: run(pair.other, pair.copy), pair.copy, pair.dialect.name) == own
    return str(own)


def texts_of(name: str) -> list[bytes]:
    case = CASES[name]
    steps = np.random.default_rng(7).uniform(-40, 40, (8, 3))
    texts = [case.program(steps, 3), *case.examples]
    texts += [case.program(steps, 3).replace(b"\n", b"\n" + text + b"\n", 3) for text in case.examples]
    if isinstance(registry.find(name), Profile):
        texts += [(START + text).encode() for text in (*BLOCKS, *PARAMETRIC)]
        texts += [text.encode() for text in BLOCKS]
    folders = ("apt-flavours", "dmis-housing", "nasty", "haas-mill", "table-router")
    files = [p for folder in folders for p in sorted((ROOT / "programs" / folder).iterdir())]
    endings = {".ngc", ".nc", ".ncl", ".cls", ".apt", ".aptsource", ".dmi"}
    return texts + [p.read_bytes()[:20_000] for p in files if p.suffix in endings]


def reading(text: bytes, setup: Setup, dialect: Dialect, options: Options) -> list[Any]:
    program = registry.read(text, setup, dialect, options)
    try:
        return [program, timing(program, block_delete=options.block_delete)]
    except OlpError as error:
        return [program, str(error)]


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(NAMES, ALIKE))
def test_programs_are_read_and_timed_alike(pairs: Mapping[str, Pair], name: str) -> None:
    outcomes, leave_out = [], Options(block_delete=True)
    for text in texts_of(name):
        outcomes.append(alike(lambda s, d: reading(text, s, d, Options()), pairs[name]))  # noqa: B023
        if re.search(rb"^\s*/", text, re.MULTILINE):
            alike(lambda s, d: reading(text, s, d, leave_out), pairs[name])  # noqa: B023
    assert sum(text.startswith("[") for text in outcomes) > 3


def _unrolled(text: bytes, setup: Setup, dialect: Dialect, expand: bool, clearance: float | None) -> bytes:
    sources = Sources()
    given = sources.source(text)
    options = UnrollOptions(flatten=True, expand_cycles=expand, peck_clearance_mm=clearance)
    return as_asked(sources, given, setup, dialect, options).data


@pytest.mark.parametrize("name", some_fast(NAMES, 4))
def test_programs_are_unrolled_alike(pairs: Mapping[str, Pair], name: str) -> None:
    texts = [text.encode() for text in PARAMETRIC] + [(START + text).encode() for text in BLOCKS]
    for text in texts:
        for expand, clearance in ((False, None), (True, None), (True, 0.5)):
            alike(lambda s, d: _unrolled(text, s, d, expand, clearance), pairs[name])  # noqa: B023


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(NAMES, ALIKE))
def test_programs_are_corrected_and_judged_alike(pairs: Mapping[str, Pair], name: str) -> None:
    def corrected(text: bytes, setup: Setup) -> tuple[bytes, object, object]:
        result = olp.correct(text, setup)
        return result.data, result.report, [finding.as_dict() for finding in result.findings]

    pair, good = pairs[name], 0
    texts = texts_of(name)[:4]
    if isinstance(pair.dialect, Profile):
        texts += [(START + text).encode() for text in BLOCKS if JUDGED.search(text)]
    for text in texts:
        good += alike(lambda s, d: corrected(text, s), pair).startswith("[")  # noqa: B023
    assert good


@pytest.mark.parametrize("name", [n for n, d in registry.DIALECTS.items() if isinstance(d, Profile)])
def test_programs_of_positions_are_alike(pairs: Mapping[str, Pair], name: str) -> None:
    places = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
    alike(lambda s, d: positions_program(d, places, [0.5, 2.0], 3, ["note"]), pairs[name])


def by_control(pair: Pair) -> Pair:
    """The pair with the control alone to say the dialect."""
    setup, other = (
        replace(s, job=replace(s.job, dialect=None, described=None)) for s in (pair.setup, pair.other)
    )
    return replace(pair, setup=setup, other=other)


@pytest.mark.slow
def test_axis_positions_of_results_count_alike(pairs: Mapping[str, Pair]) -> None:
    table = b"X_mm,Y_mm,Z_mm\n1,2,-203\n4,5,-206\n"
    counted = {
        name: alike(lambda s, d: olp.correct_results(table, s, frame="machine").report, by_control(pair))
        for name, pair in pairs.items()
    }
    assert [name for name, remark in counted.items() if "end of the ram" in remark] == ["dmis"]
