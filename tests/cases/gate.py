"""For every code of a finding, a program that triggers it and one that just does not."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cases.acceptance import TRUE_ZERO, machine

import olp

DAY = datetime.date(2026, 11, 21)
#: units, a path tolerance and known axes, so that nothing else is found
HEAD = b"G21 G90 G54 G64 P0.0001 Q0\nG0 X0 Y0 Z0\nF600\n"
#: a feed comes first, so no rapid can take the backlash up
COLD = b"G21 G90 G54 G64 P0.0001 Q0\nF600\n"
ORIGIN = "X = 0.0, Y = 0.0, Z = 0.0"
#: probabilities are stated for a part tolerance
PART: dict[str, Any] = {"part_tolerance_um": 1.0}
DMIS = b"DMISMN/'CHECK',05.2\nUNITS/MM,ANGDEC\n"
MCS = '[work_offsets.MCS]\nset_by = "true"\n'
PROBED = b"GOTO/10,10,10\nMEAS/POINT,F(A),1\nPTMEAS/CART,10,10,0,0,0,1\nENDMES\nENDFIL\n"
APT = b"UNITS/MM\nRAPID\nGOTO/-5,-10,0\nFEDRAT/600,MMPM\n"
#: an arc of a form that is not known, which begins upwards in Y
TURN = b"GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10,0.06\nGOTO/0,10,0\nFINI\n"
HEIDENHAIN = b"BEGIN PGM A MM\n"
PRESET = b"CYCL DEF 247 Q339=1\nL X+0 Y+0 Z+0 FMAX\nL X+100 F600\nEND PGM A MM\n"
#: the preset 1 is stated
PRESETS = f'{TRUE_ZERO}[work_offsets.1]\nX_mm = 0.0\nY_mm = 0.0\nZ_mm = 0.0\nset_by = "true"\n'
TOUCH = "[work_offsets.G54]\n"
LIST = b"# frame=G54\nX_mm,Y_mm,Z_mm\n"
TURNED = b"# frame=G54\nX_mm,Y_mm,Z_mm,C_deg\n"
CALLED = b"M98 P1 L2\nM2\nO1\nG1 X100\nX0\nM99\n"
#: errors of a machine without files: one that does not depend on Z, and one that does
SKEWED, LEANING = (olp.KnownErrors.of([f"{axes}=1mm/m"]) for axes in ("XY", "XZ"))
PLAIN = b"G21 G90 G54\nG0 X0 Y0 Z0\nF600\n"
#: two tools of lengths that nothing states
TOOLS = b"T1 M6\nG0 X0 Y0 Z5\nG1 Z0\nT2 M6\nG0 X0 Y0 Z5\nG1 Z0\n"
LISTED = 'dialect = "layout.toml"\n'
LAYOUT = {
    "layout.toml": b'schema = "olp-points-1"\ndelimiter = "comma"\ndecimal = "point"\nheader = true\n'
    b'unit = "mm"\nframe = "G54"\n[columns]\nX = "X_mm"\nY = "Y_mm"\nZ = "Z_mm"\n'
}


@dataclass(frozen=True)
class Call:
    """A call of `check`, all of it from text."""

    body: bytes = b"G1 X100\n"
    head: bytes = HEAD
    nominal: bytes | None = None
    calibration: str = ""
    curves: Mapping[str, str] = field(default_factory=dict)
    tables: str = TRUE_ZERO
    keys: str = ""
    controller: str = "linuxcnc"
    increment_mm: float = 0.001
    job: str = ""
    start: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    swap: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    known: olp.KnownErrors | None = None

    def machine(self, folder: Path) -> Path:
        job = f"start_mm = {{ {self.start} }}\n{self.job}"
        path = machine(
            folder, self.calibration, self.curves, controller=self.controller, keys=self.keys,
            tables=self.tables, job=job, increment_mm=self.increment_mm,
        )  # fmt: skip
        for name, data in self.files.items():
            (folder / name).write_bytes(data)
        for old, new in self.swap.items():
            for file in (path, path.with_name("calibration.toml")):
                file.write_text(file.read_text().replace(old, new, 1))
        return path

    def program(self) -> bytes:
        return self.head + self.body

    def run(self, folder: Path) -> olp.Check:
        if self.known is not None:
            return olp.check(self.program(), self.known, date=DAY)
        path = self.machine(folder)
        nominal = None if self.nominal is None else self.head + self.nominal
        options = {"date": DAY, **self.options}
        return olp.check(self.program(), path, path.with_name("job.toml"), nominal=nominal, **options)


def box(x_most: float) -> dict[str, str]:
    return {"box_mm = [[-1000.0, 2000.0]": f"box_mm = [[-1000.0, {x_most}]"}


def travel(x_most: float) -> dict[str, str]:
    return {"travel_mm = [-1000.0, 2000.0]": f"travel_mm = [-1000.0, {x_most}]"}


def tool(z_mm: float, more: str = "") -> str:
    return f"{TRUE_ZERO}[tools.1]\nZ_mm = {z_mm}\nradius_mm = 5.0\n{more}[job_defaults]\ntool = 1\n"


def curve(z_mm: float) -> dict[str, Any]:
    table = f'[[curves]]\nfile = "x.csv"\ntool_mm = [0.0, 0.0, {z_mm}]\n'
    return {"calibration": table, "curves": {"x.csv": "X_mm,EXX_um\n-1000,0\n2000,1\n"}}


def scaled(um: float) -> dict[str, Any]:
    """An error of X that grows from 0 at 0 to so much at 100 mm."""
    table = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
    return {
        "calibration": table,
        "curves": {"x.csv": f"X_mm,EXX_um\n-1000,{-10 * um}\n2000,{20 * um}\n"},
    }


def limited(um: float) -> dict[str, Any]:
    """The same on a machine that states 1010 um as its largest error."""
    return {**scaled(um), "swap": {"[axes.X]": "[check]\nlargest_correction_um = 1010.0\n[axes.X]"}}


def valued(*um: float) -> dict[str, Any]:
    """Values of EXX from -1000 to 2000 mm."""
    step = 3000.0 / (len(um) - 1)
    rows = "".join(f"{-1000.0 + k * step},{value}\n" for k, value in enumerate(um))
    table = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
    return {"calibration": table, "curves": {"x.csv": f"X_mm,EXX_um\n{rows}"}}


def with_square(um: float) -> dict[str, Any]:
    """A curve that ends at so much, beside squareness."""
    calls = valued(0.0, um)
    return {**calls, "calibration": calls["calibration"] + "[squareness]\nC0Y_urad = 10.0\n"}


def tilted() -> dict[str, Any]:
    return {"calibration": "[squareness]\nB0Z_urad = 100.0\n"}


def per_axis(x_um: float, others_um: float) -> dict[str, Any]:
    """An error of each axis along itself."""
    curves = {
        f"{a.lower()}.csv": f"{a}_mm,E{a}{a}_um\n-1000,0\n2000,{x_um if a == 'X' else others_um}\n"
        for a in "XYZ"
    }
    return {"calibration": "".join(f'[[curves]]\nfile = "{name}"\n' for name in curves), "curves": curves}


def quality(chi_square: float) -> dict[str, Any]:
    return {"calibration": f"[quality]\nchi_square = {chi_square}\ndegrees_of_freedom = 100.0\n"}


def stated(calibration: str) -> dict[str, Any]:
    return {"calibration": calibration}


def known(sigma_um: float, more: str = "") -> dict[str, Any]:
    """An error of X of 10 um everywhere, known to so much."""
    table = f'[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n{more}'
    rows = "".join(f"{q},10,{sigma_um}\n" for q in (-1000, 2000))
    return {"calibration": table, "curves": {"x.csv": f"X_mm,EXX_um,sigma_EXX_um\n{rows}"}}


def growing(share: float) -> dict[str, Any]:
    return known(0.01, f"[covariance]\ngrowth_per_year = {share}\n")


def total_map() -> dict[str, Any]:
    nodes = [f"{x},{y},{z},0,0,0" for x in (-1000, 2000) for y in (-1000, 2000) for z in (-1000, 2000)]
    text = "\n".join(["X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um", *nodes])
    table = '[[maps]]\nfile = "map.csv"\nkind = "total"\ntool_mm = [0.0, 0.0, -150.0]\n'
    return {"calibration": table, "curves": {"map.csv": text}}


def load(um_kg: float) -> dict[str, Any]:
    """A sag that does not depend on the place."""
    text = f"X_mm,EZX_um_kg\n-1000,{-um_kg}\n2000,{-um_kg}\n"
    return {"calibration": '[[compliance]]\nfile = "load.csv"\n', "curves": {"load.csv": text}}


def sag(um: float) -> dict[str, Any]:
    """Straightness that is zero at both ends of a metre and `um` in its middle."""
    text = f"X_mm,EZX_um\n-1000,0\n0,0\n500,{um}\n1000,0\n2000,0\n"
    table = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
    return {"calibration": table, "curves": {"x.csv": text}}


def structure() -> dict[str, Any]:
    text = (
        'schema = "olp-thermal-1"\nmachine = "m"\n[[sensors]]\nname = "beam"\nreference_degC = 20.0\n'
        'range_degC = [15.0, 30.0]\n[[distortions]]\ncomponent = "EXX"\nsensor = "beam"\n'
        "span_mm = [-1000.0, 2000.0]\noffset_um_K = 1.0\n"
    )
    return {"calibration": '[thermal]\nstructure = "t.toml"\n', "curves": {"t.toml": text}}


def sensor(degC: float) -> str:
    return f"[temperatures_degC.sensors]\nbeam = {degC}\n"


def roll(urad: float) -> dict[str, Any]:
    table = '[[curves]]\nfile = "x.csv"\n'
    return {"calibration": table, "curves": {"x.csv": f"X_mm,EAX_urad\n-1000,{urad}\n2000,{urad}\n"}}


ARC = b"G1 X100 Y-10\nG3 X100 Y10 I0 J10\n"
STAMP = b"(olp-corrected 0123456789ab olp 0)\n"
BACK = "[backlash]\nX_um = 20.0\n"
WIGGLE = b"G1 X100\n" + b"".join(b"G1 X%.3f\n" % (100 + 0.15 * (k % 2)) for k in range(1, 8))
SLOWER = b"".join(b"G1 X%.3f\n" % (100 + 0.25 * (k % 2)) for k in range(1, 8))
FANUC = b"G21 G90 G54\nG0 X0. Y0. Z0.\nF600\n"


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> bytes:
    """A box as ASCII STL."""
    corner = [[(low, high)[(k >> i) & 1][i] for i in range(3)] for k in range(8)]
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    lines = ["solid box"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex {:.17g} {:.17g} {:.17g}".format(*corner[k]) for k in face]
        lines += ["endloop", "endfacet"]
    return ("\n".join([*lines, "endsolid box"]) + "\n").encode()


def clamp(high: float, role: str = "fixture", frame: str = "G54") -> dict[str, Any]:
    """A block on the path from X0 to X100, between X40 and X60, whose top is at `high`."""
    return {
        "job": f'[[meshes]]\nfile = "clamp.stl"\nrole = "{role}"\nframe = "{frame}"\n',
        "files": {"clamp.stl": block((40.0, -10.0, -50.0), (60.0, 10.0, high))},
    }


ENDLESS = {"valid_until = 2099-01-01\n": ""}
UNTIL = {"2099-01-01": "2027-06-01"}
OVER = b"G0 Z10\nG0 X100\n"

#: code -> (a call that triggers it, one that just does not)
CASES: dict[str, tuple[Call, Call]] = {
    # allowed: 1 um and 0.87 of a digit of 1 um
    "OLP101": (
        Call(b"G1 X100.002\n", nominal=b"G1 X100\n"),
        Call(b"G1 X100.001\n", nominal=b"G1 X100\n"),
    ),
    "OLP102": (Call(b"G53 G0 Z0\n"), Call(b"G0 Z0\n")),
    "OLP103": (
        Call(head=COLD, start=ORIGIN, calibration="[backlash]\nX_um = 2.1\n"),
        Call(head=COLD, start=ORIGIN, calibration="[backlash]\nX_um = 1.9\n"),
    ),
    "OLP104": (Call(b"G1 X100 A90\n"), Call(b"G1 X100\n")),
    # the middle of the stroke is exact: its ends are off by 100 urad times half of it
    "OLP105": (
        Call(b"G81 X10 Y10 Z-21 R0\nG80\n", increment_mm=1e-4, **tilted()),
        Call(b"G81 X10 Y10 Z-18 R0\nG80\n", increment_mm=1e-4, **tilted()),
    ),
    "OLP106": (Call(tables=tool(100.0), **roll(201.0)), Call(tables=tool(100.0), **roll(199.0))),
    "OLP107": (Call(b"G53 G0 X0 Y0 Z0\n", head=b"G21 G90\n"), Call()),
    "OLP108": (
        Call(b"G1 X100.001\n", nominal=b"G1 X100\n", options={"part_tolerance_um": 0.9}),
        Call(b"G1 X100.001\n", nominal=b"G1 X100\n", options={"part_tolerance_um": 1.1}),
    ),
    "OLP109": (Call(b"o1 repeat [1]\nG1 X100\no1 endrepeat\nM2\n"), Call(b"G1 X100\nM2\n")),
    "OLP110": (
        Call(CALLED.replace(b"L2", b"\nG52 X500\nM98 P1"), **valued(0.0, 90.0)),
        Call(CALLED, **valued(0.0, 90.0)),
    ),
    "OLP201": (Call(b"G64\nG1 X100\n"), Call(b"G64 P0.0001 Q0\nG1 X100\n")),
    "OLP202": (
        Call(b"G64 P0.0101 Q0\nG1 X100\n", **scaled(10.0)),
        Call(b"G64 P0.0099 Q0\nG1 X100\n", **scaled(10.0)),
    ),
    "OLP203": (Call(b"G64 P0.0001\nG1 X100\n"), Call(b"G64 P0.0001 Q0\nG1 X100\n")),
    # short is below 10 times the backlash, less what the correction takes up
    "OLP204": (Call(WIGGLE, calibration=BACK), Call(b"G1 X100\n" + SLOWER, calibration=BACK)),
    "OLP205": (Call(b"G1 X100 F30001\n"), Call(b"G1 X100 F30000\n")),
    # 2000 mm/s2 at a radius of 5 mm: 100 mm/s
    "OLP206": (Call(b"G1 X100\nG2 I5 F6010\n"), Call(b"G1 X100\nG2 I5 F5990\n")),
    "OLP207": (
        Call(b"G1 X100\n", swap={"velocity_mm_s = 500.0\n": ""}),
        Call(b"G1 X100\n", swap={"jerk_mm_s3 = 20000.0\n": ""}),
    ),
    "OLP301": (
        Call(head=b"G90 G54 G64 P0.0001 Q0\nG0 X0 Y0 Z0\nF600\n"),
        Call(head=b"G21 G90 G54 G64 P0.0001 Q0\nG0 X0 Y0 Z0\nF600\n"),
    ),
    "OLP302": (
        Call(b"G1 X1000\n", head=FANUC, controller="fanuc"),
        Call(b"G1 X1000.\n", head=FANUC, controller="fanuc"),
    ),
    "OLP303": (Call(tables=TOUCH), Call(tables=TRUE_ZERO)),
    "OLP334": (
        Call(b"LIGHTS\nG0 X0 Y0 Z0\nG1 X100 E5\n", b"G21\nG90\nG0 X0 Y0 Z0\n", controller="klipper"),
        Call(
            b"LIGHTS\nG1 X100 E5\n",
            b"G21\nG90\nG0 X0 Y0 Z0\n",
            controller="klipper",
            keys='still_macros = ["lights"]\n',
        ),
    ),
    "OLP304": (Call(b"/G1 X100 Y0 Z0\nG1 X100 Y0 Z0\n"), Call(b"G1 X100 Y0 Z0\n")),
    "OLP305": (
        Call(b"G41 D1\nG1 X100\nG40\n", tables=tool(50.0)),
        Call(b"G1 X100\nG40\n", tables=tool(50.0)),
    ),
    "OLP306": (
        Call(b"(olp off)\nG1 X100\n(olp on)\nG1 Y100\n", **scaled(10.0)),
        Call(b"G1 X100\nG1 Y100\n", **scaled(10.0)),
    ),
    "OLP307": (
        Call(b"G93 G1 X100 F10\nG1 X200\n"),
        Call(b"G93 G1 X100 F10\nG1 X200 F10\n"),
    ),
    "OLP308": (Call(b"G95 S100 M3\nG1 X100 F1\n"), Call(b"G94 S100 M3\nG1 X100 F1\n")),
    "OLP309": (
        Call(b"G1 X100 F631\n", nominal=b"G1 X100 F600\n"),
        Call(b"G1 X100 F629\n", nominal=b"G1 X100 F600\n"),
    ),
    "OLP310": (
        Call(b"G0 Z49.998\nX100\n", nominal=b"G0 Z50\nX100\n"),
        Call(b"G0 Z49.999\nX100\n", nominal=b"G0 Z50\nX100\n"),
    ),
    "OLP311": (Call(b"G1 X1\n" + STAMP * 2), Call(b"G1 X1\n" + STAMP)),
    "OLP312": (Call(b"G1 X1\n" + STAMP), Call(b"G1 X1\n")),
    "OLP313": (
        Call(b"CUTCOM/LEFT\nGOTO/5,1,0\nFINI\n", APT, controller="apt"),
        Call(b"CUTCOM/OFF\nGOTO/5,1,0\nFINI\n", APT, controller="apt"),
    ),
    "OLP401": (
        Call(swap=UNTIL, options={"date": datetime.date(2027, 6, 2)}),
        Call(swap=UNTIL, options={"date": datetime.date(2027, 6, 1)}),
    ),
    "OLP462": (Call(swap=ENDLESS, options={"date": None}), Call(options={"date": None})),
    "OLP463": (
        Call(swap=ENDLESS, options={"date": datetime.date(2027, 1, 16)}),
        Call(swap=ENDLESS, options={"date": datetime.date(2027, 1, 15)}),
    ),
    "OLP402": (Call(ARC, swap=travel(109.999)), Call(ARC, swap=travel(110.0))),
    "OLP403": (
        Call(ARC, swap=box(109.999), options={"outside_box": "hold"}),
        Call(ARC, swap=box(110.0), options={"outside_box": "hold"}),
    ),
    "OLP404": (Call(keys='compensated_by_controller = ["EXX"]\n'), Call()),
    "OLP405": (Call(ARC, swap=box(109.999)), Call(ARC, swap=box(110.0))),
    "OLP406": (
        Call(tables=tool(150.1), **curve(-50.0)),
        Call(tables=tool(150.0), **curve(-50.0)),
    ),
    "OLP407": (
        Call(job="[temperatures_degC]\nX_scale = 25.1\n"),
        Call(job="[temperatures_degC]\nX_scale = 25.0\n"),
    ),
    "OLP408": (Call(options={"date": None}), Call()),
    "OLP409": (Call(**limited(1011.0)), Call(**limited(1009.0))),
    "OLP410": (
        Call(keys='compensated_by_controller = "all"\n'),
        Call(keys="compensated_by_controller = []\n"),
    ),
    "OLP411": (
        Call(increment_mm=0.001, options={"tolerance_um": 0.86}),
        Call(increment_mm=0.001, options={"tolerance_um": 0.88}),
    ),
    "OLP331": (
        Call(b"10,20,30\n20,20,30\n", LIST, controller="list"),
        Call(b"10,20,30\n20,20,30\n", LIST, job=LISTED, files=LAYOUT),
    ),
    "OLP332": (
        Call(b"10,20,30,0\n20,20,30,0.002\n", TURNED, controller="list"),
        Call(b"10,20,30,0\n20,20,30,0\n", TURNED, controller="list"),
    ),
    "OLP333": (
        Call(b"0.000,0.000,0.000\n1000.000,0.000,0.000\n", LIST, controller="list", **sag(2.1)),
        Call(b"0.000,0.000,0.000\n1000.000,0.000,0.000\n", LIST, controller="list", **sag(1.7)),
    ),
    "OLP412": (
        Call(b"TECOMP/ON,0.00001\n" + PROBED, DMIS, tables=MCS, controller="dmis"),
        Call(b"TECOMP/OFF\n" + PROBED, DMIS, tables=MCS, controller="dmis"),
    ),
    "OLP413": (
        Call(b"GOTO/5,1,0\n" + TURN, APT, controller="apt"),
        Call(b"GOTO/10,-10,0\n" + TURN, APT, controller="apt"),
    ),
    "OLP414": (
        Call(b"TRANS/5,0,0\nGOTO/5,1,0\nFINI\n", APT, controller="apt"),
        Call(b"TRANS/0,0,0\nGOTO/5,1,0\nFINI\n", APT, controller="apt"),
    ),
    "OLP415": (
        Call(
            PROBED.replace(b"PTMEAS/CART,10,10,0,0,0,1", b"PAMEAS/DISTANCE,0.5,P(A)"),
            DMIS,
            tables=MCS,
            controller="dmis",
        ),
        Call(b"P(A)=PATH/LINE,CART,0,0,0,9,0,0\nSCNMOD/ON\n" + PROBED, DMIS, tables=MCS, controller="dmis"),
    ),
    "OLP416": (
        Call(APT + b"GOTO/10,0,0\nCIRCLE/0,0,0,0,-.6,.8,10\nGOTO/0,8,6\n", APT, controller="apt"),
        Call(APT + b"GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/0,10,0\n", APT, controller="apt"),
    ),
    "OLP417": (
        Call(PRESET.replace(b"=1", b"=2"), HEIDENHAIN, controller="heidenhain", tables=PRESETS),
        Call(PRESET, HEIDENHAIN, controller="heidenhain", tables=PRESETS),
    ),
    "OLP420": (Call(tables=tool(151.1), **total_map()), Call(tables=tool(150.9), **total_map())),
    "OLP421": (
        Call(b"G1 X100\n(olp payload 30)\nG1 X90\n", **load(0.11)),
        Call(b"G1 X100\n(olp payload 30)\nG0 X90\nG1 X80\n", **load(0.11)),
    ),
    "OLP422": (Call(job="payload_kg = 1.0\n"), Call(job="payload_kg = 1.0\n", **load(0.01))),
    "OLP423": (Call(**structure()), Call(job=sensor(20.0), **structure())),
    "OLP424": (
        Call(job=sensor(30.1), options={"outside_box": "hold"}, **structure()),
        Call(job=sensor(30.0), options={"outside_box": "hold"}, **structure()),
    ),
    # one waypoint: the gain of 10 um exceeds its uncertainty up to a sigma of 5 um
    "OLP431": (Call(**known(5.1), options=PART), Call(**known(4.9), options=PART)),
    "OLP432": (Call(**known(5.1), options=PART), Call(**known(4.9), options=PART)),
    # 20 um are 1.96 sigma of 10.2 um; drawn, so not nearer
    "OLP433": (
        Call(**known(11.2), options={"part_tolerance_um": 20.0}),
        Call(**known(9.2), options={"part_tolerance_um": 20.0}),
    ),
    # 11.5 um/(m K) at 100 mm, half a um
    "OLP434": (
        Call(**known(0.01), job="[temperatures_degC]\nX_scale = 20.45\n", options=PART),
        Call(**known(0.01), job="[temperatures_degC]\nX_scale = 20.42\n", options=PART),
    ),
    # the mean of a curve of two independent halves is known to sigma / sqrt(2)
    "OLP435": (Call(**known(7.2)), Call(**known(6.9))),
    "OLP436": (
        Call(**known(7.2), options={"only_sure_components": True}),
        Call(**known(6.9), options={"only_sure_components": True}),
    ),
    # 310 days after measuring
    "OLP437": (Call(**growing(1.19)), Call(**growing(1.16))),
    "OLP440": (Call(**valued(0.0, 0.0)), Call(**valued(0.0, 0.1))),
    "OLP441": (Call(), Call(**valued(0.0, 0.1))),
    "OLP442": (
        Call(swap={"measured = 2026-01-15": "measured = 2000-01-01"}),
        Call(swap={"measured = 2026-01-15": "measured = 2000-01-02"}),
    ),
    # reduced chi-square of 4, at 100 degrees of freedom 14 standard deviations
    "OLP443": (Call(**quality(401.0)), Call(**quality(399.0))),
    "OLP444": (Call(swap={"[quality]\nchi_square = 99.0\ndegrees_of_freedom = 100.0\n": ""}), Call()),
    # the limit is 1 mm per metre of a diagonal of 5.196 m
    "OLP445": (Call(**valued(0.0, 5198.0)), Call(**valued(0.0, 5194.0))),
    "OLP446": (
        Call(**stated("[squareness]\nC0Y_urad = 10001.0\n")),
        Call(**stated("[squareness]\nC0Y_urad = 9999.0\n")),
    ),
    "OLP447": (
        Call(**stated("[backlash]\nX_um = 1001.0\n")),
        Call(**stated("[backlash]\nX_um = -999.0\n")),
    ),
    "OLP448": (
        Call(**stated('[[cyclic]]\ncomponent = "EXX"\nperiod_mm = 20.0\namplitude_um = 101.0\n')),
        Call(**stated('[[cyclic]]\ncomponent = "EXX"\nperiod_mm = 20.0\namplitude_um = 99.0\n')),
    ),
    "OLP449": (
        Call(**valued(10, -9, 10, -8, 81, -9, 9, -10)),
        Call(**valued(10, -9, 10, -8, 79, -9, 9, -10)),
    ),
    "OLP450": (Call(**per_axis(0.4, 121.0)), Call(**per_axis(0.4, 119.0))),
    # 0.1 um per metre of the same diagonal
    "OLP451": (Call(**valued(0.0, 0.51)), Call(**valued(0.0, 0.53))),
    # 5 % of 3 m
    "OLP452": (Call(swap=travel(1856.0)), Call(swap=travel(1860.0))),
    "OLP453": (
        Call(**stated("datum_mm = [5001.0, 0.0, 0.0]\n")),
        Call(**stated("datum_mm = [4999.0, 0.0, 0.0]\n")),
    ),
    "OLP454": (Call(tables=tool(0.99)), Call(tables=tool(1.01))),
    "OLP455": (Call(tables=tool(851.0), **curve(-50.0)), Call(tables=tool(849.0), **curve(-50.0))),
    "OLP456": (
        Call(start="X = 3501.0, Y = 0.0, Z = 0.0"),
        Call(start="X = 3499.0, Y = 0.0, Z = 0.0"),
    ),
    "OLP457": (
        Call(job="[temperatures_degC]\nworkpiece = 50.1\n"),
        Call(job="[temperatures_degC]\nworkpiece = 49.9\n"),
    ),
    "OLP458": (
        Call(**stated("[thermal]\nX_scale_um_m_K = 40.1\n")),
        Call(**stated("[thermal]\nX_scale_um_m_K = 39.9\n")),
    ),
    "OLP459": (Call(job="payload_kg = 20001.0\n"), Call(job="payload_kg = 19999.0\n")),
    "OLP460": (
        Call(options={"date": datetime.date(2026, 1, 14)}),
        Call(options={"date": datetime.date(2026, 1, 15)}),
    ),
    "OLP461": (
        Call(b"G1 X1000\n", head=FANUC.replace(b".", b""), controller="fanuc"),
        Call(b"G1 X1000\n", head=FANUC, controller="fanuc"),
    ),
    # an offset counts above 200 um, and ten times what the column varies by
    "OLP464": (Call(**valued(300.0, 305.0, 335.0)), Call(**valued(300.0, 305.0, 336.0))),
    "OLP465": (
        Call(swap={"velocity_mm_s = 500.0": "velocity_mm_s = 5501.0"}),
        Call(swap={"velocity_mm_s = 500.0": "velocity_mm_s = 5500.0"}),
    ),
    "OLP466": (Call(**with_square(0.0)), Call(**with_square(0.1))),
    "OLP470": (Call(head=PLAIN, known=SKEWED), Call(**valued(0.0, 0.1))),
    "OLP471": (Call(TOOLS, PLAIN, known=LEANING), Call(TOOLS, PLAIN, known=SKEWED)),
    "OLP701": (
        Call(OVER, tables=tool(50.0), **clamp(10.0)),
        Call(OVER, tables=tool(50.0), **clamp(9.999)),
    ),
    "OLP702": (
        Call(OVER, tables=tool(50.0), **clamp(9.001)),
        Call(OVER, tables=tool(50.0), **clamp(8.999)),
    ),
    "OLP703": (
        Call(OVER, tables=tool(50.0).replace("Z_mm = 50.0", "Z_mm = 0.0"), **clamp(0.0)),
        Call(OVER, tables=tool(50.0), swap={}, **clamp(0.0), start="X = 0.0, Y = 0.0, Z = 0.0"),
    ),
}
