"""`olp compare`: what goes in, what comes out, exit codes, and every finding with and without its cause."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli.test_cli import PROGRAMS, run

from olp.core.rigid_fit import Rigid, rotation_of
from olp.files.config import load_job

MACHINE = PROGRAMS / "nasty" / "machine.toml"
PROGRAM = PROGRAMS / "nasty" / "arc-centres.ngc"
RNG = np.random.default_rng(3)


def table(points: np.ndarray, frame: str = "") -> str:
    rows = [f"{x:.6f},{y:.6f},{z:.6f}" for x, y, z in points]
    return "\n".join([*([f"# frame={frame}"] if frame else []), "X_mm,Y_mm,Z_mm", *rows]) + "\n"


def bent(count: int, start: float = 0.0, end: float = 6.0) -> np.ndarray:
    """An open path without symmetry; crosses nothing."""
    u = np.linspace(start, end, count)
    return np.column_stack((60 * u, 80 * np.sin(u) + 3 * u * u, 10 * np.cos(2 * u)))


@pytest.fixture
def nominal(tmp_path: Path) -> Path:
    path = tmp_path / "nominal.csv"
    path.write_text(table(bent(3000)))
    return path


def compared(
    nominal: Path, points: np.ndarray, *words: object, frame: str = ""
) -> tuple[int, dict[str, Any]]:
    measured = nominal.with_name("measured.csv")
    measured.write_text(table(points, frame))
    result = run("compare", nominal, measured, "--json", *words)
    return result.exit_code, json.loads(result.stdout) if result.stdout else {}


def codes(report: dict[str, Any]) -> set[str]:
    return {f["code"] for f in report["findings"]}


@pytest.mark.slow
def test_a_clean_run_has_no_findings(nominal: Path) -> None:
    code, report = compared(nominal, bent(4000) + np.array((0.0, 0.0, 0.01)), "--part-tolerance-um", 12)
    assert (code, codes(report)) == (0, set())
    assert report["holds"] is True
    assert report["after"]["across_um"]["max"] == pytest.approx(10, abs=0.3)
    assert report["after"]["iso_9283"]["AT_um"] == pytest.approx(10, abs=0.3)
    assert report["after"]["iso_9283"]["RT_um"] is None


@pytest.mark.slow
@pytest.mark.parametrize("ending", (".txt", ".md", ".html"))
def test_one_set_of_runs_is_measured_and_not_said_to_be_corrected(nominal: Path, ending: str) -> None:
    once, again = (nominal.with_name(f"{name}.csv") for name in ("once", "again"))
    once.write_text(table(bent(500) + np.array((0.0, 0.0, 0.01))))
    again.write_text(table(bent(400) + np.array((0.0, 0.0, 0.02))))

    def report(*words: object) -> str:
        if ending == ".txt":
            return run("compare", nominal, once, *words).stdout
        file = nominal.with_name(f"report{ending}")
        assert run("compare", nominal, once, *words, "--report", file, "--force").exit_code == 0
        return file.read_text("utf-8")

    alone, both = report().lower(), report("--before", again).lower()
    assert "measured" in alone
    assert "corrected" not in alone
    assert "measured, uncorrected" in both
    labelled = re.sub(r"measured, (un)?corrected|uncorrected and corrected, in um", "", both)
    assert "corrected" not in labelled


@pytest.mark.slow
def test_wrong_pairing(nominal: Path) -> None:
    code, report = compared(nominal, bent(2000)[::-1] * (1, -1, 1), "--align", "none")
    assert code == 1
    assert "OLP601" in codes(report)
    assert report["after"]["runs"][0]["across_um"] is None
    assert "across_um" not in report["after"]


@pytest.mark.slow
def test_points_left_out(nominal: Path) -> None:
    points = bent(2000)
    points[500] += 5.0
    assert codes(compared(nominal, points)[1]) == {"OLP602"}
    assert compared(nominal, points, "--fail-on", "warning")[0] == 1
    points[500] -= 4.5
    assert codes(compared(nominal, points)[1]) == set()


@pytest.mark.slow
def test_part_not_measured(nominal: Path) -> None:
    points = bent(2000)
    assert codes(compared(nominal, np.concatenate((points[:800], points[900:])))[1]) == {"OLP603"}
    assert codes(compared(nominal, np.concatenate((points[:800], points[805:])))[1]) == set()


@pytest.mark.slow
def test_fit_takes_the_error(nominal: Path) -> None:
    turned = Rigid(rotation_of(np.array((0, 0, 1e-4))), np.array((0.01, 0, 0)))(bent(2000))
    assert codes(compared(nominal, turned, "--align", "fit")[1]) == {"OLP604", "OLP611"}
    wavy = bent(2000)
    wavy[:, 2] += 0.02 * np.sin(np.linspace(0, 100, 2000))
    assert codes(compared(nominal, wavy, "--align", "fit")[1]) == {"OLP611"}


@pytest.mark.slow
def test_frame_not_determined(tmp_path: Path) -> None:
    x = np.linspace(0, 300, 500)
    line = np.column_stack((x, 0 * x, 0 * x))
    path = tmp_path / "line.csv"
    path.write_text(table(line))
    _, report = compared(path, line + np.array((0, 0.3, 0)), "--align", "fit")
    assert "OLP605" in codes(report)
    assert "shift in X" in report["frame"]["not_determined"]


@pytest.mark.slow
def test_order_of_points(nominal: Path) -> None:
    _, report = compared(nominal, bent(700)[::-1])
    assert codes(report) == {"OLP606"}
    assert report["frame"]["order"] == ["backward"]
    shuffled = RNG.permutation(bent(700))
    assert codes(compared(nominal, shuffled)[1]) == {"OLP606"}
    assert codes(compared(nominal, shuffled, "--order", "forward")[1]) >= {"OLP601"}


@pytest.mark.slow
def test_crossings_without_order_are_in_doubt(tmp_path: Path) -> None:
    u = np.linspace(0, 2 * np.pi, 3000)
    eight = np.column_stack((200 * np.sin(u), 100 * np.sin(2 * u), 0 * u))
    path = tmp_path / "eight.csv"
    path.write_text(table(eight))
    _, report = compared(path, RNG.permutation(eight[::2]) + np.array((0, 0, 0.02)))
    assert {"OLP606", "OLP608"} <= codes(report)
    assert codes(compared(path, eight[::2] + np.array((0, 0, 0.02)))[1]) == set()


@pytest.mark.slow
def test_cycles_and_tolerance(nominal: Path, tmp_path: Path) -> None:
    files = []
    for i in range(10):
        files.append(tmp_path / f"run{i}.csv")
        files[-1].write_text(table(bent(600) + np.array((0, 0, 0.001 * i))))
    few = json.loads(run("compare", nominal, *files[:3], "--json").stdout)
    assert codes(few) == {"OLP607"}
    # z = 0, 1, 2 um: barycentre 1 um, distances 1, 0, 1 um
    mean, spread = 2 / 3, np.sqrt(1 / 3)
    assert few["after"]["iso_9283"]["RT_um"] == pytest.approx(mean + 3 * spread, abs=0.05)
    assert codes(json.loads(run("compare", nominal, *files, "--json").stdout)) == set()
    result = run("compare", nominal, files[9], "--before", files[1], "--part-tolerance-um", 5)
    assert result.exit_code == 1
    assert "OLP609" in result.stdout
    assert run("compare", nominal, files[4], "--part-tolerance-um", 5).exit_code == 0


def test_frames_that_files_state_never_mix(tmp_path: Path) -> None:
    path = tmp_path / "n.csv"
    path.write_text(table(bent(100), "G54"))
    other = tmp_path / "m.csv"
    other.write_text(table(bent(100), "G55"))
    result = run("compare", path, other)
    assert result.exit_code == 3
    assert "G54" in result.stderr
    assert "G55" in result.stderr


@pytest.mark.slow
def test_a_program_before_and_after(tmp_path: Path) -> None:
    for name, words in (("raw.csv", [PROGRAM]), ("good.csv", [tmp_path / "c.ngc"])):
        if name == "good.csv":
            assert run("correct", PROGRAM, "-m", MACHINE, "-q", "-o", tmp_path / "c.ngc").exit_code == 0
        assert run("simulate", *words, "-m", MACHINE, "--step-mm", 0.2, "-o", tmp_path / name).exit_code == 0
    words = ["compare", PROGRAM, tmp_path / "good.csv", "--before", tmp_path / "raw.csv", "-m", MACHINE]
    result = run(*words, "-o", tmp_path / "d.csv", "--json")
    report = json.loads(result.stdout)
    assert not codes(report) & {"OLP601", "OLP602", "OLP603"}
    assert report["before"]["across_um"]["max"] > 10 * report["after"]["across_um"]["max"]
    head, *rows = (tmp_path / "d.csv").read_text().splitlines()
    assert head.split(",")[-5:] == ["along_um", "normal_um", "binormal_um", "counted", "size_um"]
    assert len(rows) == sum(part["points"] for part in (*report["measured"], *report["measured_before"]))
    assert run(*words, "-o", tmp_path / "d.csv").exit_code == 2, "exists already"
    # from anywhere in space: what the fit leaves is what the calibration says that a fit would leave
    points = np.loadtxt(tmp_path / "raw.csv", delimiter=",", skiprows=2)[:, :3]
    away = Rigid(rotation_of(np.array((0.3, -1.1, 2.0))), np.array((3000.0, -1500.0, 700.0)))
    (tmp_path / "tracker.csv").write_text(table(away(points)))
    tracked = json.loads(run("compare", PROGRAM, tmp_path / "tracker.csv", "-m", MACHINE, "--json").stdout)
    assert codes(tracked) >= {"OLP611"}
    assert "OLP601" not in codes(tracked)
    frame = tracked["frame"]
    assert frame["left_by_fit_rms_um"] < frame["error_rms_um"]
    # the fit is of all moves, rapids too, and the figures are of cutting ones
    rms_um = tracked["after"]["across_um"]["rms"]
    assert rms_um == pytest.approx(frame["left_by_fit_rms_um"], rel=0.5, abs=0.3)


@pytest.mark.parametrize(("words", "message"), [
    (["compare", PROGRAM, "x.csv"], "no such file"),
    (["compare", "n", "m", "--report", "r.pdf"], ".html, .json, .md"),
    (["compare", "n", "m", "--part-frame", "f.toml"], "--poses"),
    (["compare", "n", "m", "--poses", "-o", "d.csv"], "--poses has none; use --report"),
])  # fmt: skip
def test_calls_that_cannot_be_right(words: list[object], message: str) -> None:
    result = run(*words)
    assert result.exit_code in (2, 3)
    assert message in result.stderr


def test_a_program_needs_its_machine(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(table(bent(10)))
    result = run("compare", PROGRAM, tmp_path / "m.csv")
    assert result.exit_code == 2
    assert "-m" in result.stderr
    words = ["compare", PROGRAM, tmp_path / "m.csv", "-m", MACHINE, "--add-errors"]
    assert 'positions = "axes"' in run(*words).stderr


POSES = np.array(((0, 0, 0), (400, 0, 0), (400, 300, 0), (0, 300, 50.0)))


def named(points: np.ndarray) -> str:
    rows = (f"P{i},{x:.6f},{y:.6f},{z:.6f}" for i, (x, y, z) in enumerate(points, 1))
    return "name,X_mm,Y_mm,Z_mm\n" + "\n".join(rows) + "\n"


def test_poses_and_the_frame_of_a_part(tmp_path: Path) -> None:
    nominal, measured = tmp_path / "n.csv", tmp_path / "m.csv"
    nominal.write_text(named(POSES))
    rigid = Rigid(rotation_of(np.array((0.001, -0.002, 0.5))), np.array((212.4, 161.0, -398.75)))
    measured.write_text(named(rigid(POSES)))
    frame = tmp_path / "frame.toml"
    result = run("compare", nominal, measured, "--poses", "--part-frame", frame, "--json")
    report = json.loads(result.stdout)
    assert codes(report) == {"OLP611"}
    assert report["after"]["iso_9283"]["AP_um"] < 0.01
    job = tmp_path / "job.toml"
    job.write_text('schema = "olp-job-1"\n' + frame.read_text())
    offset = load_job(job).work_offsets["G54"]
    assert offset.offset_mm == pytest.approx(rigid.shift_mm, abs=1e-5)
    assert offset.rotation_deg == pytest.approx(rigid.angles_deg, abs=1e-6)
    nominal.write_text(named(POSES[:2]))
    assert run("compare", nominal, measured, "--poses", "--part-frame", tmp_path / "f2.toml").exit_code == 4


def test_cycles_of_poses_in_one_file_by_name_and_by_row(tmp_path: Path) -> None:
    nominal, measured = tmp_path / "n.csv", tmp_path / "m.csv"
    nominal.write_text(named(POSES))
    cycles = [POSES + np.array((0.001 * k, 0, 0)) for k in (-1, 0, 1)]
    shuffled = "".join(line for c in cycles for line in named(c[::1]).splitlines(True)[1:][::-1])
    measured.write_text("name,X_mm,Y_mm,Z_mm\n" + shuffled)
    report = json.loads(run("compare", nominal, measured, "--poses", "--json").stdout)
    iso = report["after"]["iso_9283"]
    assert (iso["cycles"], codes(report)) == (3, {"OLP607"})
    assert iso["AP_um"] == pytest.approx(0, abs=1e-6)
    assert iso["RP_um"] == pytest.approx(2 / 3 + 3 * np.sqrt(1 / 3), abs=1e-6)
    nominal.write_text(table(POSES))
    measured.write_text(table(np.concatenate(cycles)))
    again = json.loads(run("compare", nominal, measured, "--poses", "--json").stdout)
    assert again["after"]["iso_9283"]["RP_um"] == pytest.approx(iso["RP_um"])
    measured.write_text(table(np.concatenate(cycles)[:-1]))
    assert run("compare", nominal, measured, "--poses").exit_code == 3
    measured.write_text(table(POSES[::-1]))
    wrong = run("compare", nominal, measured, "--poses", "--align", "none", "--json")
    assert wrong.exit_code == 1
    assert codes(json.loads(wrong.stdout)) == {"OLP601"}


@pytest.mark.slow
def test_a_profile_is_saved_and_used(nominal: Path, tmp_path: Path) -> None:
    measured = tmp_path / "tracker.txt"
    rows = "\n".join(
        f"{i};{x / 1e3:.9f};{y / 1e3:.9f};{z / 1e3:.9f}" for i, (x, y, z) in enumerate(bent(1000))
    )
    measured.write_text("n;East;North;Up\n" + rows.replace(".", ",") + "\n")
    columns = [
        w
        for axis, name in zip("XYZ", ("East", "North", "Up"), strict=True)
        for w in ("--column", f"{axis}={name}")
    ]
    profile = tmp_path / "tracker.toml"
    profile.write_text('schema = "olp-points-1"\ndelimiter = "semicolon"\ndecimal = "comma"\n')
    saved = tmp_path / "saved.toml"
    first = run(
        "compare",
        nominal,
        measured,
        "--profile",
        profile,
        *columns,
        "--unit",
        "m",
        "--save-profile",
        saved,
        "--json",
    )
    assert first.exit_code == 0
    second = run("compare", nominal, measured, "--profile", saved, "--json")
    assert second.stdout == first.stdout
    assert json.loads(first.stdout)["after"]["across_um"]["max"] < 0.2


FORMS = {".html": b"<!DOCTYPE html>", ".md": b"# ", ".json": b"{"}


@pytest.mark.slow
@pytest.mark.parametrize("ending", FORMS)
@pytest.mark.parametrize("verb", ["correct", "compare"])
def test_reports_in_three_forms(verb: str, ending: str, tmp_path: Path) -> None:
    report = tmp_path / f"r{ending}"
    # its motion is planned for the report
    program = PROGRAM if verb == "compare" else PROGRAM.with_name("modal.ngc")
    words: list[object] = [
        "correct",
        program,
        "-m",
        MACHINE,
        "-q",
        "-o",
        tmp_path / "c.ngc",
        "--date",
        "2026-11-21",
    ]
    if verb == "compare":
        assert run("simulate", PROGRAM, "-m", MACHINE, "-o", tmp_path / "raw.csv").exit_code == 0
        words = ["compare", PROGRAM, tmp_path / "raw.csv", "-m", MACHINE, "-q", "--date", "2026-11-21"]
    assert run(*words, "--report", report).exit_code == 0
    data = report.read_bytes()
    assert data.startswith(FORMS[ending])
    text = data.decode()
    if ending == ".json":
        values = json.loads(text)
        assert [c["plane"] for c in values["test_paths"]["circles"]] == ["XY", "YZ", "ZX"]
        assert len(values["test_paths"]["diagonals"]["rows"]) == 4
        return
    for heading in ("Result", "Machine tool and numerical controller", "Determination of the errors",
                    "Validation",
                    "ISO 230-4", "ISO 230-6", "Findings and limits", "Documentation", "SHA-256"):  # fmt: skip
        assert heading in text
    assert "olp" in text
    if ending == ".html":
        # nothing to load: no scripts, and no address but names of XML
        assert "<script" not in text
        assert not re.search(r'(?:src|href)="(?!#|data:)', text)
        assert set(re.findall(r"https?://[^\"' )<]+", text)) <= {
            "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink",
            "http://www.w3.org/1999/02/22-rdf-syntax-ns#", "http://creativecommons.org/ns#",
            "http://purl.org/dc/elements/1.1/", "http://purl.org/dc/dcmitype/StillImage", "https://matplotlib.org/",
        }  # fmt: skip
        assert text.count("<svg") >= 5
        ids = re.findall(r'<clipPath id="([^"]+)"', text)
        assert len(ids) == len(set(ids)), "ids of two plots would mix"


@pytest.mark.slow
def test_text_of_a_program_is_no_markup(tmp_path: Path) -> None:
    program = tmp_path / "a.ngc"
    program.write_text(
        "G21 G90 G54 G64 P0.001 Q0\nG0 X10 Y10 Z5\n(<script>|*x*</script>) G1 X90 Y70 F600\nM2\n"
    )
    for ending in (".html", ".md"):
        report = tmp_path / f"r{ending}"
        assert (
            run(
                "correct",
                program,
                "-m",
                MACHINE,
                "-q",
                "-o",
                tmp_path / "o.ngc",
                "--force",
                "--report",
                report,
            ).exit_code
            == 0
        )
        assert "<script>" not in report.read_text()


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("align", ["auto", "fit", "each"])
def test_so_few_points_always_fit(nominal: Path, count: int, align: str) -> None:
    few = bent(4)[:count] + np.array((500.0, 0.0, 0.0))
    measured = nominal.with_name("measured.csv")
    measured.write_text(table(few))
    result = run("compare", nominal, measured, "--align", align, "--part-tolerance-um", "5")
    assert (result.exit_code, result.stdout) == (4, "")
    assert f"measured.csv: {count} points are too few for a best fit" in result.stderr
    assert "--align none" in result.stderr


def test_few_points_in_the_nominal_frame_are_as_they_are(nominal: Path) -> None:
    code, report = compared(nominal, bent(3000)[[700]] + np.array((0, 0, 0.01)), "--part-tolerance-um", 12)
    assert (code, codes(report), report["holds"]) == (0, {"OLP603"}, True)
    assert report["after"]["across_um"]["max"] == pytest.approx(10, abs=0.3)


@pytest.mark.slow
def test_nothing_that_counts_is_no_pass(tmp_path: Path) -> None:
    """A run along a rapid alone, fitted or not, shows no tolerance to hold, and no nan."""
    program, measured = tmp_path / "p.ngc", tmp_path / "m.csv"
    program.write_text("G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG0 X100 Y80\nX0 Y90 Z0\nG1 X-10 F600\nM2\n")
    points = np.array(((0, 0, 20), (50, 40, 20), (100, 80, 20), (80, 82, 16), (50, 85, 10.0), (20, 88, 4)))
    measured.write_text(table(points))
    for align in ("none", "fit"):
        words = ["compare", program, measured, "-m", MACHINE, "--align", align]
        result = run(*words, "--part-tolerance-um", "5")
        assert result.exit_code == 1
        assert "Not verified: no measured point of m.csv counts." in result.stdout
        report = json.loads(run(*words, "--part-tolerance-um", "5", "--json").stdout)
        assert report["holds"] is False
        assert "OLP609" in codes(report)
        for text in (result.stdout, json.dumps(report)):
            assert not re.search(r"\bnan\b", text, re.IGNORECASE)
        assert "holds" not in json.loads(run(*words, "--json").stdout)


def test_poses_that_make_no_frame_keep_their_report(tmp_path: Path) -> None:
    nominal, measured = tmp_path / "n.csv", tmp_path / "m.csv"
    line = np.array(((0, 0, 0), (100, 0, 0), (200, 0, 0), (300, 0, 0.0)))
    nominal.write_text(named(line))
    # the second pose is measured in no cycle, the third in one only
    rows = named(line + np.array((0, 0, 0.02))).splitlines()
    measured.write_text("\n".join([rows[0], rows[1], rows[3], rows[4], rows[1], rows[4]]) + "\n")
    result = run("compare", nominal, measured, "--poses", "--json")
    report = json.loads(result.stdout)
    assert (result.exit_code, codes(report)) == (0, {"OLP603", "OLP607"})
    assert report["after"]["iso_9283"]["AP_um"] == pytest.approx(20)
    frame = tmp_path / "f.toml"
    refused = run("compare", nominal, measured, "--poses", "--part-frame", frame)
    assert (refused.exit_code, frame.exists()) == (4, False)
    assert "lie on one line" in refused.stderr


def test_a_pose_named_twice_is_of_the_nominal_file(tmp_path: Path) -> None:
    nominal, measured = tmp_path / "n.csv", tmp_path / "m.csv"
    nominal.write_text(named(POSES).replace("P2", "P1"))
    measured.write_text(named(POSES))
    result = run("compare", nominal, measured, "--poses")
    assert result.exit_code == 3
    assert f'{nominal}: the nominal pose "P1" is defined twice' in result.stderr


def test_a_nominal_table_may_begin_with_a_mark_of_its_encoding(nominal: Path, tmp_path: Path) -> None:
    measured = tmp_path / "measured.csv"
    measured.write_text(table(bent(400)))
    plain = json.loads(run("compare", nominal, measured, "--json").stdout)
    nominal.write_bytes(b"\xef\xbb\xbf" + nominal.read_bytes())
    result = run("compare", nominal, measured, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["after"] == plain["after"]


def test_errors_are_added_to_a_program_only(nominal: Path) -> None:
    measured = nominal.with_name("measured.csv")
    measured.write_text(table(bent(400)))
    words = ["--add-errors", "--positions", "axes"]
    result = run("compare", nominal, measured, *words)
    assert result.exit_code == 2
    assert "give a program as NOMINAL" in result.stderr


def test_names_of_runs_are_cells(nominal: Path, tmp_path: Path) -> None:
    target = tmp_path / "d.csv"
    for name in ('a,b "c".csv', "plain.csv"):
        measured = tmp_path / name
        measured.write_text(table(bent(10)))
        assert run("compare", nominal, measured, "-o", target, "--force", "-q").exit_code == 0
        with target.open(newline="") as stream:
            rows = list(csv.reader(stream))
        assert {len(row) for row in rows} == {11}
        assert {row[0] for row in rows[1:]} == {name}
