"""Programs that keep their loops and subprograms when they are corrected: the same moves as unrolled."""

from __future__ import annotations

import random
import re
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from cli.test_cli import run
from judge import linuxcnc, machines

import olp
from olp.core.errors import ProgramError, Refused

HEAD = "G21 G90 G54 G64 P0.001 Q0\nF600\nG0 X10 Y10 Z5\n"
#: a spring pass: the subprogram runs twice at one place
SPRING = (
    HEAD + "M98 P100 L2\nG0 Z20\nM2\nO100\nN10 G1 X50 Y40 Z-1\nN20 X20 (back)\nN30 G2 X40 Y60 I20 J0\n"
    "N40 G1 X10.0 Y10\nM99\n"
)
FANUC = "%\nO1000\n" + HEAD.replace(" P0.001 Q0", "").replace("10", "10.").replace("5\n", "5.\n")
#: digits of the machine, mm
DIGIT = 0.001
#: rounding of two coordinates
SAME = 1.001 * DIGIT


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("kept"), 4)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"))


def test_a_spring_pass_is_corrected_in_its_place(machine: Path) -> None:
    result = olp.correct(SPRING.encode(), machine)
    assert result.report["verdict"]["ok"]
    before, after = SPRING.splitlines(), result.data.decode().splitlines()
    assert after[0].startswith("(olp-corrected")
    assert len(after) == len(before) + 1
    assert [line for line in after[1:] if "M98" in line or line.startswith("O")] == ["M98 P100 L2", "O100"]
    for old, new in zip(before, after[1:], strict=True):
        # words of axes alone differ
        assert new.split()[0] == old.split()[0]
        assert (old != new) == (old.startswith(("G0", "N")))
    assert after[9].endswith("(back)")
    found = {finding.code: finding for finding in result.findings}
    assert found["OLP109"].lines == (8, 9, 10, 11)
    assert found["OLP109"].line == 8
    assert olp.verify(SPRING.encode(), result.data, machine).report["verdict"]["ok"]
    assert b"M98" not in result.plain
    assert b"M98" not in result.nominal


def test_expressions_stay_where_their_axes_are_not_corrected(tmp_path: Path) -> None:
    """X alone is wrong, so Y and Z may come from expressions."""
    machine = machines.shift_machine(tmp_path, (12.0, 0.0, 0.0))
    text = (
        HEAD + "#1=3\no1 repeat [2]\n  G1 X20 Y[#1 * 2] F#<_feed>\n  #2=5 X30 Z-#1 (deep)\no1 endrepeat\nM2\n"
    )
    result = olp.correct(text.encode(), machine)
    assert b"  G1 X19.988 Y[#1 * 2] F#<_feed>\n" in result.data
    assert b"  X29.988 Z-#1 #2=5 (deep)\n" in result.data
    assert olp.verify(text.encode(), result.data, machine).report["verdict"]["ok"]


def test_an_expression_that_has_to_change_is_refused_with_the_way_on(machine: Path) -> None:
    text = HEAD + "#1=3\nG1 X[#1 * 2] Y5\nM2\n"
    with pytest.raises(ProgramError) as caught:
        olp.correct(text.encode(), machine)
    assert (caught.value.line, caught.value.code) == (5, "OLP511")
    assert "an expression gives its X" in caught.value.message
    assert caught.value.message.endswith("unroll the program with --flatten")


TWO_PLACES = "G54\nM98 P100 (left)\nG55\nM98 P100 (right)\nG54\nG0 X10 Y10 Z5\nM98 P100\nM2\nO100\n"
TWO_PLACES = HEAD + TWO_PLACES + "N1 G1 X50 Y40 Z-1\nX10 Y10 Z5\nM99\n"


def test_calls_that_need_other_numbers_are_written_out(machine: Path) -> None:
    result = olp.correct(TWO_PLACES.encode(), machine)
    assert result.report["verdict"]["ok"]
    text = result.data.decode().splitlines()
    assert [line for line in text if "M98" in line] == ["M98 P100 (left)", "M98 P100"]
    second = text.index("(right)")
    assert text[second + 1].startswith("G1 X")
    assert len([line for line in text if line.startswith("N1 G1")]) == 1
    found = {finding.code: finding for finding in result.findings}
    assert (found["OLP110"].lines, found["OLP109"].lines) == ((7,), (13, 14))
    worst = result.report["worst"]
    assert {row["line"] for row in worst} <= {13, 14}
    assert olp.verify(TWO_PLACES.encode(), result.data, machine).report["verdict"]["ok"]


