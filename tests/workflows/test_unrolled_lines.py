"""Every verb unrolls a program by one option, and says its lines as they are in the files that were given.

The program here sets parameters in its first lines, which unrolling leaves out: what moves is in later lines
than the unrolled text has. A line of the unrolled text in a report is so a line without a move.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from cases.fast import some_fast
from cases.rs274_texts import PARAMETRIC
from cli.test_cli import run
from judge import machines
from judge.machines import Recipe
from judge.unpacker import Page

import olp
from olp.cli import VERBS, main
from olp.cli.calibrate import VERBS as CALIBRATE
from olp.cli.calibrate import command as calibrate
from olp.core.errors import Doubtful, OlpError, OutsideBox, ProgramError, Refused, UsageError
from olp.findings.catalogue import Finding
from olp.program.origin import Origin, Unrolled
from olp.workflows.doubt import with_accepted
from olp.workflows.flatten import UnrollOptions, as_asked
from olp.workflows.session import Session

#: Lines of the program before its first move; more than the unrolled text has.
SILENT = 60
#: Moves of a loop, of a subprogram in the program, and of one in a file beside it; the last leaves a move as
#: it is, which is a finding.
MAIN = (
    "#1 = 0\n" * SILENT
    + "o100 sub\n  G1 X[10 + #1 * 20] Y40 F600\n  G1 Y60\no100 endsub\n"
    + "G21 G90 G54 G64 P0.001 Q0\nG0 X10 Y10 Z5\n#1 = 0\no1 while [#1 lt 3]\n  o100 call [#1]\n"
    + "  o<other> call\n  #1 = [#1 + 1]\no1 endwhile\nG0 Z20\nM2\n"
)
OTHER = (
    "#2 = 0\n" * (2 * SILENT)
    + "o<other> sub\nG1 X50 Y70\nG2 X60 Y80 I10\nG53 G0 Z0\nG0 Z5\n"
    + "(olp off)\nG1 X55\n(olp on)\no<other> endsub\n"
)
TEXTS = {"part.ngc": MAIN.splitlines(), "other.ngc": OTHER.splitlines()}
#: Reads no program: its first argument are points that a machine reported.
NO_PROGRAM = {"results"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine, the program with the file of its subprogram, and what other verbs take."""
    folder = tmp_path_factory.mktemp("unrolled")
    machines.random_machine(folder, 4, Recipe(backlash_um={"X": 12.0}))
    (folder / "part.ngc").write_text(MAIN)
    (folder / "other.ngc").write_text(OTHER)
    (folder / "flat.ngc").write_bytes(olp.flatten(folder / "part.ngc", folder / "machine.toml"))
    corrected = olp.correct(folder / "part.ngc", folder / "machine.toml", flatten=True)
    (folder / "out.ngc").write_bytes(corrected.data)
    simulated = olp.simulate(corrected.data, folder / "machine.toml", step_mm=5.0)
    (folder / "measured.csv").write_bytes(simulated.to_csv())
    return folder


def of_registry() -> Iterator[tuple[str, click.Command]]:
    """Every verb and every verb of `calibrate`, with its name."""
    for group, verbs, prefix in ((main, VERBS, ""), (calibrate, CALIBRATE, "calibrate ")):
        for name in verbs:
            command = group.get_command(click.Context(group), name)
            assert command is not None
            yield prefix + name, command


def test_every_verb_that_reads_a_program_unrolls_it() -> None:
    readers = {}
    for name, command in of_registry():
        options = {word: option for option in command.params for word in option.opts}
        if "--dialect" in options and name not in NO_PROGRAM:
            readers[name] = options
    assert len(readers) > 8
    for name, options in readers.items():
        assert {"--expand-cycles", "--peck-clearance-mm"} <= options.keys(), name
        # one option with one help, but for the verb that does nothing else
        assert (
            name == "flatten"
            or options["--flatten"].help == "Write out loops, subprograms and expressions first."
        )


