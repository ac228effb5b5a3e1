"""Tools and bases of the control's own data: `System/$config.dat` beside the folder of programs."""

from __future__ import annotations

from pathlib import Path

import pytest
from judge import machines
from judge.machines import Recipe

import olp
from olp.core.errors import OlpError, ProgramError
from olp.core.paired import own_end
from olp.program.robots.krl import data as krl_data
from olp.program.robots.krl import reader

RECIPE = Recipe(controller="kuka-krl", tools={}, job_defaults={}, work_offsets={})
TOOL, BASE = "{X 10,Y -5,Z 120,A 0,B 10,C 0}", "{x 300.0,y 250.0,z -300.0,a 30.0,b 0.0,c 0.0}"
SRC = """DEF part()
  $BASE=BASE_DATA[3]
  $TOOL=TOOL_DATA[2]
  LIN XP1
  LIN {X 40,Y 5,Z 20,A 30,B -10,C 170}
END
"""
DAT = "DEFDAT part\nDECL E6POS XP1={X 1,Y 2,Z 3,A 30,B -10,C 170,E1 0.0}\nENDDAT\n"
CONFIG = f"""DEFDAT  $CONFIG PUBLIC
DECL FRAME TOOL_DATA[16]
TOOL_DATA[1]={{X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}
TOOL_DATA[2]={TOOL}

DECL FRAME BASE_DATA[32]
BASE_DATA[3]={BASE}
DECL E6POS XP1={{X 9,Y 9,Z 9,A 0,B 0,C 0}}
ENDDAT
"""
JOB = 'schema = "olp-job-1"\nmachine = "machine.toml"\n'


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 11, RECIPE)


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """A program in a folder below those of a control."""
    folder = tmp_path / "KRC" / "R1" / "Program" / "Work"
    folder.mkdir(parents=True)
    (tmp_path / "KRC" / "R1" / "System").mkdir()
    (tmp_path / "KRC" / "R1" / "System" / "$config.dat").write_text(CONFIG)
    (folder / "part.src").write_text(SRC)
    (folder / "part.dat").write_text(DAT)
    return folder / "part.src"


def config_of(program: Path) -> Path:
    return program.parents[2] / "System" / "$config.dat"


def test_the_numbers_are_those_that_the_program_itself_would_state(bent: Path, program: Path) -> None:
    zero = machines.zero_machine(program.parents[4], RECIPE)
    out = program.parents[4] / "part.src"
    olp.correct(program, zero, outside_box="hold").write(out)
    assert (out.read_text(), out.with_suffix(".dat").read_text()) == (SRC, DAT)
    stated = SRC.replace("BASE_DATA[3]", BASE).replace("TOOL_DATA[2]", TOOL) + DAT
    alone = olp.correct(stated.encode(), bent).data.decode()
    done = olp.correct(program, bent)
    done.write(out, force=True)
    both = out.read_text() + out.with_suffix(".dat").read_text()
    assert (
        both.replace("BASE_DATA[3]", BASE).replace("TOOL_DATA[2]", TOOL).splitlines()[2:]
        == (alone.splitlines()[2:])
    )
    assert "XP1={X 1,Y 2,Z 3," not in both
    assert config_of(program).read_text() == CONFIG
    assert {path.name for path in out.parent.glob("*.dat")} == {"part.dat"}
    told = [finding.message for finding in done.findings]
    assert any("TOOL_DATA[2] is taken as in line 4 of $config.dat" in text for text in told)
    # the corrected program lies outside of the folders of the control
    assert olp.verify(program, out, bent).report["verdict"]["ok"]
    assert olp.verify(program, done.data, bent).report["verdict"]["ok"]


def test_what_the_program_states_goes_before(bent: Path, program: Path) -> None:
    own = SRC.replace("  $BASE=", "  BASE_DATA[3]={X 400,Y 300,Z -300,A 0,B 0,C 0}\n  $BASE=")
    program.write_text(own)
    first = olp.correct(program, bent).data
    config_of(program).write_text(CONFIG.replace("x 300.0", "x 310.0"))
    again = olp.correct(program, bent).data
    assert again.partition(b";olp: system")[0] == first.partition(b";olp: system")[0]
    program.write_text(SRC.replace("  $BASE=", "  BASE_DATA[3].x=5\n  $BASE="))
    with pytest.raises(ProgramError, match=r"BASE_DATA\[3\] gets another value in line 2"):
        olp.correct(program, bent)


def test_data_that_are_missing_or_differ_are_refused(bent: Path, program: Path) -> None:
    job = bent.with_name("job.toml")
    job.write_text(JOB + '[work_offsets.BASE3]\nX_mm = 300.5\nY_mm = 250.0\nZ_mm = -300.0\nset_by = "true"\n')
    with pytest.raises(OlpError, match="BASE3 is stated by the program and by"):
        olp.correct(program, bent, job)
    config_of(program).write_text(CONFIG.replace("x 300.0", "x 1e"))
    with pytest.raises(ProgramError, match=r"BASE_DATA\[3\] is not stated .* in line 7 of \$config\.dat"):
        olp.correct(program, bent)
    config_of(program).unlink()
    with pytest.raises(OlpError, match=r"work_offsets\.BASE3"):
        olp.correct(program, bent)


def test_data_of_another_folder_do_not_count(bent: Path, program: Path) -> None:
    aside = program.parents[4] / "part.src"
    aside.write_text(SRC)
    aside.with_suffix(".dat").write_text(DAT)
    with pytest.raises(OlpError, match=r"work_offsets\.BASE3"):
        olp.correct(aside, bent)


def test_a_statement_about_errors_moves_nothing(bent: Path) -> None:
    text = SRC.replace("BASE_DATA[3]", BASE).replace("TOOL_DATA[2]", TOOL) + DAT
    done = olp.correct(text.replace("  LIN XP1", "  ON_ERROR_PROCEED\n  LIN XP1").encode(), bent).data
    assert (
        done.replace(b"  ON_ERROR_PROCEED\n", b"").splitlines()[2:]
        == (olp.correct(text.encode(), bent).data.splitlines()[2:])
    )


def test_the_end_of_the_program_is_searched_for_once_and_not_for_each_line(
    bent: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched: list[int] = []

    def counted(text: bytes) -> int:
        searched.append(len(text))
        return own_end(text)

    for module in (reader, krl_data):
        monkeypatch.setattr(module, "own_end", counted)
    text = (SRC.replace("  LIN XP1\n", "  LIN XP1\n" * 30) + DAT + CONFIG).encode()
    olp.correct(text, bent, outside_box="hold")
    assert 2 <= len(searched) < 30