def test_a_loop_whose_passes_need_other_numbers_is_refused_and_shown(machine: Path) -> None:
    text = HEAD + "G91\no1 repeat [3]\nG1 X150 Y40\nX-100\no1 endrepeat\nM2\n"
    with pytest.raises(Refused) as caught:
        olp.correct(text.encode(), machine)
    reasons = caught.value.reasons
    assert {reason.line for reason in reasons} == {6, 7}
    assert "its passes need" in reasons[0].message
    assert olp.correct(text.encode(), machine, flatten=True).report["verdict"]["ok"]


def test_a_subprogram_in_a_file_of_its_own_is_written_out(machine: Path, tmp_path: Path) -> None:
    (tmp_path / "p.ngc").write_text(HEAD + "o<side> call\nM2\n")
    (tmp_path / "side.ngc").write_text("o<side> sub\nN5 G1 X50\no<side> endsub\n")
    result = olp.correct(tmp_path / "p.ngc", machine)
    assert b"call" not in result.data
    assert b"\nG1 X49.9" in result.data
    (found,) = (finding for finding in result.findings if finding.code == "OLP110")
    assert found.lines == (4,)
    assert result.report["worst"][0]["file"] == "side.ngc"
    (tmp_path / "out.ngc").write_bytes(result.data)
    assert olp.verify(tmp_path / "p.ngc", tmp_path / "out.ngc", machine).report["verdict"]["ok"]


def test_one_that_has_parameters_is_not(machine: Path, tmp_path: Path) -> None:
    (tmp_path / "p.ngc").write_text(HEAD + "o<side> call [50]\nM2\n")
    (tmp_path / "side.ngc").write_text("o<side> sub\nG1 X#1\no<side> endsub\n")
    with pytest.raises(ProgramError, match="in a file of its own") as caught:
        olp.correct(tmp_path / "p.ngc", machine)
    assert (caught.value.line, Path(caught.value.file or "").name) == (2, "side.ngc")


def test_a_call_that_runs_in_a_loop_is_not_written_out(machine: Path) -> None:
    text = HEAD + "G91\no1 repeat [2]\nM98 P100\no1 endrepeat\nM2\nO100\nG1 X150 Y40\nM99\n"
    with pytest.raises(ProgramError, match="cannot be corrected in its place") as caught:
        olp.correct(text.encode(), machine)
    assert caught.value.line == 10


def test_what_cannot_be_proved_is_not_kept(machine: Path) -> None:
    """The flow depends on where the tool is, which the correction changes."""
    text = HEAD + "G1 X20 Y10\no1 if [#<_x> eq 20]\nG1 Y20\no1 endif\nM2\n"
    with pytest.raises(ProgramError, match=r"is not proved .*--flatten"):
        olp.correct(text.encode(), machine)
    assert olp.correct(text.encode(), machine, flatten=True).report["verdict"]["ok"]


def test_no_error_no_edit(zero: Path) -> None:
    assert olp.correct(SPRING.encode(), zero).data == SPRING.encode()


@pytest.mark.parametrize("switch", ["/", ""])
def test_block_delete(machine: Path, switch: str) -> None:
    text = SPRING.replace("G0 Z20", f"{switch}G1 Z15\nG0 X10 Y10 Z20")
    result = olp.correct(text.encode(), machine)
    assert olp.verify(text.encode(), result.data, machine).report["verdict"]["ok"]
    assert ("\n/G1" in result.data.decode()) is bool(switch)


@pytest.mark.slow
def test_the_verbs_read_what_was_kept(machine: Path, tmp_path: Path) -> None:
    (tmp_path / "p.ngc").write_text(SPRING)
    files = ["p.ngc", "-m", str(machine)]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        done = run(
            "correct", *files, "-o", "c.ngc", "--diff", "--review", "r.html", "--report", "r.html.json"
        )
        assert done.exit_code == 0, done.output
        # each pass is shown beside its nominal one
        assert done.output.count("(back)") >= 4
        assert run("verify", "p.ngc", "c.ngc", "-m", str(machine)).exit_code == 0
        assert run("check", "c.ngc", "--nominal", "p.ngc", "-m", str(machine)).exit_code == 0
        assert run("check", "c.ngc", "-m", str(machine)).exit_code == 0
        assert run("view", *files, "--corrected", "c.ngc", "-o", "v.html").exit_code == 0
        again = run("correct", "c.ngc", "-m", str(machine))
        assert again.exit_code == 3
        assert "second one" in again.output
        written = (tmp_path / "c.ngc").read_text()
        (tmp_path / "c.ngc").write_text(re.sub(r"N40 G1 X\d+", "N40 G1 X11", written))
        verified = run("verify", "p.ngc", "c.ngc", "-m", str(machine))
        assert verified.exit_code == 1, verified.output


