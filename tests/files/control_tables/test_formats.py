"""Tables of controls: what is read, written and read again is the same, sign conventions included."""

from __future__ import annotations

import contextlib
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_fast
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.calibration.control_tables.controls import Shear
from olp.core.errors import ConfigError, InputError, OlpError, UsageError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.units import AXES
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.files.control_tables.base import Exported, Given, Imported
from olp.files.control_tables.registry import FORMATS, format_named, read_table, write_table

TRAVEL = np.array([[-1000.0, 2000.0], [-500.0, 700.0], [-600.0, 10.0]])
FOLDER = Path("tables")
TARGET = {key: FOLDER / f"gantry{form.ending}" for key, form in FORMATS.items()}


def stated(key: str, **keys: object) -> Given:
    sense = None if FORMATS[key].sense else "correction"
    return Given(**({"machine": "g", "travel_mm": TRAVEL, "sense": sense} | keys))


def again(key: str, exported: Exported, given: Given) -> Imported:
    """What is read from the written bytes."""
    return read_table(next(iter(exported.files)), key, given, lambda path: exported.files[path])


def parts(calibration: Calibration) -> object:
    columns = {
        name: (
            curve.position_mm.tolist(),
            *(getattr(curve, part)[name].tolist() if name in getattr(curve, part) else None
              for part in ("columns", "forward", "backward")),
            curve.reference,
        )
        for curve in calibration.curves
        for name in curve.names
    }  # fmt: skip
    return columns, dict(calibration.squareness), calibration.backlash_mm, calibration.box_mm.tolist()


errors = st.floats(-0.5, 0.5, allow_nan=False).map(lambda v: v + 0.0)


def positions(draw: st.DrawFn, axis: str, even: bool) -> list[float]:
    low, high = TRAVEL[AXES.index(axis)].tolist()
    if even:
        step = draw(st.sampled_from([0.5, 25.0, 50.5, 100.0]))
        count = draw(st.integers(2, 5))
        return [low + i * step for i in range(count)]
    tenths = st.floats(low + 1.0, high - 1.0).map(lambda v: round(v, 4))
    inner = draw(st.lists(tenths, max_size=4, unique=True))
    return [low, *sorted(inner), high]


@st.composite
def tables(draw: st.DrawFn, key: str) -> str | Calibration:
    """A calibration of what the format holds."""
    held = {
        "linuxcnc": ["EXX", "EYY", "EZZ"],
        "beckhoff-ssfk": ["EXX", "EYY", "EZZ"],
        "klipper": [],
        "siemens-cec": [n for n in COMPONENTS if n[1] in AXES],
        "heidenhain": [n for n in COMPONENTS if n[1] in AXES],
    }.get(key, list(COMPONENTS))
    names = sorted(draw(st.sets(st.sampled_from(held), min_size=1, max_size=5))) if held else []
    curves = []
    shared = {a: positions(draw, a, key == "siemens-cec") for a in AXES}
    for name in names:
        q = shared[name[2]] if key == "heidenhain" else positions(draw, name[2], key == "siemens-cec")
        columns = st.lists(errors, min_size=len(q), max_size=len(q))
        both = (key == "siemens-cec" and draw(st.booleans())) or (
            key in ("linuxcnc", "heidenhain", "beckhoff-ssfk") and name[1] == name[2] and draw(st.booleans())
        )
        curves.append(
            Curve(
                name[2], np.array(q), {} if both else {name: draw(columns)},
                {name: draw(columns)} if both else {}, {name: draw(columns)} if both else {},
                interpolation="linear",
            )
        )  # fmt: skip
    square = {}
    if key in ("isg", "etalon", "klipper"):
        square = {name: draw(errors) for name in SQUARENESS}
        square["C0Y"] = square["C0Y"] or 1e-5
    box = TRAVEL.copy()
    for curve in curves:
        j = AXES.index(curve.axis)
        box[j, 1] = min(box[j, 1], curve.position_mm[-1])
    return Calibration(machine="g", box_mm=box, curves=tuple(curves), squareness=square)


