"""Sums of models, and what all models say of positions that are not known."""

from __future__ import annotations

import numpy as np
import pytest

from olp.core.errors import UsageError
from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.sources.maps import DeviationMap
from olp.errormodel.total import Total, total

BOX = np.array([[0.0, 100.0], [-300.0, 300.0], [-400.0, 0.0]])
POINTS = np.array([[25.0, 0.0, -100.0], [100.0, 30.0, 0.0]])
TOOL = np.array([5.0, -6.0, -70.0])


def scale(box: np.ndarray = BOX, **more: object) -> ErrorModel:
    """EXX of 1 um per mm of X and EBX of 1 urad per mm, measured with the tool at the datum."""
    curve = Curve("X", box[0], {"EXX": box[0] * 1e-3, "EBX": box[0] * 1e-6}, tool_mm=(0.0, 0.0, -70.0),
                  interpolation="linear")  # fmt: skip
    return build(Calibration("m", box, curves=(curve,), **more), "FXYZ")  # type: ignore[arg-type]


def test_everything_of_two_models_adds() -> None:
    one = scale(backlash_mm=(2e-3, 0.0, 0.0))
    two = build(
        Calibration(
            "m", BOX, compliance=(ComponentTable("Y", ("Y",), (BOX[1],), {"EZY": [1e-3, 1e-3]}),),
            squareness={"C0Y": 1e-4}, backlash_mm=(1e-3, 0.0, 4e-3),
        ),
        "FXYZ",
    )  # fmt: skip
    three = build(Calibration("m", BOX, cyclic=(Cyclic("EAY", 40.0, 1e-5),)), "FXYZ")
    both = total([one, two, three])
    assert isinstance(both, Total)
    play, loaded = np.array([[1.0, -1.0, 0.5], [0.0, 1.0, -1.0]]), np.array([*TOOL, 10.0])
    parts = (one, two, three)
    for given in (None, play):
        expected = sum(m.error(POINTS, loaded, given) for m in parts)
        np.testing.assert_allclose(both.error(POINTS, loaded, given), expected, atol=1e-16)
        turned = sum(m.rotation(POINTS, given, 10.0) for m in parts)
        np.testing.assert_allclose(both.rotation(POINTS, given, 10.0), turned, atol=1e-18)
        names = [name for m in parts for name, _ in m.contributions(POINTS, loaded, given)]
        assert [name for name, _ in both.contributions(POINTS, loaded, given)] == names
    np.testing.assert_allclose(both.backlash_at(POINTS), [[3e-3, 0.0, 4e-3]] * 2)
    np.testing.assert_array_equal(one.backlash_at(POINTS), [[2e-3, 0.0, 0.0]] * 2)
    np.testing.assert_array_equal(both.depends_on, one.depends_on | two.depends_on | three.depends_on)
    assert not np.array_equal(both.depends_on, one.depends_on)
    delta = np.array([[10.0, 20.0, 30.0]])
    bounds = sum(m.chord_bound(delta, TOOL) for m in parts)
    np.testing.assert_allclose(both.chord_bound(delta, TOOL), bounds)
    assert total([three, build(Calibration("m", BOX), "FXYZ")]).backlash_at(POINTS) is None
    with pytest.raises(UsageError, match="no error model to add; expected at least one"):
        total([])


def test_the_box_of_a_sum_is_what_its_models_share() -> None:
    other = np.array([[-50.0, 90.0], [-200.0, 400.0], [-400.0, -10.0]])
    both = total([scale(), scale(other)])
    np.testing.assert_array_equal(both.box_mm, [[0.0, 90.0], [-200.0, 300.0], [-400.0, -10.0]])
    points = np.array(
        [[0.0, 300.0, -10.0], [90.0, -200.0, -400.0], [-1.0, 301.0, -9.0], [np.nan, 0.0, -400.1]]
    )
    np.testing.assert_array_equal(
        both.inside(points), [[True] * 3, [True] * 3, [False] * 3, [False, True, False]]
    )


# -- positions that are not known --------------------------------------------------------------------------


def rows_of(model: ErrorModel, points: np.ndarray, tool: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "error": model.error(points, tool),
        "rotation": model.rotation(points, None, 1.0),
        **dict(model.contributions(points, tool)),
    }


@pytest.mark.parametrize("chain", ["FXYZ", "YFXZ", "ZYXF"])
@pytest.mark.parametrize("kind", ["curves", "compliance", "maps"])
def test_an_unknown_position_hides_what_depends_on_it_and_nothing_else(kind: str, chain: str) -> None:
    """Rows beside it, and components that do not depend on the axis, stay as they are."""
    columns = {"EXX": [1e-3, 1e-3], "EYX": [0.0, 1e-2], "EAX": [2e-6, 2e-6], "EBX": [0.0, 2e-6]}
    levels = [np.array(pair) for pair in BOX]
    values = np.zeros((2, 2, 2, 3))
    values[1, :, :, 1], values[..., 0], values[:, :, 1, 2] = 1e-2, 1e-3, 3e-3
    parts = {
        "curves": (Curve("X", BOX[0], columns, interpolation="linear"),),
        "compliance": (ComponentTable("X", ("X",), (BOX[0],), columns, interpolation="linear"),),
        "maps": (DeviationMap(tuple(levels), values),),  # type: ignore[arg-type]
    }[kind]
    model = build(Calibration("m", BOX, **{kind: parts}), chain)  # type: ignore[arg-type]
    tool = np.array([5.0, -6.0, -70.0, 1.0])
    known = np.tile(POINTS[:1], (4, 1))
    whole, depends = rows_of(model, known, tool), model.depends_on
    unknown = known.copy()
    unknown[[0, 1, 2], [0, 1, 2]] = np.nan
    found = rows_of(model, unknown, tool)
    assert found.keys() == whole.keys()
    for name, rows in found.items():
        np.testing.assert_array_equal(rows[3], whole[name][3])
        for j in range(3):
            hidden = np.isnan(rows[j])
            if name == "rotation":
                # EBX alone changes, and with X alone
                assert hidden.tolist() == [False, j == 0 and kind != "maps", False]
            else:
                assert hidden.tolist() == depends[:, j].tolist(), (name, j)
            # EAX and EXX are the same all along, so that what is shown is as if X were at its lower face
            np.testing.assert_allclose(rows[j][~hidden], whole[name][j][~hidden], atol=1e-18)