def drawn(seed: int) -> str:
    """A program of subprograms and loops; most passes are at one place, and one subprogram calls another."""
    rng = random.Random(seed)

    def moves(count: int) -> list[str]:
        lines = []
        for _ in range(count):
            x, y, z = (f"{rng.uniform(low, high):.3f}" for low, high in ((0, 90), (0, 90), (-5, 5)))
            lines.append(
                rng.choice([f"G1 X{x} Y{y}", f"G1 X{x}", f"Y{y}", f"G1 Z{z}", f"G1 X{x} Y{y} Z{z} (c)"])
            )
        return ["G1 X50.000 Y50.000 Z1.000", *lines, "G1 X10. Y10. Z5."]

    inner, outer = moves(rng.randint(1, 4)), moves(rng.randint(1, 4))
    call = rng.choice(["o200 call", "o200 call\no200 call", "o3 repeat [2]\no200 call\no3 endrepeat"])
    at = rng.randrange(1, len(outer))
    outer[at:at] = ["G1 X10. Y10. Z5.", call]
    main = [rng.choice(["o100 call", "o4 repeat [#5]\no100 call\no4 endrepeat", "G0 X20 Y20\no100 call"])]
    main += [*moves(rng.randint(0, 3)), rng.choice(["o200 call", "", "/ G0 Z8\nG0 X10 Y10 Z5"])]
    if rng.random() < 0.3:
        main += ["G91", "o5 repeat [3]", "G1 X1 Y1", "o5 endrepeat", "G90", "G0 X0 Y0"]
    subs = ["o100 sub", *outer, "o100 endsub", "o200 sub", *inner, "o200 endsub"]
    return HEAD + "#5=2\n" + "\n".join([*subs, *main, "G0 Z20", "M2", ""])


def ends(text: bytes, folder: Path) -> np.ndarray:
    """(n, 3) where the judge goes; a move that goes nowhere is none."""
    canon = linuxcnc.interpret(text, folder)
    axis = canon.axis[canon.kind != linuxcnc.DWELL]
    still = np.append(False, np.abs(np.diff(axis, axis=0)).max(axis=1) < 0.5 * DIGIT)
    return np.asarray(axis[~still])


def in_places(seed: int) -> str:
    """A program without parameters whose subprograms are called at several places, twice at some of them."""
    rng = random.Random(seed)
    subs = []
    for number in (100, 200):
        x, y = (f"{rng.uniform(10, 90):.3f}" for _ in range(2))
        inner = "M98 P200\n" if number == 100 and rng.random() < 0.5 else ""
        subs.append(f"O{number}\nN7 G1 X{x} Y{y} Z-1.\nX20.000\n{inner}G1 X10. Y10. Z5.\nM99\n")
    calls = [
        f"{rng.choice(['G54', 'G55', 'G52 X30 Y40', 'G52 X0 Y0'])}\nG0 X10 Y10 Z5\n"
        f"M98 P{rng.choice([100, 200])} L{rng.randint(1, 2)}"
        for _ in range(rng.randint(2, 5))
    ]
    two = [f"{frame}\nG0 X10 Y10 Z5\nM98 P200" for frame in ("G52 X0 Y0\nG54", "G55")]
    return HEAD + "\n".join([*calls, *two, "M2", ""]) + "".join(subs)


def same_way(text: bytes, kept: olp.Correction, machine: Path) -> None:
    unrolled = olp.correct(text, machine, flatten=True)
    one, other = ends(kept.data, machine.parent), ends(unrolled.data, machine.parent)
    assert one.shape == other.shape
    np.testing.assert_allclose(one, other, rtol=0, atol=SAME)
    np.testing.assert_allclose(ends(kept.plain, machine.parent), one, rtol=0, atol=1e-9)


@pytest.mark.oracle
@pytest.mark.parametrize("seed", some_of_a_campaign(range(24), 3))
def test_kept_and_unrolled_go_the_same_way(machine: Path, seed: int) -> None:
    text = drawn(seed).encode()
    try:
        kept = olp.correct(text, machine)
    except ProgramError as refusal:
        assert "--flatten" in refusal.message
        assert b"G91" in text
        return
    assert kept.report["verdict"]["ok"]
    assert kept.data.count(b"call") == text.count(b"call")
    same_way(text, kept, machine)