@pytest.mark.parametrize(("key", "sense"), some_fast(product(FORMATS, ("error", "correction")), 3))
def test_import_export_import_is_exact(key: str, sense: str) -> None:
    if key in ("linuxcnc", "klipper") and sense != FORMATS[key].sense:
        pytest.skip("the format has its own sign convention")

    @settings(max_examples=25)
    @given(calibration=tables(key))
    def law(calibration: Calibration) -> None:
        state = stated(key, sense=sense)
        first = again(key, write_table(calibration, key, TARGET[key], state), state).calibration
        written = write_table(first, key, TARGET[key], state)
        second = again(key, written, state).calibration
        assert parts(second) == parts(first)
        # and once read, the bytes come back as well
        assert write_table(second, key, TARGET[key], state).files == written.files

    law()


@pytest.mark.parametrize("key", FORMATS)
def test_values_keep_their_sign(key: str) -> None:
    """The values written are read back, and a table of the other sign convention is their negative."""
    name = {"klipper": None}.get(key, "EXX")
    curve = Curve("X", TRAVEL[0], {"EXX": [0.0, 0.125]}, interpolation="linear")
    calibration = Calibration(
        "g", TRAVEL, curves=(curve,) if name else (), squareness={"C0Y": 0.0 if name else -0.25}
    )
    exported = write_table(calibration, key, TARGET[key], stated(key))
    read = again(key, exported, stated(key)).calibration
    if name is None:
        assert read.squareness["C0Y"] == -0.25
        assert exported.corrects == {"C0Y"}
        return
    one = next(c for c in read.curves if "EXX" in c.names)
    assert one.mean("EXX").tolist() == [0.0, 0.125]
    assert "EXX" in exported.corrects
    if key != "linuxcnc":
        other = read_table(
            TARGET[key], key,
            stated(key, sense="error" if FORMATS[key].sense is None else "correction"),
            lambda path: exported.files[path],
        ).calibration  # fmt: skip
        assert next(c for c in other.curves if "EXX" in c.names).mean("EXX").tolist() == [0.0, -0.125]


@settings(max_examples=30)
@given(st.lists(st.integers(-(10**9), 10**9), min_size=3, max_size=3), st.sampled_from([0, 1, 2]))
def test_linuxcnc_types_hold_the_same_errors(picometres: list[int], kind: int) -> None:
    values = [float(f"{v}e-10") for v in picometres]
    curve = Curve("Y", [0.0, 0.3, 100.0], forward={"EYY": values}, backward={"EYY": [0.0, *values[1:]]})
    calibration = Calibration("g", [[0, 9], [0, 100], [0, 9]], curves=(curve,))
    state = Given(kind=kind, travel_mm=TRAVEL, axis="Y", most=3)
    written = write_table(calibration, "linuxcnc", TARGET["linuxcnc"], state)
    (read,) = again("linuxcnc", written, state).calibration.curves
    assert (read.mean("EYY") == curve.mean("EYY")).all()


def test_linuxcnc_rows_worked_by_hand() -> None:
    """At 100 the axis is at 100.002 forward and 99.999 reverse: trims -0.002 and +0.001."""
    ini = b"[TRAJ]\nLINEAR_UNITS=mm\n[JOINT_0]\nCOMP_FILE=x.comp\n[JOINT_2]\nBACKLASH=0.004\n"
    load = {Path("a.ini"): ini, Path("x.comp"): b"0 0 0\n100 100.002 99.999\n"}
    read = read_table(Path("a.ini"), "linuxcnc", Given(travel_mm=TRAVEL), load.__getitem__).calibration
    (curve,) = read.curves
    assert curve.forward["EXX"].tolist() == [0.0, 0.002] and curve.backward["EXX"].tolist() == [0.0, -0.001]
    assert read.backlash_mm == (0.0, 0.0, 0.004)
    written = write_table(read, "linuxcnc", Path("b.ini"), Given())
    assert written.files[Path("b-x.comp")] == b"0.0 0.0 0.0\n100.0 -0.002 0.001\n"
    assert b"BACKLASH = 0.004" in written.files[Path("b.ini")]
    assert written.corrects == {"EXX"}
    assert [f.code for f in written.findings] == ["OLP875"]


