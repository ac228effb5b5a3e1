"""What is wrong with a table over a grid is said, all of it at once; and grids as text."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.errormodel.gridded import ComponentTable, grid_rows
from olp.errormodel.sources.maps import DeviationMap, Maps

ONE = np.array([0.0])
TWO = np.array([0.0, 10.0])


def table(**changes: Any) -> ComponentTable:
    stated: dict[str, Any] = {
        "axis": "X", "arguments": ("X", "Z"), "knots_mm": (TWO, TWO), "columns": {"EZX": np.zeros((2, 2))},
    }  # fmt: skip
    return ComponentTable(**(stated | changes))


def test_a_right_table_is_taken() -> None:
    good = table()
    assert good.names == ("EZX",)
    assert not good.columns["EZX"].flags.writeable
    assert table(arguments=("X",), knots_mm=(TWO,), columns={"EZX": np.zeros(2)}).names == ("EZX",)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"arguments": ()}, r"arguments \(\); expected one to three of X, Y, Z, each once"),
        ({"arguments": ("X", "X")}, "each once"),
        ({"arguments": ("X", "A")}, "each once"),
        (
            {"knots_mm": (TWO, ONE), "columns": {"EZX": np.zeros((2, 1))}},
            "1 levels along Z; expected at least 2",
        ),
        ({"columns": {}}, "no columns; expected components such as EZX"),
        (
            {"columns": {"EZY": np.zeros((2, 2))}},
            "column 'EZY'; expected one of EXX, EYX, EZX, EAX, EBX, ECX",
        ),
        ({"columns": {"XXX": np.zeros((2, 2))}}, "column 'XXX'; expected one of"),
        ({"columns": {"EZX": np.zeros((2, 3))}}, r"EZX is not a finite number at each of \(2, 2\) nodes"),
        ({"columns": {"EZX": np.full((2, 2), np.nan)}}, "EZX is not a finite number"),
        ({"interpolation": "square"}, "interpolation 'square'; expected linear or cubic"),
        ({"reference": "floor"}, "reference 'floor'; expected functional-point or table"),
        ({"knots_mm": (TWO[::-1], TWO)}, "compliance"),
    ],
)
def test_a_wrong_table_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        table(**changes)


def test_all_that_is_wrong_is_said_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        table(interpolation="square", reference="floor", name="load")
    assert "load: interpolation 'square'" in str(caught.value)
    assert "load: reference 'floor'" in str(caught.value)


def test_problems_of_a_table_and_of_a_map_come_at_once() -> None:
    down = TWO[::-1]
    for make, starts in (
        (
            lambda: table(
                knots_mm=(down, ONE), columns={"EZY": ONE, "EZX": np.zeros((2, 2))}, name="load",
                interpolation="square", reference="floor",
            ),
            ["positions along X do not", "1 levels along Z", "column 'EZY'", "column EZX is",
             "interpolation 'square'", "reference 'floor'"],
        ),
        (
            lambda: deviations(
                knots_mm=(down, TWO, np.array([0.0, np.inf])), values=np.zeros((2, 2, 1, 3)), kind="part",
                sigma=np.zeros(3), interpolation="square", holds_along=("Y",), name="load",
            ),
            ["positions along X do not", "positions along Z do not", "expected three finite",
             "expected three uncertainties", "kind 'part'", "interpolation 'square'", "2 levels along Y"],
        ),
    ):  # fmt: skip
        with pytest.raises(ConfigError) as caught:
            make()
        found = [p.replace("load has ", "load: ").removeprefix("load: ") for p in caught.value.problems]
        assert [p[: len(start)] for p, start in zip(found, starts, strict=True)] == starts


def test_what_a_table_does_not_state() -> None:
    plain = table()
    assert (plain.line_mm, plain.tool_mm, plain.name) == (None, (0.0, 0.0, 0.0), "compliance")
    assert (plain.reference, plain.interpolation) == ("functional-point", "cubic")
    rest = deviations()
    assert (rest.kind, rest.tool_mm, rest.interpolation) == ("residual", (0.0, 0.0, 0.0), "linear")
    assert (rest.holds_along, rest.name, rest.sigma) == ((), "map", None)
    assert not rest.values.flags.writeable and not rest.knots_mm[0].flags.writeable
    with pytest.raises(TypeError):
        plain.columns["EXX"] = TWO  # type: ignore[index]


def deviations(**changes: Any) -> DeviationMap:
    stated: dict[str, Any] = {"knots_mm": (TWO, TWO, TWO), "values": np.zeros((2, 2, 2, 3))}
    return DeviationMap(**(stated | changes))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"values": np.zeros((2, 2, 2))}, "expected three finite deviations at each of"),
        ({"values": np.full((2, 2, 2, 3), np.inf)}, "expected three finite deviations"),
        ({"sigma": np.zeros((2, 2, 3))}, "expected three uncertainties of 0 or above"),
        ({"sigma": np.full((2, 2, 2, 3), np.nan)}, "expected three uncertainties of 0 or above"),
        ({"sigma": np.full((2, 2, 2, 3), -1e-9)}, "expected three uncertainties of 0 or above"),
        ({"kind": "partial"}, "kind 'partial'; expected residual or total"),
        ({"interpolation": "square"}, "interpolation 'square'; expected linear or cubic"),
        (
            {"knots_mm": (TWO, TWO, ONE), "values": np.zeros((2, 2, 1, 3))},
            "one level along Z; expected two levels",
        ),
        ({"holds_along": ("Z",)}, "2 levels along Z, and holds_along names Z; expected one level"),
    ],
)
def test_a_wrong_map_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        deviations(**changes)


def test_a_right_map_is_taken() -> None:
    assert deviations(sigma=np.full((2, 2, 2, 3), 0.5)).sigma is not None
    flat = deviations(knots_mm=(TWO, TWO, ONE), values=np.zeros((2, 2, 1, 3)), holds_along=("Z",))
    assert flat.values.shape == (2, 2, 1, 3)


def test_a_grid_as_text_has_one_row_per_node_the_last_argument_first() -> None:
    cells = {"a": ["1", "2", "3", "4"], "b": ["5", "6", "7", "8"]}
    text = grid_rows(("X", "Z"), (TWO, np.array([-1.5, 2.0])), cells)
    assert text == "X_mm,Z_mm,a,b\n0,-1.5,1,5\n0,2,2,6\n10,-1.5,3,7\n10,2,4,8\n"


def test_inspect_shows_a_map_with_its_largest_deviation() -> None:
    """3, 4 and 12 um along the axes at one node: 13 um."""
    values = np.zeros((2, 2, 2, 3))
    values[1, 0, 1] = 3e-3, -4e-3, 12e-3
    shown = Maps().inspect((deviations(values=values, tool_mm=(1.0, 2.0, 3.0), name="a"),), None)  # type: ignore[arg-type]
    assert shown["maps"] == [
        {"name": "a", "kind": "residual", "interpolation": "linear", "nodes": "2 x 2 x 2",
         "tool_mm": [1.0, 2.0, 3.0], "max_um": pytest.approx(13.0)}
    ]  # fmt: skip
    assert Maps().inspect((), None) == {}  # type: ignore[arg-type]
