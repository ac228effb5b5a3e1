"""The table of judgements and its verdicts, by hand: which rows count, how they group, what is said."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cases.paths import PASS, Known, Move, line, program, rapid, toolpath

from olp.core.toolpath import Frame
from olp.findings.catalogue import Finding
from olp.program.text import columns
from olp.proof import judgement
from olp.proof.judgement import Judgements
from olp.proof.measured import ABOVE, SHOWN, WITHIN, Measured
from olp.proof.proof import Counts, prove

NAN = math.nan
#: um, of the table: 1 um, and 0.1 um of rounding.
ALLOWED = 1.1


def table(*rows: tuple[int, Counts, float, float], tool: int | None = 1) -> Judgements:
    """From rows of line, how it counts, and um uncorrected and corrected; one tool and operation."""
    count = len(rows)
    return Judgements(
        line=np.array([row[0] for row in rows], np.int64),
        tool=np.full(count, -1 if tool is None else tool),
        operation=np.zeros(count, np.int64),
        counts=np.array([row[1] for row in rows], np.uint8),
        uncorrected=np.array([row[2] for row in rows], np.float32) / np.float32(1000),
        corrected=np.array([row[3] for row in rows], np.float32) / np.float32(1000),
        tolerance_mm=1e-3,
        allowed_mm=ALLOWED * 1e-3,
    )


def verdict(
    judgements: Judgements,
    part_um: float | None = None,
    within: float | None = None,
    findings: tuple[Finding, ...] = (),
) -> dict[str, Any]:
    uncertainty = None if within is None else {"within": {"after": {"program": within}}}
    return judgement.verdict(judgements, part_um, uncertainty, findings)


#: Line 3 has a cut and a rapid, line 4 a rapid alone, line 5 two cuts, one above.
MIXED = table(
    (3, Counts.RAPID, 90.0, 80.0),
    (3, Counts.FEED, 20.0, 0.5),
    (4, Counts.RAPID, 70.0, 60.0),
    (5, Counts.FEED, 5.0, 2.0),
    (5, Counts.LEFT, 30.0, 0.25),
    (6, Counts.UNKNOWN, NAN, NAN),
)


def test_the_kinds_of_counting_are_numbered_without_gaps() -> None:
    """As they are in files of arrays."""
    assert [int(kind) for kind in Counts] == list(range(7)) == sorted(judgement.REASONS)


def test_what_cuts_counts_and_the_rest_is_shown() -> None:
    assert [bool(table((1, kind, 0.0, 0.0)).judged[0]) for kind in Counts] == [True] * 4 + [False] * 3
    assert MIXED.over.tolist() == [False, False, False, True, False, False]
    assert MIXED.largest_mm() == pytest.approx(2e-3)
    assert MIXED.largest_mm(MIXED.line == 3) == pytest.approx(0.5e-3)
    assert MIXED.largest_mm(MIXED.line == 4) == 0.0


@pytest.mark.parametrize(("size_um", "over"), [(1.0999, False), (1.1001, True)])
def test_what_is_allowed_is_tolerance_and_rounding(size_um: float, over: bool) -> None:
    one = table((1, Counts.FEED, 0.0, size_um))
    assert bool(one.over[0]) is over
    assert verdict(one)["ok"] is not over


def test_a_line_states_the_largest_of_what_counts_on_it_else_of_what_is_shown() -> None:
    got = MIXED.by_line()
    assert got["line"].tolist() == [3, 4, 5, 6]
    assert got["uncorrected_um"][:3] == pytest.approx([20.0, 70.0, 30.0])
    assert got["corrected_um"][:3] == pytest.approx([0.5, 60.0, 2.0])
    assert math.isnan(got["corrected_um"][3])
    assert got["uncorrected_state"].tolist() == [ABOVE, SHOWN, ABOVE, SHOWN]
    assert got["corrected_state"].tolist() == [WITHIN, SHOWN, ABOVE, SHOWN]
    assert got["state"].tolist() == [WITHIN, SHOWN, ABOVE, SHOWN]
    assert "measured_um" not in got


def test_a_measured_layer_has_its_own_states_and_can_only_worsen_a_line() -> None:
    sizes = np.array([NAN, 9.0, NAN, 3.0, NAN, NAN])
    runs = Measured(("a",), MIXED.line, MIXED.tool, MIXED.operation, (sizes,), 5.0)
    got = MIXED.with_measured(runs).by_line()
    assert got["measured_um"][[0, 2]] == pytest.approx([9.0, 3.0])
    assert np.isnan(got["measured_um"][[1, 3]]).all()
    assert got["measured_state"].tolist() == [ABOVE, SHOWN, WITHIN, SHOWN]
    assert got["state"].tolist() == [ABOVE, SHOWN, ABOVE, SHOWN]
    assert got["corrected_state"].tolist() == [WITHIN, SHOWN, ABOVE, SHOWN]


def test_groups_stand_in_order_of_appearance_with_their_worst_line() -> None:
    rows = [(10, 3.0, 0.5), (11, 1.0, 0.75), (12, 8.0, 0.75), (20, 2.0, 1.5), (13, 9.0, 0.25)]
    own = table(*((line, Counts.FEED, a, b) for line, a, b in rows), (14, Counts.RAPID, 50.0, 50.0))
    own = replace(own, tool=np.array([7, 7, 7, -1, 7, 9]))
    # the group of number 4 comes first, though 2 is smaller
    groups = own.groups(np.array([4, 4, 4, 2, 4, 5]))
    assert [{k: v for k, v in g.items() if not k.endswith("_um")} for g in groups] == [
        {"first_line": 10, "last_line": 13, "tool": 7, "worst_line": 11, "holds": True},
        {"first_line": 20, "last_line": 20, "tool": None, "worst_line": 20, "holds": False},
    ]
    assert [g["uncorrected_um"] for g in groups] == pytest.approx([9.0, 2.0])
    assert [g["corrected_um"] for g in groups] == pytest.approx([0.75, 1.5])


def test_the_report_counts_by_reason_and_shows_rapids() -> None:
    report = MIXED.report()
    assert report["moves"] == {
        "feed": 2, "point": 0, "hole": 0, "rapid": 2, "left uncorrected": 1, "uncorrected rapid": 0,
        "unknown position": 1,
    }  # fmt: skip
    assert report["shown_um"] == pytest.approx({"rapid": 80.0})
    assert len(report["operations"]) == len(report["tools"]) == 1
    assert "measured" not in report
    shown = table((1, Counts.UNCORRECTED, 7.0, 7.0), (1, Counts.UNCORRECTED, 9.0, 8.0)).report()
    assert shown["shown_um"] == pytest.approx({"uncorrected rapid": 8.0})


def test_operations_are_runs_of_one_tool_and_work_offset() -> None:
    frames = (
        Frame(tool=1, work_offset="G54"),
        Frame(tool=1, work_offset="G54", unit_mm=25.4),
        Frame(tool=2, work_offset="G54"),
        Frame(tool=2, work_offset="G55"),
        Frame(tool=None, work_offset="G54"),
    )

    class Path:
        def __init__(self, frame: list[int]) -> None:
            self.frame, self.frames = np.array(frame), frames

    tool, operation = judgement.groups_of(Path([0, 1, 0, 2, 2, 3, 0, 4]))  # type: ignore[arg-type]
    assert tool.tolist() == [1, 1, 1, 2, 2, 2, 1, -1]
    assert operation.tolist() == [0, 0, 0, 1, 1, 2, 3, 4]


# -- the verdict ----------------------------------------------------------------------------------------


def test_a_good_program_is_within_tolerance() -> None:
    result = verdict(table((3, Counts.FEED, 20.0, 0.5), (4, Counts.FEED, 30.0, 0.75)))
    assert result["ok"] is True
    assert result["part"] is None and result["errors"] == []
    numbers = result["numerical"]
    assert numbers["line"] == 4 and numbers["unknown"] == 0
    assert numbers["left"] is False and numbers["holds"] is True
    keys = ("largest_um", "tolerance_um", "rounding_um", "allowed_um")
    assert [numbers[key] for key in keys] == pytest.approx([0.75, 1.0, 0.1, 1.1])
    assert result["sentences"] == [
        "Within tolerance: the corrected path is at most 0.75 um from the nominal one; 1.10 um are allowed "
        "(numerical tolerance 1 um, rounding 0.10 um)."
    ]


def test_a_line_that_is_left_uncorrected_is_named() -> None:
    result = verdict(table((3, Counts.FEED, 20.0, 0.5), (4, Counts.LEFT, 30.0, 30.0)))
    assert result["ok"] is False and result["numerical"]["left"] is True
    assert result["sentences"][0].startswith(
        "ABOVE TOLERANCE: the corrected path is at most 30.00 um from the nominal one, where line 4 is left "
        "uncorrected; 1.10 um are allowed"
    )


def test_nothing_judged_is_open() -> None:
    result = verdict(table((3, Counts.RAPID, 20.0, 20.0)))
    assert result["ok"] is None
    assert result["numerical"]["line"] is None and result["numerical"]["largest_um"] is None
    assert result["sentences"] == [
        "Not judged: the program has no feed move, hole or point at a known position."
    ]


def test_a_cut_to_an_unknown_position_leaves_the_verdict_open() -> None:
    result = verdict(table((3, Counts.FEED, 20.0, 0.0), (4, Counts.UNKNOWN, NAN, NAN)))
    assert result["ok"] is None
    assert result["sentences"][1] == "1 feed moves to unknown positions are not judged."
    above = verdict(table((3, Counts.FEED, 20.0, 9.0), (4, Counts.UNKNOWN, NAN, NAN)))
    assert above["ok"] is False


@pytest.mark.parametrize(
    ("part_um", "within", "ok", "sentence"),
    [
        (0.8, None, True, "Within the part tolerance of 0.8 um by the calibration, which states no "
         "uncertainty."),
        (0.76, 0.95, True, "Within the part tolerance of 0.76 um with a probability of 95.0 %."),
        (0.8, 0.9499, None, "In doubt for the part tolerance of 0.8 um: within it with a probability of "
         "95.0 % only."),
        (0.7, 0.99, False, "ABOVE the part tolerance of 0.7 um: the corrected path alone is 0.75 um off."),
    ],
)  # fmt: skip
def test_the_part_is_good_where_it_is_within_and_probably_so(
    part_um: float, within: float | None, ok: bool | None, sentence: str
) -> None:
    result = verdict(table((3, Counts.FEED, 20.0, 0.75)), part_um, within)
    assert result["ok"] is ok
    assert result["sentences"][1:] == [sentence]


def test_other_errors_fail_the_verdict_but_its_own_and_warnings_do_not() -> None:
    good = table((3, Counts.FEED, 20.0, 0.75))
    assert verdict(good, findings=(Finding("OLP101", "m"), Finding("OLP108", "m")))["ok"] is True
    assert verdict(good, findings=(Finding("OLP102", "m"),))["errors"] == []


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0.00"), (0.004, "<0.01"), (0.0051, "0.01"), (2.0, "2.00")]
)
def test_a_small_deviation_is_not_written_as_none(value: float, text: str) -> None:
    assert f"at most {text} um" in verdict(table((3, Counts.FEED, 20.0, value)))["sentences"][0]


# -- measured runs --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("runs", "tolerance_um", "ok", "sentences"),
    [
        ((("a", 4.0), ("b", 5.0)), 5.0, True,
         ["Within the part tolerance of 5 um: the measured path is at most 5.00 um from the nominal one."]),
        ((("a", 5.5), ("b", 4.0)), 5.0, False,
         ["ABOVE the part tolerance of 5 um: the measured path is at most 5.50 um from the nominal one."]),
        ((("a", 5.5),), None, None,
         ["The measured path is at most 5.50 um from the nominal one; no part tolerance is stated."]),
        ((("a", 4.0), ("b", None)), 5.0, False,
         ["Within the part tolerance of 5 um: the measured path is at most 4.00 um from the nominal one.",
          "Not verified: no measured point of b counts."]),
        ((), 5.0, False, ["Not verified: no measured point counts."]),
    ],
)  # fmt: skip
def test_a_measured_verdict_needs_every_run(
    runs: tuple[tuple[str, float | None], ...], tolerance_um: float | None, ok: bool | None,
    sentences: list[str],
) -> None:  # fmt: skip
    result = judgement.measured(runs, tolerance_um)
    assert result["ok"] is ok
    assert result["sentences"] == sentences
    assert result["measured"]["not_verified"] == [name for name, size in runs if size is None]


@pytest.mark.parametrize(
    ("a", "b", "ok"),
    [(True, True, True), (True, None, None), (None, True, None), (None, False, False), (False, None, False),
     (None, None, None)],
)  # fmt: skip
def test_two_verdicts_are_one_that_fails_where_either_does(a: bool, b: bool, ok: bool | None) -> None:
    predicted = {"ok": a, "sentences": ["p"], "questions": [1], "part": 1}
    runs = {"ok": b, "sentences": ["m"], "questions": [2], "measured": 2}
    both = judgement.with_measured(predicted, runs)
    assert both == {"ok": ok, "sentences": ["p", "m"], "questions": [1, 2], "part": 1, "measured": 2}


# -- of a proof -----------------------------------------------------------------------------------------


def test_a_proof_as_a_table() -> None:
    """Half a wave of 10 um along the cuts, 4 um aside at all ends; the corrected program is 4 um aside in the
    other direction, which leaves the wave alone."""

    def error(axis_mm: np.ndarray) -> np.ndarray:
        wave = 0.01 * np.sin(np.pi * axis_mm[:, 0] / 50)
        return np.stack((0 * wave, wave, 0 * wave + 0.004), axis=1)

    frames = (Frame(tool=3, work_offset="G54"), Frame(work_offset="G54"))
    none = (NAN, NAN, NAN)
    tail = (rapid(0, 0, 0, flag=PASS, frame=1, line=8), line(*none, frame=1, line=8))

    def moves(z: float) -> tuple[Move, ...]:
        return (
            rapid(0, 0, z, line=5), line(50, 0, z, line=6), line(0, 0, 0, flag=PASS, line=7), *tail,
            rapid(0, 0, z, line=9),
        )  # fmt: skip

    paths = (toolpath(*moves(z), frames=frames) for z in (0.0, -0.004))
    proof = prove(
        *(program(path) for path in paths), Known(error, 4e-5), tolerance_mm=2e-3, digit_mm=1e-3,
        uncorrected=np.array([5]),
    )  # fmt: skip
    table = Judgements.of(proof)
    assert table.counts.tolist() == [
        Counts.RAPID, Counts.FEED, Counts.LEFT, Counts.UNCORRECTED, Counts.UNKNOWN, Counts.UNCORRECTED
    ]  # fmt: skip
    assert table.line.tolist() == [5, 6, 7, 8, 8, 9]
    assert table.tool.tolist() == [3, 3, 3, -1, -1, 3]
    assert table.operation.tolist() == [0, 0, 0, 1, 1, 2]
    both = math.hypot(10, 4)
    assert 1e3 * table.uncorrected == pytest.approx([4, both, both, 4, NAN, 4], abs=0.15, nan_ok=True)
    # what is left uncorrected begins where the corrected cut ended, so in its middle it is 2 um aside
    assert 1e3 * table.corrected == pytest.approx(
        [0, 10, math.hypot(10, 2), 4, NAN, 0], abs=0.15, nan_ok=True
    )
    assert table.uncorrected.dtype == table.corrected.dtype == np.float32
    assert (table.tolerance_mm, table.allowed_mm) == (2e-3, pytest.approx(2.87e-3))
    assert table.measured is None


def test_another_error_is_named_once_and_fails_the_verdict() -> None:
    good = table((3, Counts.FEED, 20.0, 0.75))
    findings = (
        Finding("OLP510", "m"),
        Finding("OLP402", "m"),
        Finding("OLP402", "m"),
        Finding("OLP101", "m"),
    )
    result = verdict(good, findings=findings)
    assert result["ok"] is False
    assert result["errors"] == ["OLP402", "OLP510"]
    assert result["sentences"][1:] == ["Not to be run as it is: OLP402, OLP510."]
    # also where nothing could be judged
    assert verdict(table((3, Counts.RAPID, 20.0, 20.0)), findings=findings)["ok"] is False


def test_a_line_is_put_into_words() -> None:
    left = table((4, Counts.LEFT, 30.0, 30.0))
    result = judgement.verdict(left, None, None, (), lambda line: f"{line} of sub.nc")
    assert "where line 4 of sub.nc is left uncorrected;" in result["sentences"][0]


def test_values_of_the_part() -> None:
    one = table((3, Counts.FEED, 20.0, 0.75), (4, Counts.RAPID, 90.0, 90.0))
    assert verdict(one, 0.5, 0.97)["part"] == {
        "tolerance_um": 0.5, "largest_um": pytest.approx(0.75), "probability": 0.97, "probable": True,
        "holds": False,
    }  # fmt: skip
    assert verdict(one, 2.0)["part"] == {
        "tolerance_um": 2.0, "largest_um": pytest.approx(0.75), "probability": None, "probable": None,
        "holds": True,
    }  # fmt: skip
    # an uncertainty without a probability
    assert judgement.verdict(one, 2.0, {"within": None}, ())["part"]["probability"] is None


def test_exactly_the_part_tolerance_is_within() -> None:
    one = table((3, Counts.FEED, 20.0, 0.5))
    exact = one.largest_mm() * 1e3
    assert verdict(one, exact)["part"]["holds"] is True
    assert verdict(one, exact * (1 - 1e-9))["part"]["holds"] is False


def test_values_of_measured_runs() -> None:
    result = judgement.measured((("a", 4.0), ("b", None), ("c", 5.0)), 4.5)
    assert result["measured"] == {"largest_um": 5.0, "tolerance_um": 4.5, "not_verified": ["b"]}
    assert result["ok"] is False
    nothing = judgement.measured((("a", None), ("b", None)), None)
    assert nothing["measured"] == {"largest_um": None, "tolerance_um": None, "not_verified": ["a", "b"]}
    assert (nothing["ok"], nothing["sentences"]) == (
        None,
        ["Not verified: no measured point of a, b counts."],
    )


def test_a_table_without_moves() -> None:
    none = table()
    assert none.largest_mm() == 0.0
    assert none.by_line()["line"].tolist() == []
    assert none.groups(none.operation) == []
    assert none.report()["shown_um"] == {}
    assert verdict(none)["ok"] is None


def test_the_report_holds_the_measured_layer() -> None:
    runs = Measured(("a",), MIXED.line, MIXED.tool, MIXED.operation, (np.arange(6.0),), 5.0)
    report = MIXED.with_measured(runs).report()
    assert report["measured"] == runs.report()


def test_a_measured_line_above_is_above_whatever_was_predicted() -> None:
    """Of a rapid it is shown alone, of a cut it is judged; a run may know lines of its own order."""
    sizes = np.array([NAN, NAN, 6.0, 1.0, 9.0, NAN])
    runs = Measured(("a",), MIXED.line, MIXED.tool, MIXED.operation, (sizes,), None)
    got = MIXED.with_measured(runs).by_line()
    assert got["measured_um"] == pytest.approx([NAN, 6.0, 9.0, NAN], nan_ok=True)
    assert got["measured_state"].tolist() == [SHOWN, SHOWN, SHOWN, SHOWN]
    assert got["state"].tolist() == [WITHIN, SHOWN, ABOVE, SHOWN]


def test_exactly_what_is_allowed_is_within() -> None:
    one = table((3, Counts.FEED, 1.5, 1.5))
    exact = replace(one, allowed_mm=float(one.corrected[0]))
    below = replace(one, allowed_mm=float(one.corrected[0]) * (1 - 1e-6))
    for judged, over in ((exact, False), (below, True)):
        assert judged.over.tolist() == [over]
        states = judged.by_line()
        assert [states[f"{name}state"][0] for name in ("", "uncorrected_", "corrected_")] == [int(over)] * 3
        assert judged.groups(judged.operation)[0]["holds"] is not over
        assert verdict(judged)["numerical"]["holds"] is not over


def test_states_take_one_byte_a_line() -> None:
    runs = Measured(("a",), MIXED.line, MIXED.tool, MIXED.operation, (np.arange(6.0),), 5.0)
    columns = MIXED.with_measured(runs).by_line()
    assert {columns[name].dtype for name in columns if name.endswith("state")} == {np.dtype(np.uint8)}
    assert runs.by_line()["state"].dtype == np.uint8


@pytest.mark.parametrize("name", ("corrected", "uncorrected"))
def test_a_cut_without_a_figure_is_not_above(name: str) -> None:
    """A stroke of a hole above its bottom."""
    one = replace(table((3, Counts.HOLE, 0.5, 0.5)), **{name: np.array([NAN], np.float32)})
    assert not one.over.any()
    assert one.by_line()[f"{name}_state"].tolist() == [WITHIN]
    assert math.isnan(one.by_line()[f"{name}_um"][0])
    expected = {"corrected_um": 0.5, "uncorrected_um": 0.5} | {f"{name}_um": 0.0}
    (group,) = one.groups(one.operation)
    assert {key: group[key] for key in expected} == pytest.approx(expected)


def test_tool_zero_is_a_tool() -> None:
    one = replace(table((3, Counts.FEED, 1.0, 1.0)), tool=np.array([0]))
    assert [group["tool"] for group in one.groups(one.tool)] == [0]


def test_a_tool_without_a_number_is_none_in_its_frames() -> None:
    """Of a path without frames, and of one without moves."""
    none = toolpath(frames=())
    assert [len(part) for part in judgement.groups_of(none)] == [0, 0]
    assert [len(part) for part in judgement.groups_of(toolpath())] == [0, 0]
    tool, operation = judgement.groups_of(toolpath(line(1, 0, 0), line(2, 0, 0)))
    assert (tool.tolist(), operation.tolist()) == ([-1, -1], [0, 0])
    assert tool.dtype == operation.dtype == np.int64


@pytest.mark.parametrize("block", (1, 7))
@pytest.mark.parametrize("seed", range(4))
def test_groups_do_not_depend_on_blocks(seed: int, block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    judgements, of = drawn_table(seed)
    whole = judgements.groups(of)
    assert len(whole) > 2
    monkeypatch.setattr(columns, "_MOST", block)
    assert judgements.groups(of) == whole


@pytest.mark.parametrize("seed", range(8))
def test_the_worst_lines_are_found_without_all_lines(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Many rows of few lines have the same deviation, so that more and more of them are looked at."""
    judgements, _ = drawn_table(seed)
    rows = judgements.by_line()
    counted = rows["state"] != SHOWN
    order = np.lexsort((rows["line"][counted], -np.nan_to_num(rows["corrected_um"][counted])))
    expected = rows["line"][counted][order][:5]
    monkeypatch.setattr(judgement, "_FEW", 2)
    lines = judgements.worst_lines(5)
    assert set(expected.tolist()) <= set(lines.tolist()) and len(lines) < len(rows["line"])
    part = judgements.on_lines(lines).by_line()
    some = np.isin(rows["line"], lines)
    for name, values in part.items():
        np.testing.assert_array_equal(values, rows[name][some])


def drawn_table(seed: int) -> tuple[Judgements, np.ndarray]:
    """A table of many rows on few lines, and what they are grouped by."""
    rng = np.random.default_rng(seed)
    count = 200
    kinds = rng.choice(
        [Counts.FEED, Counts.RAPID, Counts.LEFT, Counts.UNKNOWN], count, p=[0.7, 0.1, 0.1, 0.1]
    )
    sizes = rng.choice([0.2, 0.4, 1.0, 1.3, 2.0], (2, count))
    lines = np.sort(rng.integers(1, 60, count))
    rows = [
        (int(line), Counts(int(kind)), *pair) for line, kind, pair in zip(lines, kinds, sizes.T, strict=True)
    ]
    return table(*rows), rng.integers(-1, 4, count)
