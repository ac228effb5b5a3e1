"""Results are read, corrected and written in bands: any band gives the same, and plain rows cost no loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from judge.machines import Recipe, random_machine

import olp
from olp.core.errors import InputError, OlpError
from olp.program.text import numbers, rows
from olp.program.text.delimited import Layout, detected_layout, mapping
from olp.reports.report import to_json
from olp.results import dmis, reported, table
from olp.results.dmis_columns import PlainPoints, plain_points
from olp.results.reported import Names
from olp.results.table import read_table

HEAD = "X_mm,Y_mm,Z_mm,I,J,K,tool,name"


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    tools = {
        1: {"Z_mm": 120.0, "radius_mm": 2.5},
        2: {"Z_mm": 120.0, "gauge_to_tip_mm": [40.0, -60.0, -120.0]},
    }
    recipe = Recipe(
        off_datum=True, tools=tools, backlash_um={"X": 6.0},
        work_offsets={"G54": {"X_mm": 210.0, "Y_mm": 180.0, "Z_mm": -260.0, "set_by": "true"}},
    )  # fmt: skip
    return random_machine(tmp_path_factory.mktemp("cmm") / "bridge", 5, recipe)


def points(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    normal = rng.normal(size=(count, 3))
    return rng.uniform(0.0, (150.0, 120.0, 80.0), (count, 3)), normal / np.linalg.norm(normal, axis=1)[
        :, None
    ]


def text(count: int, mark: str = ",", quote: str = "") -> bytes:
    rows = [HEAD.replace(",", mark)]
    for k, (p, n) in enumerate(zip(*points(count), strict=True)):
        cells = [*(f"{v:.4f}" for v in p), *(f"{v:.6f}" for v in n), str(1 + k % 2), f"{quote}p {k}{quote}"]
        rows.append(mark.join(cells))
        if k % 50 == 20:
            rows.append(f"# {k} of them")
    return ("\n".join(rows) + "\n").encode()


def dmis_text(count: int) -> bytes:
    rows = ["UNITS/MM,ANGDEC", "D(G54)=LOCATE", "SNSLCT/S(1)"]
    for k, (p, n) in enumerate(zip(*points(count), strict=True)):
        numbers = ",".join([*(f"{v:.4f}" for v in p), *(f"{v:.6f}" for v in n)])
        rows.append(f"FA(P{k})=FEAT/POINT,CART,{numbers}")
    return ("\r\n".join(rows) + "\r\n").encode()


def done(data: bytes, machine: Path) -> tuple[bytes, bytes]:
    result = olp.correct_results(
        data, machine, frame="G54", tip_radius_mm=1.0, tool={"1": 1, "2": 2} if b"tool" in data else None
    )
    return result.data, to_json(result.report)


@pytest.mark.slow
@pytest.mark.parametrize(
    "data", [text(700), text(700, ";", '"'), dmis_text(700)], ids=["plain", "quoted", "dmis"]
)
def test_bands_of_any_size_give_the_same_bytes_and_the_same_report(
    data: bytes, machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = done(data, machine)
    for points_of_band, bytes_of_band in ((256, 1000), (600, 1)):
        monkeypatch.setattr(reported, "BAND", points_of_band)
        monkeypatch.setattr("olp.workflows.results_report.BAND", points_of_band)
        monkeypatch.setattr(table, "_BAND", bytes_of_band)
        assert done(data, machine) == whole


@pytest.mark.parametrize("data", [text(60), text(60, ";"), text(60, "\t"), text(60).replace(b"\n", b"\r\n")])
def test_a_plain_table_is_read_in_columns_as_row_by_row(
    data: bytes, machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fast = done(data, machine)
    monkeypatch.setattr(table, "columns", lambda *_: None)
    assert done(data, machine) == fast


_CELL = st.sampled_from(
    [
        "1.5",
        "-2",
        "+3.25",
        ".5",
        "7.",
        "1e3",
        "",
        "x",
        '"4.5"',
        " 6.5",
        "8 ",
        "1,5",
        "\x0c9",
        "2e8",
        "-",
        "0012.50",
    ]
)


@example([["200000000", "1.0", "2.0"]], "\n")
@example([["1.5", "\x0c9", "2.0"]], "\n")
@given(
    st.lists(st.lists(_CELL, min_size=2, max_size=4), min_size=1, max_size=5),
    st.sampled_from(["\n", "\r\n", "\r", "\r\r\n"]),
)
def test_odd_tables_are_read_or_refused_as_row_by_row(cells: list[list[str]], end: str) -> None:
    layout = Layout(mapping({"X": 1, "Y": 2, "Z": 3}), "semicolon", unit="mm", header=False)
    data = end.join(";".join(row) for row in cells).encode()

    def outcome() -> Any:
        try:
            read = read_table(data, layout)
        except InputError as error:
            return error.message, error.line
        return [read.line.tolist(), read.start.tolist(), read.end.tolist(), read.value.tolist()]

    fast = outcome()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table, "columns", lambda *_: None)
        assert outcome() == fast


_LINE = st.sampled_from(
    ["UNITS/MM,ANGDEC", "UNITS/INCH,ANGDEC", "D(B)=LOCATE", "RECALL/D(A)", "SNSLCT/S(2)", "SNSET/APPRCH,3.5",
     "FA(P1)=FEAT/POINT,CART,1.5,2,-3.25", "fa(p 2)=feat/point,cart, 1.5 ,2.0,3,0,0,1",
     "FA( P3)=FEAT/POINT,CART,1,2,3", " FA(P4)=FEAT/POINT,CART,1,2,3,0,1,0", "FA(P5)=FEAT/POINT,CART,1,2",
     "FA(P6)=FEAT/POINT,CART,1,2,3,0,1", "FA(P7)=FEAT/POINT,POL,1,2,3", "FA(P8)=FEAT/POINT,CART,1,x,3",
     "FA(P9)=FEAT/POINT,CART,1e3,2,3", "FA(P9)=FEAT/POINT,CART,1,2,300000000",
     "FA(C)=FEAT/CIRCLE,INNER,CART,1,2,3",
     "FA(Pa)=FEAT/POINT,CART,1,2,$", "4.5,0,0,1", "$$ a comment", "$$ that goes on $", "PTDATA/CART,4,5,6",
     "FA(Pb)=FEAT/POINT,CART,1,2,3 $$ here", "FA(P)", "", "TA(T1)=TOL/POS",
     "FA(Pc)=FEAT/POINT,CART,+1.50,.5,7."]
)  # fmt: skip


@pytest.mark.slow
@example(["FA(P$1)=FEAT/POINT,CART,1,2,3"], "\n")
@example(["$$ a comment $", "FA(P1)=FEAT/POINT,CART,1,2,3"], "\r\n")
@example(["FA(P1)=FEAT/POINT,CART,1,2,300000000"], "\n")
@given(st.lists(_LINE, min_size=1, max_size=12), st.sampled_from(["\n", "\r\n", "\r"]))
def test_points_of_dmis_are_read_in_columns_as_one_by_one(lines: list[str], end: str) -> None:
    data = end.join(["UNITS/MM,ANGDEC", *lines]).encode()

    def outcome() -> Any:
        try:
            read = dmis.read_dmis(data)
        except OlpError as error:
            return error.message, error.line
        columns = ("line", "start", "end", "value", "unit_mm", "normal", "frame", "tool", "approach_mm")
        arrays = [np.nan_to_num(getattr(read, name), nan=-7.5).tolist() for name in columns]
        return [*arrays, read.frames, read.tools, list(read.names), read.unchanged, read.stated]

    fast = outcome()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dmis, "plain_points", _no_points)
        assert outcome() == fast


def _no_points(chunk: Any) -> PlainPoints:
    return plain_points(chunk).part(0, 0)


def test_what_is_wrong_far_down_has_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "_BAND", 200)
    lines = text(100).splitlines()
    lines[40], lines[90] = lines[40].replace(b".", b"/", 1), b"1,2"
    with pytest.raises(InputError, match="line 91: 2 columns") as caught:
        read_table(b"\n".join(lines), detected_layout([HEAD, "1,2,3,0,0,1,1,a"]))  # type: ignore[arg-type]
    assert caught.value.line == 41


@pytest.mark.parametrize("make", [text, dmis_text], ids=["table", "dmis"])
def test_twice_the_points_need_no_more_numbers_read_or_written_one_by_one(
    make: Any, machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    for module in (rows, table, dmis, "olp.program.text.rewriting"):
        for name in ("number", "written"):
            if hasattr(module, name) or isinstance(module, str):
                target = f"{module if isinstance(module, str) else module.__name__}.{name}"
                plain = getattr(numbers, name)
                monkeypatch.setattr(target, lambda *a, f=plain, n=name: calls.append(n) or f(*a))
    counts = []
    for count in (300, 600):
        calls.clear()
        done(make(count), machine)
        counts.append(len(calls))
    assert counts[0] == counts[1]


@given(st.lists(st.lists(st.text(max_size=4), max_size=4), min_size=1, max_size=4))
def test_names_in_one_text_are_those_that_were_put_in(parts: list[list[str]]) -> None:
    names, flat = Names.joined([Names.of(part) for part in parts]), [name for part in parts for name in part]
    assert list(names) == flat == [names[k] for k in range(len(names))]
    assert names[1:3] == flat[1:3]
    assert len(names) == len(flat)


def test_the_points_of_a_report_are_plain_data_when_asked_for(machine: Path) -> None:
    rows = olp.correct_results(text(30), machine, frame="G54", tip_radius_mm=1.0).report["points"]
    assert rows[3] == rows.tolist()[3] == rows[-27]
    assert rows[3]["name"] == "p 3"
    size = [row["size_um"] for row in rows]
    assert [row["size_um"] for row in rows.largest(4)] == sorted(size, reverse=True)[:4]
    assert size[3] == pytest.approx(np.linalg.norm(rows[3]["added_um"]), rel=1e-12)