ISG = """// Lagefehler
C0Y B0Z A0Z A0B
2.2355737e-05 0 -1e-6 3e-6
#
X EXX EYX ECX // um
0.0 0.02 0.01 0.003
10.0 0.00 -0.1 0.002
#
// the same for every Z
Z Y EYY
0 0 0.5
0 50 0.25
100 0 0.5
100 50 0.25
"""


def test_isg_blocks_arguments_and_squareness() -> None:
    read = read_table(Path("a.csv"), "isg", stated("isg"), lambda path: ISG.encode())
    calibration = read.calibration
    assert [sorted(c.names) for c in calibration.curves] == [["ECX", "EXX", "EYX"], ["EYY"]]
    assert calibration.squareness == {"C0Y": 2.2355737e-05, "B0Z": 0.0, "A0Z": -1e-6}
    assert calibration.box_mm.tolist() == [[0, 10], [0, 50], [-600, 10]]
    assert [f.code for f in read.findings] == ["OLP872"] and "A0B" in read.findings[0].message


ETALON = """// head
[C0Y]
VALUE = 0.000022355737
[C0B]
VALUE = 0.1
[EXY]
Gridpoints = {
   -280.0 -0.001358635132
   -270.0 -0.000240680764   // a row
}  // end of EXY
"""


def test_etalon_sections() -> None:
    read = read_table(Path("a.txt"), "etalon", stated("etalon"), lambda path: ETALON.encode())
    (curve,) = read.calibration.curves
    assert curve.columns["EXY"].tolist() == [-0.001358635132, -0.000240680764]
    assert read.calibration.squareness["C0Y"] == 0.000022355737
    assert "C0B" in read.findings[0].message


CEC = """%_N_NC_CEC_INI
CHANDATA(1)
$AN_CEC[0,0]=0.010 ; sag
$AN_CEC[0,1]=0.020
$AN_CEC[0,2]=0.040
$AN_CEC_INPUT_AXIS[0]=(AX1)
$AN_CEC_OUTPUT_AXIS[0]=(AX3)
$AN_CEC_STEP[0]=58
$AN_CEC_MIN[0]=-585
$AN_CEC_MAX[0]=-469
$AN_CEC_DIRECTION[0]=1
$AN_CEC_MULT_BY_TABLE[0]=0
$AN_CEC_IS_MODULO[0]=0
M17
"""


def test_siemens_tables() -> None:
    names = {"X": "AX1", "Y": "AX2", "Z": "AX3"}
    state = stated("siemens-cec", names=names)
    read = read_table(Path("a.mpf"), "siemens-cec", state, lambda path: CEC.encode())
    (curve,) = read.calibration.curves
    assert curve.position_mm.tolist() == [-585.0, -527.0, -469.0]
    assert curve.forward["EZX"].tolist() == [-0.010, -0.020, -0.040]
    assert curve.backward["EZX"].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("end", ["M17", "M0\n\nM17", "M00\nM30", "N990 RET", "m02"])
@pytest.mark.parametrize("modulo", ["0", "-1"])
def test_siemens_tables_as_programs_write_them(end: str, modulo: str) -> None:
    """Blank lines, a stop before the end, and -1 for a table without modulo change no value."""
    text = CEC.replace("M17", end).replace("MODULO[0]=0", f"MODULO[0]={modulo}").replace("\n$AN", "\n\n$AN")
    state = stated("siemens-cec", names={"X": "AX1", "Y": "AX2", "Z": "AX3"})
    curves = [
        read_table(
            Path("a.spf"), "siemens-cec", state, lambda path, data=data: data.encode()
        ).calibration.curves
        for data in (CEC, text)
    ]
    assert [c.forward["EZX"].tolist() for c in curves[1]] == [c.forward["EZX"].tolist() for c in curves[0]]


SSFK = """# the third gauged position is 10.2 um short in + and 8 um far in -
kopf.log_achs_nr                     2
kopf.log_achs_name                   Y-ACHSE
kw.ssfk.interval                     0
kw.ssfk.kw_startpos                 -200000
kw.ssfk.kw_nr_max                    3
kw.ssfk.unit                         1
kw.ssfk.bilateral                    1
kw.ssfk.table[0].setpoint           -200000
kw.ssfk.table[1].setpoint           -199306
kw.ssfk.table[2].setpoint           -198667
kw.ssfk.table[0].pos                 0
kw.ssfk.table[1].pos                 24
kw.ssfk.table[2].pos                -102
kw.ssfk.table[0].neg                 0
kw.ssfk.table[1].neg                 67
kw.ssfk.table[2].neg                 80
Ende
"""