#: The words of a call of every verb that says lines of a program; the report is JSON on stdout.
CALLS: Mapping[str, tuple[str, ...]] = {
    "inspect": ("part.ngc", "--json"),
    "correct": ("part.ngc", "-o", "again.ngc", "--json", "--force"),
    "verify": ("part.ngc", "out.ngc", "--json"),
    "simulate": ("part.ngc", "--json", "-o", "shown.csv", "--force"),
    "retime": ("part.ngc", "--json"),
    "check": ("part.ngc", "--json", "--date", "2026-03-01"),
    "compare": ("part.ngc", "measured.csv", "--json"),
}
#: The others: `view` has a page, `batch` reports of `correct`, `flatten` the text, `calibrate` no lines.
OTHERS = {"view", "batch", "flatten", "calibrate refine", "calibrate export"}


def test_no_verb_is_left_out() -> None:
    readers = {n for n, c in of_registry() if any("--dialect" in p.opts for p in c.params)} - NO_PROGRAM
    assert readers == CALLS.keys() | OTHERS


def lines_in(value: Any) -> Iterator[tuple[str, int]]:
    """(file, line) of every line in a report, "" for the program."""
    if isinstance(value, list):
        for item in value:
            yield from lines_in(item)
    if not isinstance(value, dict):
        return
    for key, item in value.items():
        # moves by kind have one that is called "line"
        yield from lines_in(item) if key != "moves" else ()
        name = re.fullmatch(r"(.*_)?line", key)
        names = re.fullmatch(r"(.*_)?lines", key)
        if name and isinstance(item, int):
            yield value.get(f"{name[1] or ''}file", ""), item
        elif names and isinstance(item, list) and all(isinstance(line, int) for line in item):
            files = value.get(f"{names[1] or ''}files") or [""] * len(item)
            yield from zip(files, item, strict=True)


def assert_moves(lines: set[tuple[str, int]]) -> None:
    """Every line is one of the texts that holds the words of a move or of a mode of the path."""
    for file, line in lines:
        text = TEXTS[file or "part.ngc"][line - 1]
        assert re.search(r"[XYZ]|G64", text), (file, line, text)