@pytest.mark.oracle
@pytest.mark.parametrize("seed", some_of_a_campaign(range(12), 2))
def test_calls_at_several_places_go_the_same_way(machine: Path, seed: int) -> None:
    text = in_places(seed).encode()
    kept = olp.correct(text, machine)
    assert kept.report["verdict"]["ok"]
    same_way(text, kept, machine)
    lines = {line for finding in kept.findings if finding.code == "OLP110" for line in finding.lines}
    assert kept.data.count(b"M98") <= text.count(b"M98") - len(lines)
    assert lines


@pytest.mark.slow
def test_a_kept_program_above_tolerance_is_written_where_unrolling_does_not_help(tmp_path: Path) -> None:
    """No block takes up backlash along a contour, kept or not."""
    machine = machines.random_machine(tmp_path, 3, machines.Recipe(backlash_um={"X": 8.0}, directed=""))
    contour = "G41.1 D8 G1 X30 Y40 Z-1\nX60 Y45\nX35 Y90\nG40 X10 Y10 Z5\n"
    text = f"{HEAD}M98 P100\nM2\nO100\n{contour}M99\n".encode()
    kept = olp.correct(text, machine)
    assert not kept.report["verdict"]["ok"]
    assert b"M98 P100" in kept.data and b"G41.1" in kept.data
    codes = [finding.code for finding in kept.findings]
    assert "OLP109" in codes and "OLP101" in codes
    assert not olp.correct(text, machine, flatten=True).report["verdict"]["ok"]
    path = olp.correct(text, machine, contour="path")
    assert path.report["verdict"]["ok"]
    assert b"M98" not in path.data
    (found,) = (finding for finding in path.findings if finding.code == "OLP314")
    assert found.message.endswith("loops and subprograms are written out")


def test_a_program_that_is_worse_when_kept_has_its_calls_written_out_or_is_refused(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a fault in keeping would make it: the numbers of one line are those of the nominal program."""
    from olp.program.rs274.flatten import kept

    of_visits = kept._of_visits
    monkeypatch.setattr(
        kept,
        "_of_visits",
        lambda source, *rest: source if source.startswith(b"N20") else of_visits(source, *rest),
    )
    done = olp.correct(SPRING.encode(), machine)
    assert done.report["verdict"]["ok"]
    assert {"OLP110"} <= {finding.code for finding in done.findings} and b"M98" not in done.data
    monkeypatch.setattr(kept, "can_be_apart", lambda unrolled: False)
    with pytest.raises(ProgramError, match=r"above the tolerance then.*--flatten"):
        olp.correct(SPRING.encode(), machine)


@pytest.mark.slow
@pytest.mark.parametrize("number", ["", "N10 "])
def test_blocks_that_are_put_before_a_line_stay_with_it(tmp_path: Path, number: str) -> None:
    """What takes up the backlash before the first cut of a subprogram is in the subprogram, not in front of
    its calls."""
    machine = machines.random_machine(tmp_path, 4, machines.Recipe(backlash_um={"X": 6.0, "Y": 4.0}))
    call = "G0 X9 Y9\nM98 P100\n"
    body = f"{number}G1 X50 Y40 Z-1\nX20 (back)\nG0 X10 Y10 Z5\nX9 Y9\n"
    text = olp.correct(f"{HEAD}{call}{call}M2\nO100\n{body}M99\n".encode(), machine).data.decode()
    lines = text.splitlines()
    assert [line[:4] for line in lines[4:9]] == ["G0 X", "M98 ", "G0 X", "M98 ", "M2"]
    inner = lines[lines.index("O100") + 1 :]
    assert inner[0].startswith(f"{number}G1 X8.989") and inner[1].startswith("X49.994")
    assert inner[2] == "X49.988 (back)" and inner[3].startswith("X19.98")
    assert inner[4].startswith("G0 X9.98")


def test_an_expression_without_parameters_is_not_written_out(machine: Path) -> None:
    with pytest.raises(ProgramError, match="an expression gives its X") as caught:
        olp.correct(f"{HEAD}G1 X[2*3] Y5\nM98 P1\nM2\nO1\nG1 X9\nM99\n".encode(), machine)
    assert caught.value.line == 4