def test_beckhoff_lists_of_the_manual() -> None:
    read = read_table(Path("a.lis"), "beckhoff-ssfk", stated("beckhoff-ssfk"), lambda path: SSFK.encode())
    (curve,) = read.calibration.curves
    assert curve.position_mm.tolist() == [-20.0, -19.9306, -19.8667]
    assert curve.forward["EYY"].tolist() == [0.0, 0.0024, -0.0102]
    assert curve.backward["EYY"].tolist() == [0.0, 0.0067, 0.008]


def test_beckhoff_lists_with_equal_steps_of_two_axes_in_one_file() -> None:
    one = "kopf.achs_nr 1\nkopf.log_achs_name AX1\nkw.ssfk.unit 1\nkw.ssfk.bilateral 0\n"
    one += "kw.ssfk.interval 500000\nkw.ssfk.kw_startpos -10000\nkw.ssfk.kw_nr_max 2\n"
    one += "kw.ssfk.table[0].pos = 5\nkw.ssfk.table[1].pos = -7\n"
    text = one + one.replace("AX1", "Z")
    state = stated("beckhoff-ssfk", names={"X": "AX1"})
    read = read_table(Path("a.lis"), "beckhoff-ssfk", state, lambda path: text.encode()).calibration
    assert [c.axis for c in read.curves] == ["X", "Z"]
    for curve in read.curves:
        assert curve.position_mm.tolist() == [-1.0, 49.0]
        assert curve.mean(curve.names[0]).tolist() == [0.0005, -0.0007]
    with pytest.raises(UsageError, match=r'axis "AX1".*--axis-name X=AX1'):
        read_table(Path("a.lis"), "beckhoff-ssfk", stated("beckhoff-ssfk"), lambda path: text.encode())
    alone = read_table(
        Path("a.lis"), "beckhoff-ssfk", stated("beckhoff-ssfk", axis="X"), lambda _: one.encode()
    )
    assert alone.calibration.curves[0].axis == "X"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("unit                         1", "unit 0", "line 7: kw.ssfk.unit means increments of the encoder"),
        (
            "bilateral                    1",
            "bilateral 0",
            "line 15: a neg that interval and bilateral do not use",
        ),
        ("kw_nr_max                    3", "kw_nr_max 4", r"table\[3\].pos is missing"),
        ("table[1].pos                 24", "table[1].pos 2.4", "line 13: .* is not an integer"),
        ("table[1].setpoint           -199306", "table[1].setpoint -200000", "line 10: position"),
        ("Ende", "kw.lose.backlash 3", "line 18: .* is not understood"),
        ("kw.ssfk.interval                     0\n", "", "kw.ssfk.interval is missing"),
        (
            "kw.ssfk.interval                     0",
            "kw.ssfk.interval 500",
            "line 9: a setpoint that interval",
        ),
    ],
)
def test_beckhoff_lists_that_are_wrong(old: str, new: str, words: str) -> None:
    assert old in SSFK
    with pytest.raises(ConfigError, match=words):
        read_table(
            Path("a.lis"),
            "beckhoff-ssfk",
            stated("beckhoff-ssfk"),
            lambda path: SSFK.replace(old, new).encode(),
        )


COM = """BEGIN X.COM MM
NR  AXISPOS   X        Z      BACKLASH
0   0         +0.001   0.002  0.003
1   100       0        -0.5   0.25
[END]
"""
CMA = """BEGIN AXIS.CMA MM
NR ACTIVE X      Y     Z
0         old
1  *      x.com        -
[END]
"""


def test_heidenhain_tables() -> None:
    files = {Path("d/a.cma"): CMA.encode(), Path("d/x.com"): COM.encode()}
    state = stated("heidenhain", sense="error")
    read = read_table(Path("d/a.cma"), "heidenhain", state, files.__getitem__).calibration
    table = {name: curve for curve in read.curves for name in curve.names}
    assert table["EXX"].forward["EXX"].tolist() == [0.001, 0.0]
    assert table["EXX"].backward["EXX"].tolist() == [0.003, 0.25]
    assert table["EZX"].columns["EZX"].tolist() == [0.002, -0.5]


