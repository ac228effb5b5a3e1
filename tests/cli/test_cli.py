"""The command line as a whole: help of every verb, errors as one sentence, light imports, the small verbs."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result

import olp
from olp.cli import VERBS, common, main
from olp.cli.progress import _Bar, progress
from olp.findings.catalogue import RULES, Finding

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
MACHINE = PROGRAMS / "haas-mill" / "machine.toml"
HEAVY = {"numpy", "pydantic", "rich", "scipy", "matplotlib", "trimesh", "meshcat", "ruckig"}


def run(*args: str | Path, stdin: bytes | None = None) -> Result:
    """A call whose failure is an exit code, never an exception."""
    result = CliRunner().invoke(main, [str(arg) for arg in args], input=stdin)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def imported_by(*args: str) -> set[str]:
    """Top-level packages that a call in a process of its own imports."""
    code = (
        "import sys\nfrom olp.cli import main\n"
        f"try:\n    main({list(args)!r})\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        "print('\\n' + ' '.join({name.partition('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=Path(olp.__file__).parents[1],
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split("\n")[-2].split())


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_that_agrees_with_the_list(verb: str) -> None:
    result = run(verb, "--help")
    assert result.exit_code == 0
    assert result.stdout.startswith(f"Usage: olp {verb}")
    command = main.get_command(click.Context(main), verb)
    assert command is not None
    assert command.name == verb
    for parameter in command.params:
        assert isinstance(parameter, click.Argument) or getattr(parameter, "help", None), parameter.name


def test_help_lists_every_verb() -> None:
    result = run("--help")
    assert result.exit_code == 0
    for verb in VERBS:
        assert f"\n  {verb} " in result.stdout
    assert run("--version").stdout == f"olp, version {olp.__version__}\n"


@pytest.mark.parametrize("args", [["--help"], ["--version"], ["explain"], ["correct", "--help"]])
def test_help_imports_nothing_heavy(args: list[str]) -> None:
    assert not imported_by(*args) & HEAVY


def test_help_imports_no_verb() -> None:
    code = "import sys, olp.cli\nprint(sorted(n for n in sys.modules if n.startswith('olp.cli.')))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=Path(olp.__file__).parents[1],
        check=True,
    )
    assert done.stdout == "['olp.cli.common', 'olp.cli.endings', 'olp.cli.late']\n"


def test_the_module_runs_as_the_command_does() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "olp", "explain", "OLP101"],
        capture_output=True,
        cwd=Path(olp.__file__).parents[1],
        check=True,
    )
    assert done.stdout == run("explain", "OLP101").stdout_bytes


def test_a_wrong_verb_or_option_is_a_wrong_call() -> None:
    result = run("corect")
    assert result.exit_code == 2
    assert "did you mean correct?" in result.stderr
    assert run("correct", "--no-such-option").exit_code == 2
    assert run("simulate", "--step-mm", "nan").exit_code == 2
    assert run("simulate", "--step-mm", "0").exit_code == 2


def test_every_problem_of_a_file_is_a_line_on_stderr(tmp_path: Path) -> None:
    bad = tmp_path / "machine.toml"
    bad.write_text('schema = "olp-machine-1"\nnam = "x"\nchain = "FXYQ"\n')
    result = run("inspect", bad)
    assert result.exit_code == 3
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) > 2
    assert all(line.startswith(f"olp: error: {bad}: ") for line in lines)


@pytest.mark.parametrize(
    ("raised", "code"), [(KeyboardInterrupt(), 130), (BrokenPipeError(), 0)], ids=["interrupt", "pipe"]
)
def test_interrupts_and_closed_pipes_end_quietly(
    raised: BaseException, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise raised

    monkeypatch.setattr("olp.cli.endings.silence", lambda _: None)
    monkeypatch.setattr("olp.cli.explain.put", fail)
    result = run("explain")
    assert result.exit_code == code
    assert "Traceback" not in result.output


def test_a_reader_that_has_gone_is_no_error() -> None:
    """Much output into a pipe that is closed after its first line."""
    process = subprocess.Popen(
        [sys.executable, "-c", "from olp.cli.common import put\nfor _ in range(9): put('x' * 99999 + '\\n')"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=Path(olp.__file__).parents[1],
    )
    assert process.stdout is not None and process.stderr is not None
    process.stdout.read(1)
    process.stdout.close()
    errors = process.stderr.read()
    process.stderr.close()
    assert process.wait() == 0
    assert errors == b""


def test_text_that_the_terminal_cannot_show_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    common.put("Fr\u00e4se\n")
    assert raw.getvalue() == b"Fr?se\n"


@pytest.mark.parametrize(
    ("codes", "fail_on", "fails"),
    [
        ([], "info", False),
        (["OLP103"], "info", True),
        (["OLP103"], "warning", False),
        (["OLP103", "OLP102"], "warning", True),
        (["OLP102"], "error", False),
        (["OLP102", "OLP101"], "error", True),
        (["OLP101"], "never", False),
    ],
)
def test_findings_fail_a_run_from_the_chosen_severity_on(codes: list[str], fail_on: str, fails: bool) -> None:
    with click.Context(main):
        findings = [Finding(code, "text") for code in codes]
        if fails:
            with pytest.raises(click.exceptions.Exit) as caught:
                common.exit_for(findings, fail_on)
            assert caught.value.exit_code == 1
        else:
            common.exit_for(findings, fail_on)


def test_progress_is_for_terminals_and_long_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    with progress(quiet=False) as show:
        assert show is None
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with progress(quiet=True) as show:
        assert show is None
    with progress(quiet=False) as show:
        assert isinstance(show, _Bar)
        show("reading", 0.5)
        assert show._bar is None
        show._began -= 60.0
        show("reading", 0.7)
        assert show._bar is not None and show._bar.tasks[0].completed == 0.7
        show("proving", 0.9)
        assert show._bar.tasks[0].description == "proving"


def test_explain_lists_and_explains_every_code() -> None:
    listed = run("explain").stdout
    for code, rule in RULES.items():
        assert f"{code}  " in listed
        text = run("explain", code.lower()).stdout
        assert rule.title in text
        assert " ".join(rule.remedy.split()) in " ".join(text.split())
    assert {entry["code"] for entry in json.loads(run("explain", "--json").stdout)} == set(RULES)
    wrong = run("explain", "OLP10")
    assert wrong.exit_code == 2
    assert "did you mean OLP1" in wrong.stderr


@pytest.mark.parametrize("kind", ["machine", "calibration", "job"])
def test_schema_is_json(kind: str) -> None:
    assert json.loads(run("schema", kind).stdout)["title"] == f"olp {kind} file"


def test_init_writes_a_set_that_loads_and_never_replaces_it(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "mill"
    result = run("init", folder, "--travel", "X", "-5", "2000", "--chain", "YFXZ", "--controller", "fanuc")
    assert result.exit_code == 0
    assert result.stdout == ""
    summary = json.loads(run("inspect", folder / "machine.toml", "--json").stdout)
    assert summary["machine"]["name"] == "mill"
    assert (summary["machine"]["chain"], summary["machine"]["controller"]) == ("YFXZ", "fanuc")
    assert summary["axes"]["X"]["travel_mm"] == [-5.0, 2000.0]
    before = {path: path.read_bytes() for path in folder.rglob("*.*")}
    again = run("init", folder)
    assert again.exit_code == 2
    assert "exists already" in again.stderr
    assert {path: path.read_bytes() for path in folder.rglob("*.*")} == before
    assert run("init", folder, "--force").exit_code == 0
    assert run("init", folder / "machine.toml").exit_code == 2
    assert run("init", tmp_path / "bad", "--travel", "X", "5", "5").exit_code == 2
    assert not (tmp_path / "bad").exists()
    assert run("init", tmp_path / "bad", "--controller", "mach9").exit_code == 2
    assert not (tmp_path / "bad").exists()


def test_a_cut_below_the_zero_of_a_new_machine_is_corrected(tmp_path: Path) -> None:
    assert run("init", tmp_path / "mill").exit_code == 0
    program = tmp_path / "part.nc"
    program.write_text("G21 G90 G54 G94\nG0 X0 Y0 Z5\nG1 Z-3 F200\nX20\nM2\n")
    words = ("correct", program, "-m", tmp_path / "mill" / "machine.toml", "--fail-on", "never")
    assert run(*words).exit_code == 3, "what init writes is to be filled in first"
    result = run(*words, "--accept", "OLP440,OLP442")
    assert result.exit_code == 0, result.stderr


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (["inspect", "{}/calibration.toml"], "a machine file (olp-machine-1)"),
        (["inspect", "-m", "{}/calibration.toml"], "a machine file (olp-machine-1)"),
        (["inspect", "-m", "{}/machine.toml", "-j", "{}/calibration.toml"], "a job file (olp-job-1)"),
    ],
)
def test_a_file_of_another_kind_is_one_line(tmp_path: Path, call: list[str], expected: str) -> None:
    assert run("init", tmp_path / "mill").exit_code == 0
    result = run(*(word.replace("{}", str(tmp_path / "mill")) for word in call))
    assert result.exit_code == 3
    assert f"this is a calibration (olp-calibration-1); expected {expected}" in result.stderr
    assert result.stderr.count("\n") == 1


INI = """[TRAJ]
COORDINATES = XYZ
LINEAR_UNITS = mm
[KINS]
KINEMATICS = trivkins
""" + "".join(
    f"[AXIS_{axis}]\nMIN_LIMIT = -10\nMAX_LIMIT = 300\nMAX_VELOCITY = 50\nMAX_ACCELERATION = 400\n"
    for axis in "XYZ"
)


def test_init_takes_a_machine_from_linuxcnc_with_its_notes(tmp_path: Path) -> None:
    ini = tmp_path / "mill.ini"
    ini.write_text(INI)
    result = run("init", tmp_path / "out", "--from", ini, "--name", "router", "--travel", "X", "0", "1ft")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(run("inspect", tmp_path / "out" / "machine.toml", "--json").stdout)
    assert summary["machine"]["name"] == "router"
    assert summary["axes"]["Z"]["travel_mm"] == [-10.0, 300.0]
    assert "note: [EMCIO] TOOL_TABLE is not given" in result.stderr
    assert "# [EMCIO] TOOL_TABLE is not given" in (tmp_path / "out" / "machine.toml").read_text()
    assert summary["axes"]["X"]["travel_mm"] == pytest.approx([0.0, 304.8])
    old = run("init", tmp_path / "x", "--from-linuxcnc", ini)
    assert (old.exit_code, "--from-linuxcnc is now --from" in old.stderr) == (2, True)
    assert run("init", tmp_path / "x", "--from", tmp_path / "none.ini").exit_code == 3


def test_inspect_of_a_machine_states_the_size_of_its_errors() -> None:
    summary: dict[str, Any] = json.loads(run("inspect", MACHINE, "--json").stdout)
    sizes = {entry["name"]: entry for entry in summary["position_errors"] + summary["angular_errors"]}
    assert len(sizes) == 18
    assert (sizes["EXX"]["max_um"], sizes["EXX"]["range_um"]) == (pytest.approx(6.3), pytest.approx(7.8))
    assert sizes["EAX"]["max_urad"] == pytest.approx(17.9)
    assert summary["squareness"]["C0Y_urad"] == pytest.approx(-12.0)
    assert summary["axes"]["Y"]["lost_motion_um"] == pytest.approx(3.0)
    text = run("inspect", "-m", MACHINE).stdout
    for words in ("XYFZ", "rigid-body", "EXX", "17.9", "C0Y"):
        assert words in text


@pytest.mark.slow
def test_inspect_draws_the_curves_and_never_over_a_file(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    plot = tmp_path / "curves.svg"
    assert run("inspect", MACHINE, "--plot", plot).exit_code == 0
    assert plot.read_bytes().startswith(b"<?xml")
    assert run("inspect", MACHINE, "--plot", plot).exit_code == 2
    assert run("inspect", MACHINE, "--plot", plot, "--force").exit_code == 0
    unknown = run("inspect", MACHINE, "--plot", tmp_path / "curves.gif")
    assert unknown.exit_code == 2
    assert "expected .svg or .png" in unknown.stderr


def test_inspect_wants_one_machine() -> None:
    assert run("inspect", MACHINE, "-m", MACHINE).exit_code == 2
    assert run("inspect").exit_code == 2
    assert run("inspect", MACHINE, "--tool", "1").exit_code == 2
    assert run("inspect", MACHINE.with_name("none.toml")).exit_code == 3


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        ("--frob", "there is no option"),
        ("correct --frob", "there is no option"),
        ("correct --tolerance-um 5kg", "'5kg' is not a number in um; \"kg\" is not a unit of length"),
        ("correct --tolerance-um -1", "is not in the range"),
        ("inspect --at 1 2 z", "'z' is not a number in mm; expected a number in mm, or a text with its unit"),
        ("inspect --tool 1.5", "'1.5' is not an integer; expected an integer, such as 5"),
        ("init x --travel X 0 2s", "'2s' is not a number in mm; \"s\" is not a unit of length"),
        ("calibrate frob", "there is no verb 'frob'"),
        ("inspect", "no machine file is given"),
    ],
)
def test_a_wrong_call_is_headed_as_every_error(call: str, expected: str) -> None:
    result = run(*call.split())
    assert result.exit_code == 2
    last = result.stderr.splitlines()[-1]
    assert last.startswith("olp: error: ")
    assert expected in last


@pytest.mark.parametrize("call", [(), ("calibrate",)])
def test_a_group_without_a_verb_shows_its_help(call: tuple[str, ...]) -> None:
    result = run(*call)
    assert "Verbs:" in result.output
    assert "olp: error" not in result.output


def test_a_dialect_in_capitals_is_recognised(tmp_path: Path) -> None:
    assert run("init", tmp_path / "mill").exit_code == 0
    (tmp_path / "a.nc").write_text("G0 X1\nM2\n")
    result = run("inspect", tmp_path / "a.nc", "-m", tmp_path / "mill" / "machine.toml", "--dialect", "GRBL")
    assert result.exit_code == 2
    assert "there is no dialect 'GRBL'; did you mean grbl?" in result.stderr


@pytest.mark.parametrize("word", ["--flatten", "--expand-cycles"])
def test_verify_unrolls_the_nominal_program_as_correct_does(word: str, tmp_path: Path) -> None:
    program, machine = tmp_path / "loop.ngc", PROGRAMS / "nasty" / "machine.toml"
    program.write_text(
        "G21 G90 G54 G64 P0.01 Q0\nG43 H1\nG0 X0 Y0 Z20\n#1 = 0\no1 while [#1 lt 3]\n"
        "G81 X[#1 * 20] Y10 Z-5 R2 F200\nG80\n#1 = [#1 + 1]\no1 endwhile\nG1 X50 F600\nM2\n"
    )
    out, report = tmp_path / "out.ngc", tmp_path / "report.json"
    corrected = ["correct", program, "-m", machine, "--flatten", word, "-q", "-o", out, "--report", report]
    assert run(*corrected).exit_code == 0
    call = ["verify", program, out, "-m", machine, "--json"]
    # loops are unrolled unasked
    assert run(*call).exit_code == 0
    verified = run(*call, "--flatten", word)
    assert verified.exit_code == 0, verified.stderr
    stated = json.loads(report.read_text())
    for key in ("program", "verdict", "judgement", "deviation", "worst"):
        assert json.loads(verified.stdout)[key] == stated[key]
    page = tmp_path / "page.html"
    shown = ["view", program, "--corrected", out, "-m", machine, "--flatten", word, "--no-time", "-o", page]
    assert run(*shown).exit_code == 0


def test_simulate_reports_as_json(tmp_path: Path) -> None:
    words = ["simulate", PROGRAMS / "nasty" / "modal.ngc", "-m", PROGRAMS / "nasty" / "machine.toml"]
    report = json.loads(run(*words, "--json").stdout)
    assert report["schema"] == "olp-simulation-1"
    out = tmp_path / "tip.csv"
    again = run(*words, "--json", "-o", out)
    assert json.loads(again.stdout) == report
    points = np.loadtxt(out, delimiter=",", skiprows=2)[:, :3]
    assert report["points"] == len(points)
    assert np.abs(np.array(report["range_mm"]) - [points.min(axis=0), points.max(axis=0)]).max() < 1e-6
    assert run(*words).stdout == out.read_text()
    assert run(*words, "--json", "-o", "-").exit_code == 2


def test_an_argument_that_was_given_as_an_option_is_shown_without_one() -> None:
    said = CliRunner().invoke(main, ["calibrate", "doctor", "a.toml", "--points", "b.csv"]).stderr
    assert "it goes without one: olp calibrate doctor CALIBRATION POINTS.csv" in said
