"""Writes `programs/apt-flavours` and `programs/dmis-housing` from statement forms alone.

    python programs/make/statements.py

One contour with its pocket and holes, as five CAM systems would say it, and a part program that touches a
bore, a face and an edge of a housing that lies turned on the machine.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from cases.posts import FLAVOURS, Step, apt  # noqa: E402

ENDINGS = {"creo": "ncl", "nx": "cls", "catia": "aptsource", "solidworks": "apt", "autodesk": "apt"}
HOLES = {
    "creo": "RAPID \nGOTO / 40.0000, 40.0000, 20.0000\n"
    "CYCLE / DRILL, DEPTH, 12.000000, MMPM, 200.000000, CLEAR,$\n 2.000000\n",
    "nx": "RAPID\nGOTO/40.0000,40.0000,20.0000\n"
    "CYCLE/DRILL,RAPTO,2.0000,FEDTO,-12.0000,RTRCTO,20.0000,MMPM,200.0000\n",
    "catia": "RAPID\nGOTO/40.0000,40.0000,20.0000\nCYCLE/DRILL,  12.000000,MMPM, 200.0000,  2.000000\n",
    "solidworks": "RAPID/\nGOTO/40.,40.,20.\nCYCLE/INIT\n"
    "CYCLE/DRILL,FEDTO,12.,MMPM,200.,RAPTO,2.,RTRCTO,20.\n",
    "autodesk": "RAPID\nGOTO/40.0000,40.0000,20.0000\nCYCLE/DRILL,DEPTH,12,MMPM,200,CLEAR,2\n",
}


def step(kind: str, *end: float, centre: tuple[float, float] | None = None, sweep: float = 0.0) -> Step:
    middle = None if centre is None else np.array([*centre, end[2]])
    return Step(kind, np.array(end), middle, np.radians(sweep))


def plate() -> list[Step]:
    """A contour of 600 x 400 mm with corners of 30 mm, and a bore by a helix and a whole circle."""
    z, r = -6.0, 30.0
    return [
        step("rapid", -20, 200, 20), step("line", -20, 200, z), step("line", 0, 200, z),
        step("line", 0, 370, z), step("arc", r, 400, z, centre=(r, 370), sweep=-90),
        step("line", 570, 400, z), step("arc", 600, 370, z, centre=(570, 370), sweep=-90),
        step("line", 600, r, z), step("arc", 570, 0, z, centre=(570, r), sweep=-90),
        step("line", r, 0, z), step("arc", 0, r, z, centre=(r, r), sweep=-90),
        step("line", 0, 210, z), step("rapid", 0, 210, 20),
        step("rapid", 345, 200, 20), step("line", 345, 200, 1),
        step("arc", 255, 200, -1.5, centre=(300, 200), sweep=180),
        step("arc", 345, 200, -4, centre=(300, 200), sweep=180),
        step("arc", 345, 200, -4, centre=(300, 200), sweep=360),
        step("line", 300, 200, -4), step("rapid", 300, 200, 20),
    ]  # fmt: skip


def posted(flavour: str) -> bytes:
    text = apt(plate(), flavour).decode()
    goto, comma = ("GOTO / ", ", ") if flavour == "creo" else ("GOTO/", ",")
    points = "".join(
        f"{goto}{comma.join(f'{v:.4f}' for v in (x, y, 0.0))}\n" for x in (40.0, 560.0) for y in (40.0, 360.0)
    )
    off = "CYCLE / OFF\n" if flavour == "creo" else "CYCLE/OFF\n"
    end = text.rindex("SPINDL") if flavour in ("creo", "nx") else text.rindex("FINI")
    return (text[:end] + HOLES[flavour] + points + off + text[end:]).encode()


def housing() -> bytes:
    """A bore of 80 mm by eight touches, a face by four, an edge with the star stylus by two."""
    angles = np.radians(np.arange(0, 360, 45))
    bore = [(200 + 40 * np.cos(a), 150 + 40 * np.sin(a), -12.0, -np.cos(a), -np.sin(a), 0.0) for a in angles]
    face = [(x, y, 0.0, 0.0, 0.0, 1.0) for x in (40.0, 360.0) for y in (40.0, 260.0)]
    edge = [(400.0, y, -20.0, 1.0, 0.0, 0.0) for y in (60.0, 240.0)]

    def feature(name: str, form: str, nominal: str, touches: list[tuple[float, ...]]) -> str:
        said = [f"  PTMEAS/CART,{','.join(f'{v:.4f}' for v in t)}" for t in touches]
        head = f"F({name})=FEAT/{form},{nominal}\nMEAS/{form.split(',')[0]},F({name}),{len(touches)}"
        return "\n".join([head, *said, "ENDMES", ""])

    return (
        "DMISMN/'HOUSING, UPPER HALF',05.2\nUNITS/MM,ANGDEC\nDECPL/ALL,4\nFEDRAT/POSVEL,MMPS,200\n"
        "FEDRAT/MESVEL,MMPS,5\nSNSET/APPRCH,4.0\nSNSET/RETRCT,4.0\nS(STRAIGHT)=SNSDEF/PROBE,FIXED,CART,0.0,0.0,$\n"
        "-243.5,0,0,1,3.0\nMODE/PROG,MAN\nSNSLCT/S(STRAIGHT)\nRECALL/D(HOUSING)\n"
        "$$ --- top face\nGOTO/CART,200.0000,150.0000,60.0000\n"
        + feature("TOP", "PLANE", "CART,200.0,150.0,0.0,0,0,1", face)
        + "$$ --- bore\nGOTO/200.0000,150.0000,60.0000\nGOTO/200.0000,150.0000,-12.0000\n"
        + feature("BORE", "CIRCLE,INNER", "CART,200.0,150.0,-12.0,0,0,1,80.0", bore)
        + "GOTO/200.0000,150.0000,60.0000\nT(D1)=TOL/DIAM,-0.0200,0.0200\nOUTPUT/FA(BORE),TA(D1)\n"
        "$$ --- edge, with the star stylus of the job file\nSNSLCT/S(STAR)\nGOTO/440.0000,150.0000,60.0000\n"
        + feature("EDGE", "PLANE", "CART,400.0,150.0,-20.0,1,0,0", edge)
        + "GOTO/440.0000,150.0000,60.0000\nENDFIL\n"
    ).encode()


def main() -> None:
    for flavour in FLAVOURS:
        name = f"{flavour}.{ENDINGS[flavour]}"
        (ROOT / "programs" / "apt-flavours" / name).write_bytes(posted(flavour))
    (ROOT / "programs" / "dmis-housing" / "housing.dmi").write_bytes(housing())


if __name__ == "__main__":
    main()
