"""A session reads each input of a run once; options of a verb are those of its function."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import olp
from olp.core import spool
from olp.core.errors import InputError, OlpError, ProgramError
from olp.files.sources import Source, Sources
from olp.review.job import ViewOptions
from olp.workflows.check import CheckOptions
from olp.workflows.compare import CompareOptions
from olp.workflows.correct import CorrectOptions
from olp.workflows.results import ResultOptions
from olp.workflows.retime import RetimeOptions
from olp.workflows.session import Session
from olp.workflows.simulate import SimulateOptions
from olp.workflows.verify import VerifyOptions

FOLDER = Path(__file__).resolve().parents[2] / "programs" / "gantry-plate"
#: Runs the command line, and prints the files below the working folder that it opens to read.
COUNT = r"""
import os, sys
here = os.getcwd() + os.sep
opened = []
def hook(event, args):
    if event == "open" and isinstance(args[0], (str, bytes)) and args[1] == "r":
        path = os.path.realpath(os.fsdecode(args[0]))
        if path.startswith(here):
            opened.append(path.removeprefix(here))
sys.addaudithook(hook)
from olp.cli import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    code = end.code
print("\n".join(["", "opened:", *opened]))
sys.exit(code)
"""
CALIBRATION = {"machine.toml", "calibration.toml", "x.csv", "y.csv", "z.csv"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The gantry with a short program, a body beside it, and a correction of the program."""
    path = tmp_path_factory.mktemp("session") / "gantry"
    shutil.copytree(FOLDER, path)
    (path / "plate.ngc").write_text("G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nY80 Z30\nM2\n")
    (path / "box.stl").write_bytes(_block())
    job = path / "job.toml"
    job.write_text(job.read_text() + '[[meshes]]\nfile = "box.stl"\nrole = "fixture"\nframe = "G54"\n')
    opened(path, "correct", "-j", "job.toml", "-o", "corrected.ngc", "--report", "report.json")
    opened(path, "simulate", "-j", "job.toml", "-o", "tip.csv", "--step-mm", "5")
    return path


def _block() -> bytes:
    from cases.gate import block

    return block((400.0, 0.0, 0.0), (410.0, 10.0, 10.0))