KLIPPER = b"""[printer]
kinematics: corexy
#*# [skew_correction calilantern]
#*# xy_skew = -0.0169507368306
#*# xz_skew = 0.001413446673736683
#*# yz_skew = 0.013433643668787586
"""


def test_klipper_factors_of_its_own_manual() -> None:
    """The worked example: (100, 200, 50) is commanded as (103.308..., 199.328..., 50)."""
    read = read_table(Path("p.cfg"), "klipper", stated("klipper"), lambda path: KLIPPER).calibration
    offset = Shear(read).offset(np.array([[100.0, 200.0, 50.0]]), np.zeros(3), np.zeros((1, 3)))
    assert np.allclose(offset[0], [3.30808952450865, -0.67168218343937, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("key", "text", "where"),
    [
        ("linuxcnc", "0 0 0\n# remark\n1 0 0\n", "a.comp: line 2"),
        ("linuxcnc", "0 0 0\n2 0 0\n1 0 0\n", "a.comp: line 3"),
        ("linuxcnc", "".join(f"{i} 0 0\n" for i in range(257)), "line 257: 257 rows"),
        ("linuxcnc", "0 0 0\n", "expected at least 2"),
        ("isg", "X EXX\n0 1\n1 x\n", "line 3"),
        ("isg", "X EXX\n0 1\n0 2\n", "line 3"),
        ("isg", "0 1\n", "line 1: .* not a header"),
        ("isg", "X EYY\n0 1\n1 1\n", "no column Y"),
        ("isg", "Z X EXX\n0 0 1\n1 0 2\n", "line 3: EXX changes with Z"),
        ("isg", "X EXX\n0 0\n9 1\n#\nX EXX\n0 0\n9 1\n", "line 5: EXX is defined twice"),
        ("isg", "X EXX EXX\n0 0 1\n", "defined twice"),
        ("isg", "// nothing\n", "no error of X, Y or Z"),
        ("etalon", "[EXX]\nGridpoints = {\n0 1\n", "line 1: .* not closed"),
        ("etalon", "[EXX]\nVALUE = 1\n", "no Gridpoints"),
        ("etalon", "[EXX]\nGridpoints = {\n0 1\n1\n}\n", "line 4"),
        ("etalon", "[C0Y]\nVALUE = a\n", "line 2"),
        ("etalon", "[C0Y]\nGROSS = 1\n", "line 2: .* not understood"),
        ("klipper", "[skew_correction a]\nxy_skew = b\n", "line 2"),
        ("klipper", "[skew_correction a]\nxyskew = 1\n", "not a key"),
        ("klipper", "[printer]\n", "no section"),
        ("klipper", "[skew_correction a]\nxy_skew=1\n[skew_correction b]\nxy_skew=1\n", "sections a, b"),
        ("siemens-cec", CEC.replace("[0,1]", "[0,4]"), "row 1 is missing"),
        ("siemens-cec", CEC.replace("=58", "=57"), "steps; expected an integer"),
        ("siemens-cec", CEC.replace("MODULO[0]=0", "MODULO[0]=1"), "line 13: IS_MODULO makes a modulo axis"),
        ("siemens-cec", CEC.replace("TABLE[0]=0", "TABLE[0]=2"), "line 12: MULT_BY_TABLE"),
        ("siemens-cec", CEC.replace("MODULO[0]=0", "MODULO[0]=1"), "line 13: IS_MODULO"),
        ("siemens-cec", CEC.replace("(AX1)", "(C1)"), "line 6: .*--axis-name"),
        ("siemens-cec", CEC + CEC.replace("[0", "[1"), "line 17: a second table"),
        ("siemens-cec", CEC.replace("0.020", "0,020"), "line 4"),
        ("siemens-cec", "$MD=1\n", "line 1"),
        ("heidenhain", CMA.replace("*", " "), "0 rows are active"),
        ("heidenhain", CMA.replace("MM", "INCH"), "inches"),
        ("heidenhain", COM, "no column ACTIVE"),
    ],
)
def test_a_wrong_table_is_refused_with_its_line(key: str, text: str, where: str) -> None:
    names = {"X": "AX1", "Y": "AX2", "Z": "AX3"} if key == "siemens-cec" else {}
    state = stated(key, axis="X", kind=1, names=names)
    name = Path("a.comp") if key == "linuxcnc" else TARGET[key]
    with pytest.raises(InputError, match=where):
        read_table(name, key, state, lambda path: text.encode())


@settings(max_examples=60)
@given(st.sampled_from(sorted(FORMATS)), st.sampled_from([ISG, ETALON, CEC, COM, CMA]), st.data())
def test_no_text_makes_anything_but_a_refusal(key: str, text: str, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(text)))
    noise = data.draw(st.text(alphabet="0.1-e[]{}=$_#/*XYZ \n\t\x00é", max_size=8))
    bytes_ = (text[:start] + noise + text[start + data.draw(st.integers(0, 5)) :]).encode()
    with contextlib.suppress(OlpError):
        read_table(TARGET[key], key, stated(key, axis="X", kind=0), lambda path: bytes_)


