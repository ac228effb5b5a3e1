"""`olp correct`, `verify`, `simulate`, `inspect`: where inputs come from, what goes where, exit codes."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import pytest
from cli.test_cli import HEAVY, MACHINE, PROGRAMS, imported_by, run
from click.testing import CliRunner
from reports.test_report import REPORT

from olp.cli import main
from olp.core.errors import NotInvertible, OutsideBox, ProgramError
from olp.files.sources import Source
from olp.findings.catalogue import Finding
from olp.reports.report import to_text
from olp.workflows.session import Session

ABOVE = Finding("OLP101", "2.50 um in line 3", 3)
CORRECTED = b"(stamp)\r\nG21\r\nG1 X1.0123 F100\r\n"


@dataclass
class Fake:
    """Stands in for the library, and keeps what it was called with."""

    findings: tuple[Finding, ...] = ()
    raises: Exception | None = None
    calls: list[tuple[tuple[Any, ...], dict[str, Any]]] = field(default_factory=list)
    text: bytes = CORRECTED
    plain: bytes = CORRECTED
    nominal: bytes = b"G21\r\nG1 X1. F100\r\n"
    report: dict[str, Any] = field(default_factory=lambda: dict(REPORT))

    def __call__(self, session: Session, *args: Any) -> Fake:
        """Kept are texts and setup, and the options with the progress that is asked for."""
        count = sum(isinstance(value, Source) for value in args)
        texts = (source.name or source.data for source in args[:count])
        progress = args[count + 1] if len(args) > count + 1 else None
        self.calls.append(((*texts, session.setup), asdict(args[count]) | {"progress": progress}))
        if self.raises is not None:
            raise self.raises
        return self

    def to_text(self) -> str:
        return to_text(self.report)


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> Fake:
    fake = Fake()
    for name in ("correct", "verify"):
        monkeypatch.setattr(f"olp.workflows.{name}.run", fake)
    return fake


@pytest.fixture
def mill(tmp_path: Path) -> Path:
    """A copy of the mill with a small program, in a folder of its own."""
    folder = tmp_path / "mill"
    shutil.copytree(PROGRAMS / "haas-mill", folder)
    (folder / "small.nc").write_bytes(b"G21\r\nG1 X1. F100\r\n")
    (folder / "job.toml").write_text('schema = "olp-job-1"\nprogram = "small.nc"\nmachine = "machine.toml"\n')
    return folder


def test_the_default_output_stands_beside_the_program(mill: Path, library: Fake) -> None:
    result = run("correct", mill / "small.nc", "-m", mill / "machine.toml")
    assert result.exit_code == 0
    assert (mill / "small.corrected.nc").read_bytes() == CORRECTED
    assert "Within tolerance" in result.stdout
    assert result.stderr == f"wrote {mill / 'small.corrected.nc'}\n"


def test_program_and_machine_may_come_from_the_job(mill: Path, library: Fake) -> None:
    assert run("correct", "-j", mill / "job.toml").exit_code == 0
    program, setup = library.calls[0][0]
    assert Path(program).samefile(mill / "small.nc")
    assert setup.machine.name == "mill-30-16"
    run("correct", "other.nc", "-j", mill / "job.toml", "-o", mill / "out.nc")
    assert library.calls[1][0][0] == "other.nc"
    other = mill / "other.toml"
    other.write_text((mill / "machine.toml").read_text().replace("mill-30-16", "another"))
    run("correct", mill / "small.nc", "-m", other, "-j", mill / "job.toml", "-o", mill / "out2.nc")
    assert library.calls[2][0][1].machine.name == "another"


@pytest.mark.parametrize(
    "args",
    [["correct"], ["correct", "small.nc"], ["simulate"], ["verify", "a", "b"], ["correct", "-m", MACHINE]],
)
def test_what_is_missing_is_asked_for(args: list[str | Path]) -> None:
    result = run(*args)
    assert result.exit_code == 2
    assert result.stderr.startswith("olp: error: no ")


def test_options_reach_the_library(mill: Path, library: Fake) -> None:
    flags = ["--flatten", "--expand-cycles", "--contour", "path", "--split-rapids", "--times"]
    flags += ["--only-sure-components", "--part-tolerance-um", "7.5"]
    options = ["--tolerance-um", "2.5", "--outside-box", "hold", "--date", "2027-01-31"]
    options += ["--accept", "OLP409,OLP401", "--accept", "OLP440"]
    assert run("correct", "-j", mill / "job.toml", *flags, *options).exit_code == 0
    passed = dict(library.calls[0][1])
    assert passed.pop("date").isoformat() == "2027-01-31"
    assert passed == {
        "tolerance_um": 2.5, "outside_box": "hold", "flatten": True, "expand_cycles": True, "contour": "path",
        "split_rapids": True, "times": True, "peck_clearance_mm": None, "progress": None,
        "part_tolerance_um": 7.5, "only_sure_components": True, "accept": ("OLP409", "OLP401", "OLP440"),
    }  # fmt: skip
    run("correct", "-j", mill / "job.toml", "--force")
    assert library.calls[1][1]["date"] is None, "no run reads the clock"


def test_above_tolerance_the_program_is_written_and_the_exit_code_is_1(mill: Path, library: Fake) -> None:
    library.findings = (ABOVE,)
    assert run("correct", "-j", mill / "job.toml").exit_code == 1
    assert (mill / "small.corrected.nc").read_bytes() == CORRECTED
    assert run("correct", "-j", mill / "job.toml", "--force", "--fail-on", "never").exit_code == 0


def test_nothing_is_overwritten_without_force(mill: Path, library: Fake) -> None:
    output, report = mill / "out.nc", mill / "report.json"
    args = ["correct", "-j", mill / "job.toml", "-o", output, "--report", report]
    report.write_bytes(b"kept")
    result = run(*args)
    assert result.exit_code == 2
    assert "exists already" in result.stderr
    assert library.calls == [], "refused before the work"
    assert report.read_bytes() == b"kept"
    assert not output.exists()
    nowhere = run("correct", "-j", mill / "job.toml", "-o", mill / "none" / "out.nc")
    assert (nowhere.exit_code, library.calls) == (2, [])
    assert "there is no folder" in nowhere.stderr
    assert run(*args, "--force").exit_code == 0
    assert json.loads(report.read_bytes())["schema"] == "olp-report-1"


@pytest.mark.parametrize(
    "name", ["small.nc", "machine.toml", "job.toml", "../mill/small.nc", "calibration.toml", "x.csv"]
)
def test_an_input_is_never_the_output(name: str, mill: Path, library: Fake) -> None:
    before = (mill / name).read_bytes()
    result = run("correct", "-j", mill / "job.toml", "-o", mill / name, "--force")
    assert result.exit_code == 2
    assert "never overwritten" in result.stderr
    assert (mill / name).read_bytes() == before


def test_dashes_are_stdin_and_stdout(mill: Path, library: Fake) -> None:
    result = run("correct", "-", "-m", mill / "machine.toml", stdin=b"G1 X1.\r\n")
    assert result.exit_code == 0
    assert library.calls[0][0][0] == b"G1 X1.\r\n"
    assert result.stdout_bytes == CORRECTED, "the program alone, byte for byte"
    assert "Within tolerance" in result.stderr
    assert sorted(path.name for path in mill.iterdir() if "corrected" in path.name) == []


def test_json_is_all_that_stdout_holds(mill: Path, library: Fake) -> None:
    result = run("correct", "-j", mill / "job.toml", "--json")
    assert json.loads(result.stdout) == json.loads(json.dumps(REPORT))
    for args in (["-o", "-"], ["--diff"]):
        assert run("correct", "-j", mill / "job.toml", "--json", *args).exit_code == 2


def test_quiet_says_nothing(mill: Path, library: Fake) -> None:
    result = run("correct", "-j", mill / "job.toml", "--quiet")
    assert (result.exit_code, result.output) == (0, "")


def test_the_diff_shows_what_changed(mill: Path, library: Fake) -> None:
    result = run("correct", "-j", mill / "job.toml", "--diff", "--quiet")
    assert "   2  G1 X1. F100" in result.stdout
    assert "X+12.3" in result.stdout
    assert "1 changed, 1 inserted, 0 left out" in result.stdout
    assert "\x1b" not in result.stdout


@pytest.mark.parametrize(
    ("raised", "code"),
    [
        (ProgramError("G5.1 is a spline; take it out", line=7), 3),
        (OutsideBox("X = 900 lies outside; stay inside", file="small.nc", line=3), 3),
        (NotInvertible("no command reaches the target"), 4),
    ],
)
def test_errors_are_one_sentence_and_write_nothing(
    raised: Exception, code: int, mill: Path, library: Fake
) -> None:
    library.raises = raised
    result = run("correct", "-j", mill / "job.toml")
    assert result.exit_code == code
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("olp: error: ")
    assert not (mill / "small.corrected.nc").exists()


def test_an_error_in_stdin_names_it_with_its_line(mill: Path, library: Fake) -> None:
    library.raises = ProgramError("G5.1 is a spline; take it out", line=7)
    result = run("correct", "-", "-m", mill / "machine.toml", stdin=b"")
    assert result.stderr == "olp: error: <stdin>:7: G5.1 is a spline; take it out\n"


def test_an_interrupt_is_130_and_writes_nothing(mill: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("olp.workflows.correct.run", interrupted)
    result = CliRunner().invoke(main, ["correct", "-j", str(mill / "job.toml")])
    assert result.exit_code == 130
    assert not (mill / "small.corrected.nc").exists()


def test_verify_passes_both_texts_and_fails_on_findings(mill: Path, library: Fake) -> None:
    args = ["verify", mill / "small.nc", "-", "-j", mill / "job.toml"]
    result = run(*args, stdin=CORRECTED)
    assert result.exit_code == 0
    assert "Within tolerance" in result.stdout
    nominal, corrected, setup = library.calls[0][0]
    assert (nominal, corrected) == (str(mill / "small.nc"), CORRECTED)
    assert setup.machine.name == "mill-30-16"
    library.findings = (ABOVE,)
    failed = run(*args, "--json", stdin=CORRECTED)
    assert failed.exit_code == 1
    assert json.loads(failed.stdout)["schema"] == "olp-report-1"
    assert run("verify", "-", "-", "-m", "m.toml").exit_code == 2


JOB = PROGRAMS / "bridge-cmm" / "job.toml"
PROGRAM = PROGRAMS / "bridge-cmm" / "housing.ngc"


def test_a_real_program_goes_all_the_way(tmp_path: Path) -> None:
    output, report = tmp_path / "out.ngc", tmp_path / "report.json"
    result = run("correct", "-j", JOB, "-o", output, "--report", report, "--diff")
    assert result.exit_code == 0, result.output
    assert "Within tolerance" in result.stdout
    assert ", 0 left out" in result.stdout
    stated = json.loads(report.read_bytes())
    assert f"{stated['moves']['inserted_blocks'] + 1} inserted" in result.stdout, "the blocks and the stamp"
    after = stated["deviation"]["after"]["waypoints"]["max_um"]
    assert after < stated["deviation"]["before"]["waypoints"]["max_um"]
    assert str(tmp_path) not in report.read_text()
    assert str(PROGRAMS) not in report.read_text()

    verified = run("verify", PROGRAM, output, "-j", JOB, "--json")
    assert verified.exit_code == 0, verified.output
    assert json.loads(verified.stdout)["deviation"]["after"]["waypoints"]["max_um"] == pytest.approx(after)
    again = run("correct", output, "-j", JOB, "-o", "-")
    assert again.exit_code == 3
    assert again.stdout_bytes == b""


def test_an_uncorrected_program_does_not_pass_for_a_corrected_one() -> None:
    result = run("verify", PROGRAM, PROGRAM, "-j", JOB)
    assert result.exit_code == 1
    assert "OLP101" in result.stdout
    assert "ABOVE TOLERANCE" in result.stdout


def test_stdin_gives_the_bytes_that_the_file_gives(tmp_path: Path) -> None:
    assert run("correct", PROGRAM, "-j", JOB, "-o", tmp_path / "out.ngc", "-q").exit_code == 0
    piped = run("correct", "-", "-j", JOB, "-q", stdin=PROGRAM.read_bytes())
    assert piped.exit_code == 0
    assert piped.stdout_bytes == (tmp_path / "out.ngc").read_bytes()


def test_an_expired_calibration_is_refused_unless_it_is_accepted(tmp_path: Path) -> None:
    args = ["correct", "-j", JOB, "-o", tmp_path / "out.ngc", "--date", "2099-01-01"]
    refused = run(*args)
    assert refused.exit_code == 3
    assert "OLP401" in refused.stderr
    assert not (tmp_path / "out.ngc").exists()
    accepted = run(*args, "--accept", "OLP401")
    assert accepted.exit_code == 0
    assert "OLP401  warning" in accepted.stdout
    assert run(*args, "--accept", "OLP401", "--force", "--fail-on", "warning").exit_code == 1


def test_simulate_writes_a_path_with_its_frame(tmp_path: Path) -> None:
    job, output = PROGRAMS / "haas-mill" / "job.toml", tmp_path / "measured.csv"
    result = run("simulate", "-j", job, "-o", output, "--step-mm", "20")
    assert result.exit_code == 0, result.output
    text = output.read_text()
    assert "# frame=" in text
    assert "X_mm,Y_mm,Z_mm" in text
    assert run("simulate", "-j", job, "-o", output).exit_code == 2
    piped = run("simulate", "-j", job, "--step-mm", "20")
    assert piped.stdout_bytes == output.read_bytes()


def test_inspect_of_a_program_and_of_a_point() -> None:
    job = PROGRAMS / "haas-mill" / "job.toml"
    summary = json.loads(run("inspect", "-j", job, "--json").stdout)
    assert summary["dialect"] == "haas"
    text = run("inspect", PROGRAMS / "haas-mill" / "bracket.nc", "-j", job)
    assert text.exit_code == 0
    assert "haas" in text.stdout
    point = run("inspect", "-j", job, "--at", "-300", "-100", "-200", "--tool", "1", "--json")
    assert point.exit_code == 0, point.output
    assert len(json.loads(point.stdout)["error_um"]) == 3
    assert run("inspect", "-j", job, "--at", "-300", "-100", "-200").exit_code == 0


@pytest.mark.slow
def test_correct_imports_no_more_than_it_needs(tmp_path: Path) -> None:
    imported = imported_by("correct", "-j", str(JOB), "-o", str(tmp_path / "out.ngc"))
    assert "numpy" in imported
    assert not imported & (HEAVY - {"numpy"})