def opened(folder: Path, *words: str) -> Counter[str]:
    """How often a call opens each file of the folder."""
    done = subprocess.run(
        [sys.executable, "-c", COUNT, *words], cwd=os.path.realpath(folder), capture_output=True, text=True,
        check=False, env=os.environ | {"PYTHONPATH": str(Path(olp.__file__).parents[1])},
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    return Counter(done.stdout.partition("\nopened:\n")[2].splitlines())


CALLS = [
    ("correct", "-o", "a.ngc", "--report", "a.html", "--review", "b.html", "--diff"),
    ("correct", "-o", "c.ngc", "--report", "c.md", "--flatten"),
    ("check",),
    ("retime", "--nominal", "corrected.ngc", "--proof", "report.json"),
    ("simulate",),
    ("view", "-o", "d.html", "--no-time", "--measured", "tip.csv"),
    ("inspect",),
]


@pytest.mark.slow
@pytest.mark.parametrize("words", CALLS, ids=" ".join)
def test_each_input_is_opened_once(folder: Path, words: tuple[str, ...]) -> None:
    counts = opened(folder, words[0], *words[1:], "-j", "job.toml")
    named = {word for word in words if word in ("corrected.ngc", "report.json", "tip.csv")}
    needed = {"job.toml", "plate.ngc", "machine.toml", *named}
    assert needed <= counts.keys()
    if words[0] in ("correct", "check", "simulate", "view"):
        assert counts.keys() >= CALIBRATION
    with_meshes = words[0] in ("check", "view") or "--review" in words
    assert ("box.stl" in counts) == with_meshes
    assert {name: count for name, count in counts.items() if count > 1} == {}


@pytest.mark.slow
@pytest.mark.parametrize("words", [
    ("verify", "plate.ngc", "corrected.ngc"), ("check", "corrected.ngc", "--nominal", "plate.ngc"),
    ("view", "plate.ngc", "--corrected", "corrected.ngc", "-o", "e.html", "--no-time"),
    ("compare", "plate.ngc", "tip.csv", "--report", "f.html"),
])  # fmt: skip
def test_each_of_several_texts_is_opened_once(folder: Path, words: tuple[str, ...]) -> None:
    counts = opened(folder, *words, "-j", "job.toml")
    named = {word for word in words if word.endswith((".ngc", ".csv"))}
    assert counts.keys() >= CALIBRATION | named
    assert {name: count for name, count in counts.items() if count > 1} == {}


@pytest.mark.slow
def test_the_count_sees_a_second_opening(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    planted = COUNT.replace("from olp.cli import main", "open('x.csv'); from olp.cli import main")
    monkeypatch.setattr(sys.modules[__name__], "COUNT", planted)
    assert opened(folder, "simulate", "-j", "job.toml")["x.csv"] == 2


PAIRS: list[tuple[Callable[..., Any], type, set[str]]] = [
    (olp.correct, CorrectOptions, set()),
    (olp.verify, VerifyOptions, set()),
    (olp.simulate, SimulateOptions, set()),
    (olp.check, CheckOptions, {"nominal"}),
    (olp.retime, RetimeOptions, {"nominal", "proof"}),
    (olp.compare, CompareOptions, set()),
    (olp.correct_results, ResultOptions, set()),
    (olp.view, ViewOptions, {"corrected", "measured", "correction", "corrected_name"}),
]


@pytest.mark.parametrize(("function", "options", "inputs"), PAIRS, ids=lambda v: getattr(v, "__name__", ""))
def test_options_are_the_keywords_of_the_function(
    function: Callable[..., Any], options: type, inputs: set[str]
) -> None:
    """With the same defaults; what names an input, and progress, is no option."""
    keywords = {
        name: parameter.default
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is parameter.KEYWORD_ONLY and name not in inputs | {"progress"}
    }
    assert {f.name: f.default for f in dataclasses.fields(options)} == keywords
    value = options()
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(value, dataclasses.fields(options)[0].name, None)
    assert not hasattr(value, "__dict__")


@pytest.mark.parametrize(("function", "options", "inputs"), PAIRS, ids=lambda v: getattr(v, "__name__", ""))
def test_every_keyword_reaches_the_options(
    function: Callable[..., Any], options: type, inputs: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each keyword alone, with a value of its own, is the one field that differs from its default."""
    seen: list[Any] = []
    module = sys.modules[function.__module__]

    def run(*args: Any, **_: Any) -> None:
        seen.extend(value for value in args if type(value) is options)

    monkeypatch.setattr(module, "run", run)
    texts = [b"G21\n"] * (2 if function is olp.verify else 1)
    if function is olp.compare:
        texts.append([])  # type: ignore[arg-type]
    setup = olp.load_setup(FOLDER / "machine.toml")
    marks: dict[str, Any] = {"select": ("OLP4",), "ignore": ("OLP4",), "before": ("mark",)}
    marks |= {"accept": ("OLP401",)}
    for field in dataclasses.fields(options):
        length = field.name.endswith(("_um", "_mm"))
        mark = 7.5 if length else marks.get(field.name, "mark")
        function(*texts, setup, **{field.name: mark})
        assert seen.pop() == dataclasses.replace(options(), **{field.name: mark}), field.name


def test_a_file_is_read_once_and_stays_as_it_was_read(tmp_path: Path) -> None:
    path = tmp_path / "part.ngc"
    path.write_bytes(b"one")
    sources = Sources()
    source = sources.source(path)
    assert (source.name, source.short, source.data) == (str(path), "part.ngc", b"one")
    path.write_bytes(b"two")
    assert source.data is sources.read(str(path)) is sources.read(path)
    assert source.data == b"one"
    assert Sources().read(path) == b"two"
    assert sources.read_last(path) == b"one"
    assert sources.read_last(path) == b"two", "a large file is not kept"


def test_a_stream_is_read_once_and_when_it_is_wanted() -> None:
    texts = iter([b"text"])
    source = Source.stream(lambda: next(texts))
    assert source.data is source.data
    assert source.data == b"text"
    assert next(texts, None) is None


def test_a_long_file_stays_as_it_was_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spool, "LONG", 3)
    path = tmp_path / "part.ngc"
    path.write_bytes(b"one")
    files = Sources()
    source = files.source(path)
    source.load()
    path.write_bytes(b"two")
    assert isinstance(source.data, spool.Mapped) and source.data is files.text(path)
    assert files.read(path) == spool.whole(source.data) == b"one"
    assert files.digest(path) == hashlib.sha256(b"one").digest()
    assert files.parcel() == {str(path): b"one"} and files.there() == frozenset()
    assert files.source(source.data).data is source.data


def test_a_made_text_is_in_memory_where_it_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Source.made(spool.Spool(b"text")).data == b"text"
    monkeypatch.setattr(spool, "LONG", 4)
    made = Source.made(spool.Spool(b"text"))
    assert isinstance(made.data, spool.Mapped) and made.data is made.data and made.data[:] == b"text"


@pytest.mark.parametrize("name", ["part.ngc", "part.apt"])
def test_a_correction_keeps_a_long_text_in_a_file(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts = {
        "part.ngc": "G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600 (olp off)\nY80 Z30\nM2\n",
        "part.apt": "LOADTL/1\nRAPID\nGOTO/0,0,20\nFEDRAT/600\nGOTO/100,0,20\nGOTO/100,80,30\nFINI\n",
    }
    path = tmp_path / name
    path.write_text(texts[name])
    short = olp.correct(path, FOLDER / "machine.toml")
    monkeypatch.setattr(spool, "LONG", 1)
    long = olp.correct(path, FOLDER / "machine.toml")
    path.write_bytes(b"G0 X1\n")
    assert all(isinstance(text, spool.Mapped) for text in (long.text, long._nominal.data, long._plain.data))
    assert (long.data, long.nominal, long.plain) == (short.data, texts[name].encode(), short.plain)
    assert long.report == short.report
    assert long.write(tmp_path / "out").read_bytes() == short.data


def test_a_missing_file_is_said_when_it_is_wanted(tmp_path: Path) -> None:
    source = Sources().source(tmp_path / "none.ngc")
    with pytest.raises(InputError, match=r"none\.ngc: no such file"):
        source.load()


@pytest.mark.parametrize(("given", "role", "line", "file"), [
    ("part.ngc", None, 3, "part.ngc"), ("part.ngc", None, None, None),
    ("part.ngc", "<program>", None, "part.ngc"), (b"text", None, 3, None),
    (b"text", "<program>", None, "<program>"), (b"text", "<program>", 3, "<program>"),
])  # fmt: skip
def test_errors_name_what_they_came_from(
    given: str | bytes, role: str | None, line: int | None, file: str | None
) -> None:
    with pytest.raises(OlpError) as caught, Sources().source(given).errors(role):
        raise ProgramError("is wrong", line=line)
    assert caught.value.file == file


def test_a_session_loads_a_calibration_once_and_of_each_box_a_model() -> None:
    session = Session.start(FOLDER / "machine.toml")
    assert session.calibration() is session.calibration()
    assert session.loaded("hold") is session.loaded("hold")
    assert session.loaded("hold").model is not session.loaded("refuse").model
    assert session.loaded("hold").digest == session.loaded("refuse").digest


@pytest.mark.slow
def test_reports_name_machine_and_calibration_alike(tmp_path: Path) -> None:
    """The digest is SHA-256 of the calibration file, the files that it names in order, and the chain."""
    folder = Path(shutil.copytree(FOLDER, tmp_path / "plate"))
    machine, program = folder / "machine.toml", folder / "plate.ngc"
    files = ["calibration.toml", "x.csv", "y.csv", "z.csv"]
    digest = hashlib.sha256(b"".join((folder / name).read_bytes() for name in files) + b"'FXYZ'").hexdigest()
    measured = tmp_path / "measured.csv"
    measured.write_bytes(olp.simulate(program, machine).to_csv())
    corrected = olp.correct(program, machine)
    reports = [
        corrected.report,
        olp.verify(program, corrected.data, machine).report,
        olp.compare(program, [measured], machine).report,
    ]
    for report in reports:
        assert report["machine"] == {"name": "gantry-1600", "chain": "FXYZ", "controller": "linuxcnc"}
        assert report["calibration"]["sha256"] == digest
        assert report["calibration"] == corrected.report["calibration"]
    (folder / "x.csv").write_bytes((folder / "x.csv").read_bytes() + b"\n")
    assert olp.correct(program, machine).report["calibration"]["sha256"] != digest