def test_what_you_have_to_state_is_asked_for() -> None:
    for key in ("siemens-cec", "heidenhain"):
        with pytest.raises(UsageError, match="--sense"):
            read_table(TARGET[key], key, Given(), lambda path: b"")
    with pytest.raises(UsageError, match="--reference"):
        read_table(TARGET["isg"], "isg", Given(chain="YFXZ"), lambda path: ISG.encode())
    with pytest.raises(UsageError, match="--axis"):
        read_table(Path("x.comp"), "linuxcnc", Given(), lambda path: b"0 0 0\n")
    with pytest.raises(UsageError, match="did you mean siemens-cec"):
        format_named("siemenscec")
    with pytest.raises(InputError, match="-m"):
        read_table(TARGET["klipper"], "klipper", Given(), lambda path: KLIPPER)


def test_what_a_format_cannot_hold_is_a_finding() -> None:
    curve = Curve("X", TRAVEL[0], {"EXX": [0, 1e-3], "ECX": [0, 1e-5], "EYX": [0, 0]})
    calibration = Calibration(
        "g", TRAVEL, curves=(curve,), squareness={"C0Y": 1e-5}, backlash_mm=(0.004, 0.0, 0.0),
        cyclic=(Cyclic("EXX", 10.0, 1e-3),), thermal=Thermal((1e-5, 0.0, 0.0)),
    )  # fmt: skip
    texts = {}
    for key in FORMATS:
        findings = write_table(calibration, key, TARGET[key], stated(key)).findings
        texts[key] = " ".join(f"{f.code} {f.message}" for f in findings)
        assert "no table holds thermal of the calibration" in texts[key]
        # 200 or 256 rows cannot follow a pitch of 10 mm over 3 m; formats without a limit can
        limited = key not in ("isg", "etalon")
        assert ("the rows do not follow cyclic errors of EXX" in texts[key]) == limited, key
    assert "cannot hold C0Y, ECX" in texts["linuxcnc"] and "OLP875" in texts["linuxcnc"]
    assert "cannot hold ECX, EXX" in texts["klipper"] and "backlash of X stays" in texts["klipper"]
    assert "cannot hold ECX" in texts["siemens-cec"] and "OLP874" in texts["siemens-cec"]
    assert "backlash of X stays" in texts["isg"] and "cannot hold" not in texts["isg"]
    assert "cannot hold ECX" in texts["heidenhain"] and "OLP875" in texts["heidenhain"]


def test_verification_programs_say_what_an_instrument_must_show() -> None:
    curve = Curve("Y", [0.0, 100.0, 300.0], {"EZY": [0.0, 0.02, -0.03]}, interpolation="linear")
    calibration = Calibration("g", [[0, 9], [0, 300], [0, 9]], curves=(curve,))
    for key, ending in (("siemens-cec", "mpf"), ("heidenhain", "h")):
        files = write_table(calibration, key, TARGET[key], stated(key)).files
        text = files[FOLDER / f"gantry-verify.{ending}"].decode()
        assert "Z by -50.0 um" in text and "WRONG sign: it changes Z by -100.0 um" in text
        assert text.index("100.0000") < text.index("300.0000")
