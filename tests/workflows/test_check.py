"""`olp check` as a library: every code has a program that triggers it and one that just does not."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.fast import some_fast
from cases.gate import ARC, CASES, Call, box, scaled

import olp
from olp.checks import motion
from olp.core.errors import ProgramError, UsageError
from olp.findings.catalogue import GATE_CODES, RULES
from olp.program import survey
from olp.workflows import check as gate

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"


def codes(result: olp.Check) -> set[str]:
    return {f.code for f in result.findings}


def test_every_code_has_its_cases_and_its_explanation() -> None:
    assert set(CASES) == set(GATE_CODES)
    for rule in RULES.values():
        assert all(len(text) > 6 for text in (rule.title, rule.why, rule.remedy, rule.example)), rule.code
        assert rule.why.endswith(".")
        assert rule.remedy.endswith(".")
        assert rule.example.endswith(".")


@pytest.mark.parametrize("code", some_fast(CASES, 4))
def test_a_program_that_triggers_it_and_one_that_just_does_not(code: str, tmp_path: Path) -> None:
    hit, miss = CASES[code]
    result = hit.run(tmp_path / "hit")
    assert code in codes(result)
    assert code not in codes(miss.run(tmp_path / "miss"))
    assert result.report["findings"] == [f.as_dict() for f in result.findings]


def test_a_good_job_has_no_finding(tmp_path: Path) -> None:
    assert Call(**scaled(10.0)).run(tmp_path).findings == ()


@pytest.mark.parametrize(("select", "ignore", "expected"), [
    ((), (), {"OLP405", "OLP408", "OLP441"}),
    (("OLP405",), (), {"OLP405"}),
    (("olp4",), ("OLP405",), {"OLP408", "OLP441"}),
    ((), ("OLP",), set()),
    (("OLP1", "OLP408"), (), {"OLP408"}),
])  # fmt: skip
def test_codes_are_selected_by_how_they_begin(
    tmp_path: Path, select: tuple[str, ...], ignore: tuple[str, ...], expected: set[str]
) -> None:
    options = {"date": None, "select": select, "ignore": ignore}
    assert codes(Call(ARC, swap=box(109.999), options=options).run(tmp_path)) == expected


def test_a_code_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="OLP9"):
        Call(options={"select": ("OLP9",)}).run(tmp_path)


def test_lines_are_those_of_the_program_checked(tmp_path: Path) -> None:
    """The stamp moves all lines of the corrected text by one."""
    call = Call(b"G1 X100\nG1 X200\nG1 X2000\nG1 X0\n", swap=box(1999.0), **scaled(10.0))
    path = call.machine(tmp_path)
    alone = olp.check(call.program(), path, select=["OLP405"])
    assert [f.lines for f in alone.findings] == [(6,)]
    text = olp.correct(call.program(), path, outside_box="hold").data
    assert text.count(b"\n") == call.program().count(b"\n") + 1
    for nominal in (None, call.program()):
        pair = olp.check(text, path, nominal=nominal, select=["OLP405", "OLP311", "OLP312"])
        assert [f.lines for f in pair.findings] == [(7,)]


def test_the_nominal_program_must_not_be_corrected_itself(tmp_path: Path) -> None:
    call = Call(**scaled(10.0))
    path = call.machine(tmp_path)
    once = olp.correct(call.program(), path).data
    twice = olp.correct(once.replace(b"olp-corrected", b"olp corrected"), path).data
    result = olp.check(twice, path, nominal=once, select=["OLP311"])
    assert codes(result) == {"OLP311"}
    assert codes(olp.check(once, path, nominal=call.program())) <= {"OLP408"}


def test_of_a_corrected_program_alone_its_own_text_is_checked(tmp_path: Path) -> None:
    call = Call(**scaled(10.0))
    path = call.machine(tmp_path)
    text = olp.correct(call.program(), path).data
    assert codes(olp.check(text, path)) == {"OLP408"}
    path.with_name("x.csv").write_text("X_mm,EXX_um\n-1000,0\n2000,1\n")
    assert codes(olp.check(text, path)) == {"OLP408", "OLP312"}


@pytest.mark.parametrize("pair", [False, True])
def test_each_text_is_read_and_timed_once(
    tmp_path: Path, pair: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside what a correction reads, which drops the words early."""
    call = Call(**scaled(10.0))
    path = call.machine(tmp_path)
    nominal = call.program()
    program = olp.correct(nominal, path).data if pair else nominal
    reads: list[bytes] = []
    timed: list[object] = []
    read, of = gate.read, motion.Feeds.of

    def counted(data: bytes, *more: object, **words: object) -> object:
        reads.append(data)
        return read(data, *more, **words)  # type: ignore[arg-type]

    monkeypatch.setattr(survey if pair else gate, "read", counted)
    monkeypatch.setattr(motion.Feeds, "of", lambda parsed: timed.append(parsed) or of(parsed))
    olp.check(program, path, nominal=nominal if pair else None)
    assert len(reads) == len(set(reads)) == 2
    assert len(timed) == 2


def test_what_cannot_be_read_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(ProgramError) as caught:
        Call(b"G1 X100\nG5 X1\n").run(tmp_path)
    assert caught.value.line == 5


JOBS = {
    "gantry-plate/job.toml": set(), "bridge-cmm/job.toml": set(), "haas-mill/job.toml": set(),
    "table-router/job-outline.toml": set(), "nasty/job.toml": set(),
}  # fmt: skip


@pytest.mark.parametrize("job", JOBS)
def test_the_jobs_that_are_shipped_may_go(job: str) -> None:
    path = PROGRAMS / job
    setup = olp.load_setup(None, path)
    result = olp.check(str(setup.job.program), setup)
    assert [f for f in result.findings if f.severity.name == "ERROR"] == []
