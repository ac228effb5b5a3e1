"""A calibration refuses what contradicts itself, and says everything that is wrong at once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.errormodel.build import build
from olp.errormodel.calibration import PLACEHOLDER_DATE, Calibration, Curve, Cyclic, Thermal
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.sources.beams import Beam
from olp.errormodel.sources.maps import DeviationMap
from olp.errormodel.sources.structure import Distortion, Sensor, Structure

BOX = np.array([[0.0, 100.0]] * 3)
X = [0.0, 50.0, 100.0]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"axis": "W"}, "axis 'W'"),
        ({"position_mm": [0.0]}, "1 positions"),
        ({"position_mm": [0.0, 50.0, 50.0]}, "strictly increase"),
        ({"columns": {}}, "expected columns"),
        ({"forward": {"EXX": [0, 0, 0]}, "backward": {"EXX": [0, 0, 0]}}, "expected columns"),
        ({"columns": {}, "forward": {"EXX": [0, 0, 0]}}, "both directions"),
        ({"columns": {"EXY": [0, 0, 0]}}, "'EXY'"),
        ({"columns": {"EDX": [0, 0, 0]}}, "'EDX'"),
        ({"columns": {"EXX": [0, math.nan, 0]}}, "finite"),
        ({"columns": {"EXX": [0, 0]}}, "EXX"),
        ({"interpolation": "cubic"}, "'cubic'"),
        ({"reference": "floor"}, "'floor'"),
        ({"line_mm": (0.0, math.inf, 0.0)}, "line_mm"),
    ],
)
def test_a_bad_curve_is_refused(options: dict[str, object], expected: str) -> None:
    with pytest.raises(ConfigError, match=expected):
        Curve(**({"axis": "X", "position_mm": X, "columns": {"EXX": [0, 0, 0]}} | options))


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"box_mm": np.zeros((2, 2))}, "box_mm"),
        ({"box_mm": BOX[:, ::-1]}, "box_mm"),
        ({"box_mm": BOX * 2.0}, "expected all of the box"),
        ({"model": "soft"}, "'soft'"),
        ({"squareness": {"C0X": 0.0}}, "C0X"),
        ({"squareness": {"C0Y": math.nan}}, "C0Y"),
        ({"backlash_mm": (math.nan, 0.0, 0.0)}, "backlash_mm"),
        ({"backlash_mm": (1e-3, 0.0, 0.0)}, "direction column"),
    ],
)
def test_a_contradiction_is_refused(options: dict[str, object], expected: str) -> None:
    curve = Curve("X", X, forward={"EXX": [0, 0, 1e-3]}, backward={"EXX": [0, 0, 2e-3]})
    with pytest.raises(ConfigError, match=expected):
        Calibration(**({"machine": "m", "box_mm": BOX, "curves": (curve,)} | options))


def test_a_component_stands_once() -> None:
    curve = Curve("X", X, {"EXX": [0, 0, 1e-3]})
    with pytest.raises(ConfigError, match="EXX is in two curves"):
        Calibration("m", BOX, curves=(curve, curve))


def test_every_problem_is_named() -> None:
    with pytest.raises(ConfigError) as caught:
        Curve("X", [1.0, 0.0], {"EXY": [0, 0], "EXX": [0, math.nan]}, interpolation="cubic")
    assert len(caught.value.problems) == 4


@pytest.mark.parametrize("bad", [("EXW", 1.0, 1.0), ("EXX", 0.0, 1.0), ("EXX", 1.0, math.nan)])
def test_a_bad_cyclic_term_is_refused(bad: tuple[str, float, float]) -> None:
    with pytest.raises(ConfigError):
        Cyclic(*bad)


def test_a_bad_temperature_is_refused() -> None:
    with pytest.raises(ConfigError):
        Thermal(workpiece_degC=math.nan)


def test_values_are_frozen_copies() -> None:
    values = np.zeros(3)
    curve = Curve("X", X, {"EXX": values})
    values[0] = 1.0
    assert curve.columns["EXX"][0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        curve.columns["EXX"][0] = 1.0


def test_a_cyclic_angle_has_its_lever_arm() -> None:
    term = Cyclic("EAY", 8.0, 2e-5, 0.3)
    model = build(Calibration("m", BOX, cyclic=(term,)), "FXYZ")
    y = np.array([1.0, 3.0, 5.5])
    points = np.stack([np.zeros(3), y, np.full(3, 60.0)], axis=1)
    angle = 2e-5 * np.sin(2.0 * np.pi * y / 8.0 + 0.3)
    error = model.error(points, np.array([0.0, 7.0, -100.0]))
    np.testing.assert_allclose(error[:, 1], -angle * (60.0 - 100.0), atol=1e-7)
    np.testing.assert_allclose(error[:, 2], angle * 7.0, atol=1e-7)


# -- relations between the parts ---------------------------------------------------------------------------


def problems(**options: object) -> tuple[str, ...]:
    """What is wrong with a calibration, nothing where it is right."""
    try:
        Calibration(**({"machine": "m", "box_mm": BOX} | options))
    except ConfigError as error:
        return error.problems
    return ()


def curve(low: float, high: float, name: str = "EXX", **more: object) -> Curve:
    return Curve(name[2], [low, 0.5 * (low + high), high], {name: [0, 0, 1e-3]}, **more)


RUNS = "; expected all of the box, 0 to 100 mm"


@pytest.mark.parametrize(
    ("low", "high", "sentence"),
    # a file may miss a face by its rounding, a millionth of a mm
    [
        (1e-6, 100.0 - 1e-6, ""),
        (-5.0, 105.0, ""),
        (1.2e-6, 100.0, "runs from 1.2e-06 to 100 mm"),
        (0.0, 100.0 - 1.2e-6, "runs from 0 to 100 mm"),
        (0.5, 99.0, "runs from 0.5 to 99 mm"),
    ],
)
def test_all_that_is_tabled_reaches_the_faces_of_the_box(low: float, high: float, sentence: str) -> None:
    span = (low, high)
    table = ComponentTable("X", ("Z", "X"), (BOX[2], np.array(span)), {"EZX": np.zeros((2, 2))}, name="load")
    described = DeviationMap((np.array(span), *BOX[1:]), np.zeros((2, 2, 2, 3)), name="map")
    stretched = Structure((Sensor("s", 20.0, (15.0, 25.0)),), (Distortion("EXX", "s", span, 1e-3),))
    cases = {
        "curve of axis X": {"curves": (curve(*span),)},
        "load": {"compliance": (table,)},
        "map": {"maps": (described,)},
    }
    for label, options in cases.items():
        found = problems(**options)
        assert len(found) == bool(sentence)
        if sentence:
            assert found[0].startswith(f"{label} {sentence}") and RUNS in found[0]
    beam = Beam("X", "simple", span, 210.0, 1e6)
    back = Beam("X", "simple", span[::-1], 210.0, 1e6)
    for options, start in (
        ({"structure": stretched}, "the distortion of EXX is known from"),
        ({"beams": (beam,)}, "beam of axis X spans"),
        ({"beams": (back,)}, "beam of axis X spans"),
    ):
        found = problems(**options)
        assert len(found) == bool(sentence)
        assert all(problem.startswith(start) and RUNS in problem for problem in found)


def test_one_level_of_a_map_holds_everywhere() -> None:
    levels = (BOX[0], BOX[1], np.array([300.0]))
    assert problems(maps=(DeviationMap(levels, np.zeros((2, 2, 1, 3)), holds_along=("Z",)),)) == ()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"box_mm": [[0, 1], [0, 1], [1, 1]]}, "box_mm: expected a lower and a higher axis position"),
        ({"box_mm": [[0, 1], [0, 1], [0, math.inf]]}, "box_mm: expected a lower and a higher"),
        ({"box_mm": [[0, 1], [0, 1]]}, "box_mm: expected a lower and a higher"),
        ({"model": "soft"}, "model 'soft'; expected rigid-body or huddersfield"),
        ({"squareness": {"C0X": 0.0}}, "squareness C0X = 0.0; expected finite angles C0Y, B0Z, A0Z"),
        ({"squareness": {"C0Y": math.inf}}, "squareness C0Y = inf; expected finite angles"),
        ({"datum_mm": (0.0, 0.0)}, "datum_mm = (0.0, 0.0); expected three finite lengths"),
        ({"datum_mm": (0.0, 0.0, math.nan)}, "datum_mm = (0.0, 0.0, nan); expected three finite lengths"),
        ({"backlash_mm": (0.0,)}, "backlash_mm = (0.0,); expected three finite lengths"),
        ({"backlash_mm": (0.0, math.inf, 0.0)}, "backlash_mm = (0.0, inf, 0.0); expected three finite"),
        ({"repeatability_mm": (0.0, 0.0, -1e-9)}, "repeatability_mm = (0.0, 0.0, -1e-09); expected three"),
        ({"repeatability_mm": (0.0, math.nan, 0.0)}, "repeatability_mm = (0.0, nan, 0.0); expected three"),
        ({"payload_kg": -1e-9}, "payload_kg = -1e-09; expected the mass while measuring, 0 or above"),
        ({"payload_kg": math.inf}, "payload_kg = inf; expected the mass"),
        ({"payload_kg": math.nan}, "payload_kg = nan; expected the mass"),
    ],
)
def test_a_value_that_cannot_be_is_refused(options: dict[str, object], sentence: str) -> None:
    (problem,) = problems(**options)
    assert problem.startswith(sentence)


def test_values_at_their_limits_are_taken() -> None:
    assert problems(repeatability_mm=(0.0, 0.0, 1e-3), payload_kg=0.0) == ()
    assert problems(payload_kg=12.5, backlash_mm=(-1e-3, 0.0, 0.0), model="huddersfield") == ()
    assert problems(squareness={"C0Y": 1e-5, "B0Z": 0.0, "A0Z": -1.0}) == ()


def test_all_of_its_own_problems_come_at_once_and_before_those_of_its_parts() -> None:
    found = problems(
        box_mm=BOX[:, ::-1], model="soft", squareness={"C0Y": math.nan}, datum_mm=(0.0,),
        backlash_mm=(math.nan, 0.0, 0.0), payload_kg=-1.0,
    )  # fmt: skip
    starts = ["box_mm:", "model 'soft'", "squareness C0Y", "datum_mm =", "backlash_mm ="]
    assert [problem.startswith(start) for problem, start in zip(found, starts, strict=True)] == [True] * 5


def test_a_component_is_measured_once() -> None:
    both = {"forward": {"EYX": [0, 0, 0]}, "backward": {"EYX": [0, 0, 1e-3]}}
    reversed_ = Curve("X", X, **both)
    assert problems(curves=(curve(0, 100), reversed_, curve(0, 100, "EXY"))) == ()
    assert problems(curves=(curve(0, 100), curve(0, 100, "EYX"), curve(0, 100, "EYX"))) == (
        "EYX is in two curves; expected each component once; merge the files",
    )
    # a backlash of an axis and its curve with a direction column are the same thing
    (problem,) = problems(curves=(reversed_,), backlash_mm=(1e-3, 0.0, 0.0))
    assert problem.startswith("axis X has a backlash and a curve with a direction column")
    assert problems(curves=(reversed_,), backlash_mm=(0.0, 1e-3, 1e-3)) == ()
    assert problems(curves=(curve(0, 100),), backlash_mm=(1e-3, 0.0, 0.0)) == ()


def load(axis: str, *names: str, name: str = "compliance") -> ComponentTable:
    return ComponentTable(axis, (axis,), (BOX[0],), {n: [0.0, 1e-3] for n in names}, name=name)


def test_a_load_is_measured_once() -> None:
    one, two = load("X", "EZX", "EBX", name="one"), load("X", "EYX", "EZX", "EBX", name="two")
    assert problems(compliance=(one, load("Y", "EZY"))) == ()
    assert [p.split(";")[0] for p in problems(compliance=(one, two))] == [
        "EBX is in one and in two", "EZX is in one and in two",
    ]  # fmt: skip
    beam = Beam("X", "simple", (0.0, 100.0), 210.0, 1e6)
    (problem,) = problems(compliance=(one,), beams=(beam,))
    assert problem.startswith("EZX is in one, and a beam of axis X bends it too; expected one of the two")
    assert problems(compliance=(load("X", "EYX"), load("Y", "EZY")), beams=(beam,)) == ()
    bent = Beam("X", "simple", (0.0, 100.0), 210.0, 1e6, "+Y")
    assert len(problems(compliance=(load("X", "EYX"),), beams=(bent, beam))) == 1


def test_a_map_of_all_that_was_measured_stands_alone_but_for_what_is_zero() -> None:
    def described(kind: str) -> DeviationMap:
        return DeviationMap(tuple(BOX), np.zeros((2, 2, 2, 3)), kind, name=f"a {kind} map")

    whole, rest = described("total"), described("residual")
    nothing = {"C0Y": 0.0, "B0Z": 0.0, "A0Z": 0.0}
    assert problems(maps=(whole, rest, rest), squareness=nothing, backlash_mm=(1e-3, 0.0, 0.0)) == ()
    term = Cyclic("EXX", 10.0, 1e-3)
    assert problems(maps=(rest,), squareness={"C0Y": 1e-5}, curves=(curve(0, 100),), cyclic=(term,)) == ()
    (problem,) = problems(maps=(rest, whole, whole))
    assert problem.startswith('a total map is a second map of kind "total"; expected one')
    for options, held in (
        ({"squareness": {"C0Y": 0.0, "A0Z": 1e-5}}, "squareness"),
        ({"curves": (curve(0, 100),)}, "curves"),
        ({"cyclic": (term,)}, "cyclic"),
    ):
        (problem,) = problems(maps=(whole,), **options)
        assert problem.startswith(f'a total map is of kind "total", so it holds {held} already;')


def test_only_the_scale_of_the_same_axis_counts_twice() -> None:
    sensor = Sensor("s", 20.0, (15.0, 25.0))
    structure = Structure(
        (sensor,), tuple(Distortion(n, "s", (0.0, 100.0), 1e-3) for n in ("EYY", "EXX", "EXY"))
    )
    assert structure.components() == ["EXX", "EXY", "EYY"]
    grown = Thermal(scale_per_K=(0.0, 1e-5, 1e-5))
    (problem,) = problems(structure=structure, thermal=grown)
    assert problem.startswith("the thermal structure holds EYY, and Y_scale_um_m_K expands the scale again;")
    assert len(problems(structure=structure, thermal=Thermal(scale_per_K=(1e-5, 1e-5, 0.0)))) == 2
    assert problems(structure=structure, thermal=Thermal(scale_per_K=(0.0, 0.0, 1e-5))) == ()
    assert problems(structure=structure, thermal=Thermal(workpiece_per_K=1e-5)) == ()
    assert problems(structure=structure) == ()


def test_a_calibration_copies_and_freezes_what_it_is_given() -> None:
    box, square = BOX.copy(), {"C0Y": 1e-5}
    calibration = Calibration("m", box, squareness=square)
    box[0, 0], square["C0Y"] = 7.0, 8.0
    assert calibration.box_mm[0, 0] == 0.0 and calibration.squareness["C0Y"] == 1e-5
    assert not calibration.box_mm.flags.writeable
    with pytest.raises(TypeError):
        calibration.squareness["C0Y"] = 0.0  # type: ignore[index]


def test_what_a_calibration_does_not_state_is_nothing() -> None:
    plain = Calibration("m", BOX)
    assert (plain.model, plain.payload_kg, plain.temperature_degC) == ("rigid-body", 0.0, 20.0)
    assert plain.datum_mm == plain.backlash_mm == (0.0, 0.0, 0.0)
    for name in ("repeatability_mm", "thermal", "structure", "measured", "valid_until", "quality"):
        assert getattr(plain, name) is None
    for name in ("curves", "squareness", "cyclic", "maps", "compliance", "beams", "more"):
        assert not getattr(plain, name)
    # files that are to be filled in have a date that no calibration has
    assert PLACEHOLDER_DATE.isoformat() == "2000-01-01"
    assert plain.curves_of("X") == () and plain.active_during_measurement == frozenset()
    model = build(plain, "FXYZ")
    assert not model.error(np.array([[1.0, 2.0, 3.0]]), np.zeros(3)).any()


def test_what_the_models_of_sources_are_told() -> None:
    calibration = Calibration("m", BOX, datum_mm=(1.0, 2.0, 3.0), payload_kg=4.0)
    frame = calibration.frame("YFXZ")
    assert (frame.chain, frame.datum_mm, frame.payload_kg) == ("YFXZ", (1.0, 2.0, 3.0), 4.0)
    assert (frame.hold, frame.tool_terms, frame.loads) == (False, True, ())
    held = Calibration("m", BOX, model="huddersfield").frame("FXYZ", hold=True)
    assert (held.hold, held.tool_terms) == (True, False)
    np.testing.assert_array_equal(frame.box_mm, BOX)


@pytest.mark.parametrize(
    "options",
    [
        {"scale_per_K": (0.0, math.nan, 0.0)},
        {"workpiece_per_K": math.inf},
        {"fixed_at_mm": (math.nan, 0.0, 0.0)},
        {"clamped_at_mm": (0.0, 0.0, math.inf)},
        {"calibrated_at_degC": math.nan},
        {"scale_degC": (20.0, 20.0, math.nan)},
    ],
)
def test_an_expansion_is_finite(options: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="thermal: a value is not finite"):
        Thermal(**options)


def test_an_expansion_that_states_nothing_expands_nothing() -> None:
    plain = Thermal()
    assert plain.scale_per_K == plain.fixed_at_mm == plain.clamped_at_mm == (0.0, 0.0, 0.0)
    assert (plain.workpiece_per_K, plain.calibrated_at_degC, plain.workpiece_degC) == (0.0, 20.0, 20.0)
    assert plain.scale_degC == (20.0, 20.0, 20.0)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"axis": "XY"}, "curve of axis 'XY'; expected X, Y or Z"),
        ({"axis": ""}, "curve of axis ''; expected X, Y or Z"),
        ({"position_mm": []}, "curve of axis X: 0 positions; expected at least 2"),
        ({"position_mm": [[0.0, 1.0], [2.0, 3.0]]}, "curve of axis X: 4 positions; expected at least 2"),
        ({"position_mm": [0.0, 50.0, math.inf]}, "curve of axis X: positions do not strictly increase"),
        ({"position_mm": [0.0, 50.0, 1.01e9]}, "curve of axis X: a position is beyond 1e+09 mm"),
        ({"position_mm": [0.0, 50.0, 49.0]}, "curve of axis X: positions do not strictly increase"),
        ({"columns": {"EXX": [0, 0]}}, "curve of axis X: column EXX is not a finite number at each of 3"),
        (
            {"columns": {"EXY": [0, 0, 0]}},
            "curve of axis X: column 'EXY'; expected one of EXX, EYX, EZX, EAX, EBX, ECX",
        ),
        (
            {"columns": {}, "forward": {"EXX": [0, 0, 0]}, "backward": {"EYX": [0, 0, 0]}},
            "curve of axis X: expected columns of the mean, or the same columns in both directions",
        ),
        ({"tool_mm": (0.0, 0.0)}, "curve of axis X: tool_mm = (0.0, 0.0); expected three finite lengths"),
        ({"tool_mm": (0.0, 0.0, math.nan)}, "curve of axis X: tool_mm = (0.0, 0.0, nan); expected three"),
        ({"line_mm": (0.0,)}, "curve of axis X: line_mm = (0.0,); expected three finite lengths"),
    ],
)
def test_what_is_wrong_with_a_curve(options: dict[str, object], sentence: str) -> None:
    good = {"axis": "X", "position_mm": X, "columns": {"EXX": [0, 0, 0]}}
    with pytest.raises(ConfigError) as caught:
        Curve(**(good | options))
    assert len(caught.value.problems) == 1
    assert caught.value.problems[0].startswith(sentence)


def test_a_curve_of_two_positions_in_either_form_is_taken() -> None:
    one = Curve("X", [0.0, 1.0], {"EXX": [1.0, 3.0], "EBX": [0.0, 0.0]})
    assert one.names == ("EXX", "EBX") and one.arguments == ("X",)
    assert one.mean("EXX").tolist() == [1.0, 3.0] and one.half_difference("EXX") is None
    assert (one.line_mm, one.tool_mm, one.reference, one.interpolation) == (
        None, (0.0, 0.0, 0.0), "functional-point", "pchip",
    )  # fmt: skip
    two = Curve("Y", [0.0, 1.0], forward={"EYY": [1.0, 3.0]}, backward={"EYY": [5.0, 2.0]})
    assert two.names == ("EYY",)
    half = two.half_difference("EYY")
    assert half is not None
    assert two.mean("EYY").tolist() == [3.0, 2.5] and half.tolist() == [-2.0, 0.5]


def test_problems_of_all_parts_come_at_once() -> None:
    """Each kind of relation is broken once, in two places where it can be."""
    short = np.array([0.0, 99.0])
    ends = (short, *BOX[1:])
    maps = tuple(DeviationMap(ends, np.zeros((2, 2, 2, 3)), "total", name=f"map {n}") for n in "ab")
    tables = tuple(ComponentTable("X", ("X",), (short,), {"EZX": short}, name=f"load {n}") for n in "ab")
    stretched = Structure((Sensor("s", 20.0, (15.0, 25.0)),), (Distortion("EYY", "s", (0.0, 99.0), 1e-3),))
    found = problems(
        curves=(curve(0.0, 99.0), curve(0.0, 99.0)), maps=maps, compliance=tables, structure=stretched,
        thermal=Thermal(scale_per_K=(0.0, 1e-5, 0.0)), beams=(Beam("X", "simple", (0.0, 99.0), 210.0, 1e6),),
        repeatability_mm=(-1.0, 0.0, 0.0), payload_kg=-1.0,
    )  # fmt: skip
    starts = [
        "curve of axis X runs", "curve of axis X runs", "EXX is in two curves", "map a runs", "map b runs",
        "map b is a second map", "map a is of kind", "load a runs", "EZX is in load a and in load b",
        "load b runs", "the distortion of EYY", "the thermal structure holds EYY", "EZX is in load b, and a",
        "beam of axis X spans", "repeatability_mm =", "payload_kg =",
    ]  # fmt: skip
    assert [p[: len(start)] for p, start in zip(found, starts, strict=True)] == starts