@pytest.mark.parametrize("verb", CALLS)
def test_reports_name_lines_of_the_files_that_were_given(
    verb: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    done = run(verb, *CALLS[verb], "-m", "machine.toml", "--flatten")
    assert done.exit_code in (0, 1), done.stderr
    report = json.loads(done.stdout)
    lines = set(lines_in(report))
    # what is simulated without a finding has its lines in the table alone
    assert verb == "simulate" or lines
    assert_moves(lines)
    assert "other.ngc" in {file for file, _ in lines} or verb in ("inspect", "simulate")
    for finding in report["findings"]:
        assert finding["code"] != "OLP102" or (finding["file"], finding["line"]) == ("other.ngc", 124)
    for row in report.get("worst", ()):
        texts = TEXTS[row.get("file", "part.ngc")]
        assert row["text"] == texts[row["line"] - 1]


@pytest.mark.slow
def test_tables_name_the_file_beside_the_line(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    machine = ("-m", "machine.toml", "--flatten", "--force", "-q")
    run("simulate", "part.ngc", *machine, "-o", "points.csv")
    run("retime", "part.ngc", *machine, "--lines", "lines.csv", "--slow", "slow.csv")
    run("compare", "part.ngc", "measured.csv", *machine, "-o", "deviations.csv")
    for name in ("points.csv", "lines.csv", "slow.csv", "deviations.csv"):
        rows = [row for row in Path(name).read_text().splitlines() if not row.startswith("#")]
        found = {(row["file"], int(row["line"])) for row in csv.DictReader(rows)}
        assert_moves(found)
        assert {file for file, _ in found} == {"", "other.ngc"}, name
    # samples have the number alone; it counts through the files as the report says
    run("retime", "part.ngc", *machine, "-o", "t.csv", "--report", "t.json")
    (file,) = json.loads(Path("t.json").read_text())["files"]
    assert file == {"name": "other.ngc", "lines_from": len(TEXTS["part.ngc"]) + 1}
    sampled = {int(row["line"]) for row in csv.DictReader(Path("t.csv").read_text().splitlines())}
    through = [*TEXTS["part.ngc"], *TEXTS["other.ngc"]]
    assert all(re.search("[XYZ]", through[line - 1]) for line in sampled)
    assert max(sampled) >= file["lines_from"]
    # the verb that reads such points reads these
    done = run("compare", "part.ngc", "points.csv", "-m", "machine.toml", "--flatten", "--json")
    assert done.exit_code in (0, 1), done.stderr
    # a program of one file has the columns that it always had
    run("simulate", "flat.ngc", "-m", "machine.toml", "-o", "flat.csv", "--force", "-q")
    assert Path("flat.csv").read_text().splitlines()[1] == "X_mm,Y_mm,Z_mm,line"


@pytest.mark.slow
def test_the_lines_of_a_loop_are_added_up(folder: Path) -> None:
    used = olp.retime(folder / "part.ngc", folder / "machine.toml", flatten=True)
    flat = olp.retime(folder / "flat.ngc", folder / "machine.toml")
    assert used.duration_s == flat.duration_s
    assert len(used.lines) < len(flat.lines)
    assert used.lines.seconds.sum() == pytest.approx(flat.lines.seconds.sum(), rel=1e-12)
    assert used.lines.length_mm.sum() == pytest.approx(flat.lines.length_mm.sum(), rel=1e-12)
    table = olp.verify(folder / "part.ngc", folder / "out.ngc", folder / "machine.toml", flatten=True).table
    every = olp.verify(folder / "flat.ngc", folder / "out.ngc", folder / "machine.toml").table
    rows, blocks = table.by_line(), every.by_line()
    assert len(rows["line"]) < len(blocks["line"])
    assert max(rows["corrected_um"]) == max(blocks["corrected_um"])
    # line 62 moves in each of three calls
    mine = table.line == SILENT + 2
    assert mine.sum() == 3
    worst = table.corrected[mine & table.judged].max() * 1e3
    assert rows["corrected_um"][rows["line"] == SILENT + 2] == pytest.approx(worst, rel=1e-6)


@pytest.mark.slow
def test_places_in_texts_for_people_and_pipelines(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    call = (
        "check",
        "part.ngc",
        "-m",
        "machine.toml",
        "--flatten",
        "--select",
        "OLP102",
        "--fail-on",
        "never",
    )
    assert "lines 124, 127 of other.ngc" in run(*call).stdout.replace("124 of other.ngc, 127", "124, 127")
    (result,) = json.loads(run(*call, "--format", "sarif").stdout)["runs"][0]["results"]
    places = [where["physicalLocation"] for where in (*result["locations"], *result["relatedLocations"])]
    assert [p["artifactLocation"]["uri"] for p in places] == ["other.ngc", "other.ngc"]
    assert [p["region"]["startLine"] for p in places] == [124, 127]
    assert "other.ngc:124: warning: OLP102" in run(*call, "--format", "junit").stdout
    diff = run(
        "correct", "part.ngc", "-m", "machine.toml", "--flatten", "-o", "again.ngc", "--force", "-q", "--diff"
    )
    rows = re.findall(r"^ *(?:- )?(\d+)( of other.ngc)? ", diff.stdout, re.M)
    assert_moves({("other.ngc" if file else "", int(line)) for line, file in rows})


@pytest.mark.slow
def test_the_page_shows_the_unrolled_text_with_the_lines_of_the_files(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    call = ("view", "part.ngc", "-m", "machine.toml", "--flatten", "--no-time", "--measured", "measured.csv")
    done = run(*call, "-o", "page.html", "--force", "-q")
    assert done.exit_code == 0, done.stderr
    page = Page(Path("page.html").read_bytes())
    listing = page.manifest["listing"]
    shown, names = page.array(listing["nominal"]), page.array(listing["names"])
    assert len(shown) == len(names)
    assert listing["names_width"] == max(map(len, names))
    for text, name in zip(shown, names, strict=True):
        line, _, file = name.partition(" of ")
        original = TEXTS[file or "part.ngc"][int(line) - 1]
        assert text == original or "[" in original
    (left,) = (f for f in page.manifest["findings"] if f["code"] == "OLP102")
    assert left["place"] == "124 of other.ngc"
    assert shown[names.index(left["place"])] == "G53 G0 Z0"
    for flag in filter(None, (picture["flag"] for picture in page.manifest["pictures"])):
        line, file = re.search(r"(\d+)(?: of (.*))?$", flag["line"]).groups()  # type: ignore[union-attr]
        assert_moves({(file or "", int(line))})


# -- the law: through the option as by hand --------------------------------------------------------------

START = "G21 G90 G94 G17 G54\nG0 X1. Y1. Z1. F100\n"
LINE_KEYS = re.compile(r"(.*_)?(lines?|files?)|text|sha256|count|worst|message|name|bands?|nominal")


def without_lines(value: Any) -> Any:
    """A report without what is by line, and without the identity of the program."""
    if isinstance(value, dict):
        return {k: without_lines(v) for k, v in value.items() if not LINE_KEYS.fullmatch(k)}
    return [without_lines(item) for item in value] if isinstance(value, list) else value


@pytest.fixture(scope="module")
def controls(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("controls")
    names = ("linuxcnc", "fanuc", "haas")
    return {n: machines.random_machine(folder / n, 3, Recipe(controller=n, off_datum=True)) for n in names}


def both(call: Any) -> tuple[Any, str]:
    """What a call returns, and what it says where it refuses."""
    try:
        return call(), ""
    except Refused as error:
        return None, "\n".join(reason.message for reason in error.reasons)
    except OlpError as error:
        return None, error.message


LAW = (
    *PARAMETRIC,
    "G81 X5. Y5. Z-4. R2. F100\nX9.\nG80\nG0 Z5.\n",
    "G83 X5. Z-4. R2. Q1. F100\nG80\nG0 Z5.\n",
    MAIN.replace("  o<other> call\n", ""),
)


@pytest.mark.parametrize(("text", "control"), some_fast(product(LAW, ("linuxcnc", "fanuc", "haas")), 20))
def test_correcting_an_unrolled_program_is_unrolling_and_correcting(
    control: str, text: str, controls: Mapping[str, Path]
) -> None:
    machine, program = controls[control], (START + text).encode()
    for expand in (False, True):
        unrolling: dict[str, Any] = {"expand_cycles": expand, "peck_clearance_mm": 0.5}
        flat, refusal = both(partial(olp.flatten, program, machine, **unrolling))
        call = partial(olp.correct, program, machine, flatten=True, outside_box="hold", **unrolling)
        ours, said = both(call)
        if flat is None:
            # what needs no unrolling is refused in the same words as without
            plain = both(partial(olp.correct, program, machine, outside_box="hold"))[1]
            assert refusal in said or (said == plain and not expand)
            continue
        theirs, other = both(partial(olp.correct, flat, machine, outside_box="hold"))
        assert re.sub(r"line \d+", "", said) == re.sub(r"line \d+", "", other)
        if theirs is None:
            continue
        assert ours.data == theirs.data
        assert ours.nominal == flat
        assert without_lines(ours.report) == without_lines(theirs.report)
        assert [f.code for f in ours.findings] == [f.code for f in theirs.findings]
        np.testing.assert_array_equal(ours.table.corrected, theirs.table.corrected)


@pytest.mark.slow
def test_the_law_is_about_programs_that_are_corrected(controls: Mapping[str, Path]) -> None:
    """Not only about refusals; of each control some are."""
    for control, machine in controls.items():
        texts = [LAW[k] for k in (-1, -3, 0 if control == "linuxcnc" else 10)]
        for text in texts if control == "linuxcnc" else texts[1:]:
            assert olp.correct((START + text).encode(), machine, flatten=True, outside_box="hold").data


# -- errors ------------------------------------------------------------------------------------------------


def refused(folder: Path, text: str, sub: str = "", job: str = "") -> OlpError:
    """How a correction of a program with a subprogram `sub` beside it is refused."""
    (folder / "bad.ngc").write_text("#1 = 0\n" * SILENT + "G21 G90 G54\nG0 X10 Y10 Z5\n" + text)
    (folder / "sub.ngc").write_text("#2 = 0\n" * SILENT + "o<sub> sub\n" + sub + "o<sub> endsub\n")
    path = None
    if job:
        path = folder / "job.toml"
        path.write_text(f'schema = "olp-job-1"\nmachine = "machine.toml"\n{job}\n')
    with pytest.raises(OlpError) as caught:
        olp.correct(folder / "bad.ngc", folder / "machine.toml", path, flatten=True)
    return caught.value


POINT = 'decimal_point = "calculator"\n[axes.X]'
LOOP = "o1 while [#1 lt 3]\n#1 = [#1 + 1]\n{}o1 endwhile\nM2\n"
CALL = "o<sub> call\nM2\n"


@pytest.mark.parametrize(
    ("block", "kind"),
    [
        ("G1 X[#1] F100 G123\n", ProgramError),
        ("G1 X[10000 * #1] F100\n", OutsideBox),
        ("G2 X[20 + #1] Y10 R1 F100\n", ProgramError),
    ],
)
def test_errors_name_the_line_and_the_file_of_the_original(
    block: str, kind: type[OlpError], folder: Path
) -> None:
    error = refused(folder, LOOP.format(block))
    assert isinstance(error, kind)
    assert (error.file, error.line) == (str(folder / "bad.ngc"), SILENT + 5)
    error = refused(folder, CALL, block.replace("#1", "3"))
    assert isinstance(error, kind)
    assert (error.file, error.line) == (str(folder / "sub.ngc"), SILENT + 2)


def test_a_subprogram_may_be_in_a_file_that_ends_as_the_program_does(folder: Path) -> None:
    (folder / "o1001.cnc").write_text("O1001\nG21 G90 G54\nG0 X10. Y10. Z5.\nM98 P1002\nM30\n")
    (folder / "o1002.cnc").write_text("O1002\nG1 X20. F100.\nM99\n")
    (folder / "fanuc.toml").write_text(
        (folder / "machine.toml").read_text().replace('"linuxcnc"', '"fanuc"').replace("[axes.X]", POINT, 1)
    )
    text = olp.flatten(folder / "o1001.cnc", folder / "fanuc.toml")
    assert b"G1 X20. F100." in text


@pytest.mark.slow
def test_a_bad_line_is_named_by_every_verb(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    (folder / "bad.ngc").write_text(MAIN)
    (folder / "sub.ngc").write_text("")
    Path("wrong.ngc").write_text(MAIN.replace("o<other>", "o<wrongs>"))
    Path("wrongs.ngc").write_text(OTHER.replace("o<other>", "o<wrongs>").replace("G53 G0 Z0", "G123"))
    for verb, words in CALLS.items():
        call = [word.replace("part.ngc", "wrong.ngc") for word in words]
        done = run(verb, *call, "-m", "machine.toml", "--flatten")
        assert done.exit_code == 3, verb
        assert f"wrongs.ngc:{2 * SILENT + 4}: " in done.stderr, (verb, done.stderr)


def test_doubts_name_the_line_and_the_file(folder: Path) -> None:
    origin = Origin((str(folder / "sub.ngc"),), _index(10), (b"\n",) * 20, _index(3, 14))
    doubt = Finding("OLP461", "no point", 14)
    with pytest.raises(Doubtful, match=r"OLP461: line 4 of sub\.ngc: no point"):
        with_accepted([doubt], frozenset(), name="part.ngc", origin=origin)
    with pytest.raises(Doubtful, match=r"OLP461: line 3 of part\.ngc: no point"):
        with_accepted(
            [Finding("OLP461", "no point", 3, (3, 14))], frozenset(), name="part.ngc", origin=origin
        )


def _index(*numbers: int) -> Any:
    return np.array(numbers, np.int64)


@pytest.mark.slow
def test_feeds_and_times_are_told_by_lines_of_the_original(folder: Path) -> None:
    silent, machine = "#1 = 0\n" * SILENT, folder / "machine.toml"
    text = silent + "G21 G90 G54\nG0 X10 Y10 Z5\n" + LOOP.format("G93\nG1 X[20 * #1] F10\nG94\n")
    checked = olp.check(text.encode(), machine, flatten=True, select=["OLP308"])
    assert [f.lines for f in checked.findings] == [(SILENT + 5,)]
    text = silent + "G21 G90 G54\nG0 X10 Y10 Z5\n" + LOOP.format("G1 X[20 * #1]\n")
    checked = olp.check(text.encode(), machine, flatten=True, select=["OLP307"])
    assert [f.lines for f in checked.findings] == [(SILENT + 5,)]
    versus = olp.retime(folder / "out.ngc", machine, nominal=folder / "part.ngc", flatten=True).report[
        "nominal"
    ]
    assert versus["lines_correspond"]
    rows = [(row.get("file", ""), row["line"]) for row in versus["differences"]]
    assert_moves(set(rows))
    assert len(rows) == len(set(rows)) > 3
    assert sum(row["nominal_s"] for row in versus["differences"]) <= versus["duration_s"] * (1.0 + 1e-9)


#: Blocks that need no unrolling, refused for many reasons, by line and by what stands before.
PLAIN = (
    "G21 G90 G54 G17 F100\nG0 X1. Y1. Z1.\nG68 X1 R30\nG1 X1,5\nT77 M6\nG1 X1 R5\n(a (b) c)\n"
    "G1 X2 X3\nG0 G1 X4\nG2 X20. Y0. I4. J0.\nG58 X5\nG81 X6 Z-1\nG80\nG1 X7 &1\nG66.1 P1\nM2\n"
)


@pytest.mark.slow
def test_every_verb_lists_the_same_refusals_with_and_without_unrolling(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    Path("plain.ngc").write_text(PLAIN)
    calls = {verb: [word.replace("part.ngc", "plain.ngc") for word in words] for verb, words in CALLS.items()}
    calls["view"] = ["plain.ngc", "-o", "plain.html"]
    stated = {}
    for verb, words in calls.items():
        done, unrolled = (
            run(*verb.split(), *words, "-m", "machine.toml", *more) for more in ((), ("--flatten",))
        )
        assert (done.exit_code, done.stdout) == (3, unrolled.stdout), verb
        assert done.stderr == unrolled.stderr, verb
        stated[verb] = done.stdout + done.stderr
    # and every verb lists all of them
    lines = set(re.findall(r"plain\.ngc:(\d+): ", stated["correct"]))
    assert lines == {str(line) for line in (*range(3, 13), 14, 15)}
    for verb, text in stated.items():
        named = re.findall(r'plain\.ngc:(\d+): |"line": (\d+)', text)
        assert {a or b for a, b in named} == lines, verb


def refused_with(*call: str) -> tuple[list[tuple[str, int, str, str]], dict[str, Any]]:
    """File, line, code and statement of the reasons that `olp inspect` lists, and its report."""
    done = run("inspect", *call, "-m", "machine.toml", "--flatten", "--json")
    assert done.exit_code == 3
    report = json.loads(done.stdout)
    rows = [(row.get("file", ""), row["line"], row["code"], row["statement"]) for row in report["refused"]]
    return rows, report


def test_the_reasons_of_an_unrolled_program_are_those_of_its_own_lines(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    head = "#1 = 0\n" * SILENT + "G21 G90 G54\nG0 X10 Y10 Z5\n"
    # the unroller refuses some, the reader others; each once, though the loop makes three blocks of it
    loop = LOOP.format("G68 R[#1]\n#7 = #5061\nT[70 + 7] M6\no<sub> call\n#8 = [1 / 0]\n")
    Path("reasons.ngc").write_text(head + loop)
    Path("sub.ngc").write_text("#2 = 0\n" * SILENT + "o<sub> sub\nG1 X[20] R5 F100\nG123\no<sub> endsub\n")
    rows, report = refused_with("reasons.ngc")
    first = SILENT + 5
    assert rows == [
        ("", first, "OLP512", "G68 R[#1]"),
        ("", first + 1, "OLP541", "#7 = #5061"),
        ("", first + 2, "OLP521", "T[70 + 7] M6"),
        ("", first + 4, "OLP540", "#8 = [1 / 0]"),
        ("sub.ngc", SILENT + 2, "OLP519", "G1 X[20] R5 F100"),
        ("sub.ngc", SILENT + 3, "OLP512", "G123"),
    ]
    assert report["refused_complete"]
    assert [(f["code"], f.get("file", ""), f["line"]) for f in report["findings"]] == [
        (code, file, line) for file, line, code, _ in rows
    ]
    with pytest.raises(Refused) as caught:
        olp.correct("reasons.ngc", "machine.toml", flatten=True)
    text = str(caught.value).splitlines()
    assert text[0].startswith(f"reasons.ngc:{first}: G68")
    assert text[-1].startswith(f"sub.ngc:{SILENT + 3}: G123")
    shown = run("inspect", "reasons.ngc", "-m", "machine.toml", "--flatten").stdout
    assert f"line {SILENT + 3} of sub.ngc: " in shown
    # without unrolling the hint says what --flatten would refuse
    hinted = run("correct", "reasons.ngc", "-m", "machine.toml").stderr
    assert "--flatten does not unroll it: line" in hinted


def test_a_macro_call_that_is_unrolled_is_no_reason(controls: Mapping[str, Path]) -> None:
    text = (START + "G65 P1 X5.\nG68 X1. R3.\nG1 X1.\nM30\nO1\nG1 X#24\nM99\n").encode()
    with pytest.raises(ProgramError) as caught:
        olp.correct(text, controls["fanuc"], flatten=True)
    assert (type(caught.value), caught.value.line) == (ProgramError, 4)


def test_an_expanded_cycle_is_not_refused_for_what_its_block_has(folder: Path) -> None:
    text = b"G21 G90 G54 F100\nG0 X1 Y1 Z9\nG81 X2 Z1 R2 K1\nG80\nG123\n"
    with pytest.raises(Refused) as caught:
        olp.correct(text, folder / "machine.toml", flatten=True)
    assert [(r.line, r.code) for r in caught.value.reasons] == [(3, "OLP519"), (5, "OLP512")]
    with pytest.raises(ProgramError) as single:
        olp.correct(text, folder / "machine.toml", expand_cycles=True)
    assert (single.value.line, single.value.code) == (5, "OLP512")


# -- what the job and the switch say of lines -------------------------------------------------------------


def test_payloads_of_the_job_are_of_lines_that_are_executed(folder: Path) -> None:
    job = "[[payloads]]\nline = {}\npayload_kg = 30"
    text = "o2 if [#1 gt 1]\nG1 X20 F100\no2 endif\nG1 X30 F100\nM2\n"
    error = refused(folder, text, job=job.format(SILENT + 4))
    assert isinstance(error, ProgramError)
    assert error.line == SILENT + 4
    assert "the unrolled program does not have" in str(error)


def test_blocks_under_the_switch_are_unrolled_as_it_stands(folder: Path) -> None:
    text = b"G21 G90 G54\nG0 X10 Y10 Z5\n#1 = 10\n/#1 = 100\nG1 X[20 + #1] F600\nM2\n"
    lengths = {
        switch: olp.retime(
            text, folder / "machine.toml", flatten=True, block_delete=switch
        ).lines.length_mm.sum()
        for switch in (False, True)
    }
    assert lengths == {False: pytest.approx(110.0), True: pytest.approx(20.0)}


@pytest.mark.parametrize("block", ["/#1 = 100", "/o<other> call", "/o3 if [1]", "/ N5 #7=[1+2]"])
def test_a_block_under_the_switch_that_changes_the_program_is_refused(block: str, folder: Path) -> None:
    """Corrected programs have to be right for both positions; the unrolled text is for one."""
    error = refused(folder, f"{block}\nG1 X[20 + #1] F600\nM2\n")
    assert error.line == SILENT + 3
    assert "for each position of the switch" in error.message
    # a block that only moves stays under the switch
    text = b"G21 G90 G54\nG0 X10 Y10 Z5\n#1 = 10\n/G1 X[20 + #1] F600\nG1 X50 Y[#1] Z[#1] F600\nM2\n"
    assert b"\n/G1 X30" in olp.flatten(text, folder / "machine.toml")


# -- the verb ----------------------------------------------------------------------------------------------


def test_the_verb_writes_the_text_that_the_option_reads(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    done = run("flatten", "part.ngc", "-m", "machine.toml")
    assert (done.exit_code, done.stdout_bytes) == (0, Path("flat.ngc").read_bytes())
    assert done.stderr == ""
    assert olp.flatten(Path("part.ngc"), "machine.toml") == Path("flat.ngc").read_bytes()
    written = run("flatten", "part.ngc", "-m", "machine.toml", "-o", "written.ngc")
    assert (written.exit_code, written.stdout) == (0, "")
    assert written.stderr == f"wrote written.ngc: {len(Path('flat.ngc').read_text().splitlines())} lines\n"
    assert Path("written.ngc").read_bytes() == Path("flat.ngc").read_bytes()
    again = run("flatten", "part.ngc", "-m", "machine.toml", "-o", "written.ngc")
    assert again.exit_code == 2
    assert "--force" in again.stderr
    over = run("flatten", "part.ngc", "-m", "machine.toml", "-o", "part.ngc", "--force")
    assert over.exit_code == 2
    assert Path("part.ngc").read_text() == MAIN
    piped = run("flatten", "-", "-m", "machine.toml", stdin=b"#1 = 3\nG1 X#1\nM2\n")
    assert piped.stdout_bytes == b"G1 X3\nM2\n"
    cycles = run(
        "flatten", "-", "-m", "machine.toml", "--expand-cycles", stdin=b"G0 X0 Y0 Z9\nG81 X1 Z-1 R2 F9\nM2\n"
    )
    assert b"G81" not in cycles.stdout_bytes
    points = run("flatten", "-", "-m", "machine.toml", "--dialect", "list", stdin=b"1 2 3\n")
    assert points.exit_code == 2
    assert "cannot be unrolled" in points.stderr


def test_a_table_of_points_is_not_unrolled(folder: Path) -> None:
    with pytest.raises(UsageError, match="for a program"):
        olp.compare(folder / "measured.csv", [folder / "measured.csv"], flatten=True)


def test_the_text_keeps_where_its_lines_come_from(folder: Path) -> None:
    session = Session.start(folder / "machine.toml")
    program = session.sources.source(folder / "part.ngc")
    flat = as_asked(session.sources, program, *session.reading(program), UnrollOptions(flatten=True)).data
    assert isinstance(flat, Unrolled)
    # the text that is written has lines of its own
    assert type(olp.flatten(folder / "part.ngc", folder / "machine.toml")) is bytes
    origin = flat.origin
    lines = flat.decode().splitlines()
    assert len(origin.line) == len(lines)
    for number, text in enumerate(lines, 1):
        file, line = origin.file_of(origin.line_of(number))
        original = TEXTS[Path(file).name if file else "part.ngc"][line - 1]
        assert text == original or "[" in original
        assert origin.text(origin.line_of(number)) == original
