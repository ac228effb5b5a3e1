"""Jobs as values, posted as G-code and in every flavour of cutter-location data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FLAVOURS = ("creo", "nx", "catia", "solidworks", "autodesk")
HEAD = {
    "creo": "$$*          Pro/CLfile  Version 8.0\n$$-> MFGNO / JOB\nPARTNO / JOB\nMACHIN / UNCX01, 1\n"
    "UNITS / MM\nLOADTL / 1\n$$-> CUTTER / 10.000000\n"
    "$$-> CSYS / 1.0000000000, 0.0000000000, 0.0000000000, 0.0000000000,  $\n"
    "            0.0000000000, 1.0000000000, 0.0000000000, 0.0000000000,  $\n"
    "            0.0000000000, 0.0000000000, 1.0000000000, 0.0000000000\nSPINDL / RPM, 9000.000000,  CLW\n",
    "nx": "TOOL PATH/PLANAR_MILL,TOOL,MILL10\nMSYS/0.0000,0.0000,0.0000,1.0000000,0.0000000,0.0000000,"
    "0.0000000,1.0000000,0.0000000\n$$ centerline data\n"
    "UNITS/MM\nLOADTL/1\nSPINDL/RPM,9000,CLW\nPAINT/PATH\n",
    "catia": "$$ -----------------------------------------------------------------\n$$  GENERATED TODAY\n"
    "PARTNO PART OPERATION.1\nUNITS/MM\nLOADTL/1\nSPINDL/  9000.0000,RPM,CLW\nPPRINT NAME : Profile $ 1\n",
    "solidworks": "PARTNO/1\nUNIT/MM\nINSERT/10MM CRB 4FL 20 LOC\nCUTTER/10.,0,5.,0,0,0,64.\nLOAD/TOOL,1\n"
    "COOLNT/FLOOD\nSPINDL/9000,RPM,CLW\nTRNTYP/WORLD,0,0,0\nCSYS/1.,0,0,0,0,1.,0,0,0,0,1.,0\n",
    "autodesk": "PARTNO/1001\nUNITS/MM\nLOADTL/1\nSPINDL/9000,CLW\nCOOLNT/ON\n",
}
TAIL = {"creo": "SPINDL / OFF\n$$-> END /\nFINI\n", "nx": "SPINDL/OFF\nEND-OF-PATH\nFINI\n"}


@dataclass(frozen=True, slots=True)
class Step:
    """One move: `kind` rapid, line or arc; its end; of arcs the centre, and the turn about +Z in rad."""

    kind: str
    end: np.ndarray
    centre: np.ndarray | None = None
    sweep: float = 0.0


def job(seed: int, count: int = 12, reach: float = 300.0, *, digits: int = 4) -> list[Step]:
    """A random job: rapids down to the part, long lines, arcs up to whole circles, helices."""
    rng = np.random.default_rng(seed)
    here = np.round(rng.uniform((-100, -80, 5), (reach, 200, 20)), digits)
    steps = [Step("rapid", here)]
    for _ in range(count):
        choice = rng.integers(0, 5)
        if choice < 2:
            here = np.round(rng.uniform((-100, -80, -10), (reach, 200, 10)), digits)
            steps.append(Step("rapid" if choice == 0 else "line", here))
            continue
        radius, begin = rng.uniform(5.0, 60.0), rng.uniform(0, 2 * np.pi)
        sweep = float(rng.uniform(0.2, 6.0) * rng.choice([-1, 1]))
        if choice == 4:
            sweep = float(2 * np.pi * rng.choice([-1, 1]))
        centre = here - radius * np.array([np.cos(begin), np.sin(begin), 0.0])
        centre = np.round(centre, digits)
        radius = float(np.hypot(*(here - centre)[:2]))
        start = np.arctan2(here[1] - centre[1], here[0] - centre[0])
        rise = 0.0 if choice != 3 else round(float(rng.uniform(-3, 3)), digits)
        end = centre + radius * np.array([np.cos(start + sweep), np.sin(start + sweep), 0.0])
        end = np.round(end + np.array([0, 0, rise]), digits) if choice != 4 else here
        steps.append(Step("arc", end, centre, sweep))
        here = end
    return steps


def gcode(steps: Sequence[Step], digits: int = 4) -> bytes:
    """For LinuxCNC: tool 1 with its length, G54, millimetres."""
    lines = ["G21 G17 G90 G94 G54 G64 P0.001 Q0", "T1 M6", "G43 H1", "S9000 M3", "F600"]
    here = np.zeros(3)
    for step in steps:
        place = " ".join(f"{a}{v:.{digits}f}" for a, v in zip("XYZ", step.end, strict=True))
        if step.kind == "arc":
            assert step.centre is not None
            i, j = (step.centre - here)[:2]
            lines.append(f"{'G3' if step.sweep > 0 else 'G2'} {place} I{i:.{digits}f} J{j:.{digits}f}")
        else:
            lines.append(f"{'G0' if step.kind == 'rapid' else 'G1'} {place}")
        here = step.end
    return ("\n".join([*lines, "M2"]) + "\n").encode()


def apt(steps: Sequence[Step], flavour: str, digits: int = 4) -> bytes:
    """In the habits of one CAM system."""
    slash, comma = (" / ", ", ") if flavour == "creo" else ("/", ",")
    statements = [HEAD[flavour]]
    here = steps[0].end

    def say(major: str, *values: object, feed: bool = True) -> str:
        words = [f"{v:.{digits}f}" if isinstance(v, float) else str(v) for v in values]
        return major + slash + comma.join(words) + "\n"

    feeds = {"creo": "FEDRAT / 600.000000,  MMPM\n", "nx": "FEDRAT/MMPM,600.0000\n"}
    for step in steps:
        place = [float(v) for v in step.end]
        if step.kind == "rapid":
            statements.append({"creo": "RAPID \n", "solidworks": "RAPID/\n"}.get(flavour, "RAPID\n"))
        elif step is steps[1]:
            statements.append(feeds.get(flavour, "FEDRAT/600.,MMPM\n"))
        if step.kind == "arc":
            statements.append(_arc(step, here, flavour, say))
        if step.kind != "arc" or flavour != "catia":
            statements.append(say("GOTO", *place))
        here = step.end
    return "".join([*statements, TAIL.get(flavour, "FINI\n")]).encode()


def _arc(step: Step, here: np.ndarray, flavour: str, say: object) -> str:
    assert step.centre is not None
    assert callable(say)
    x, y, _ = (float(v) for v in step.centre)
    z = float(here[2])
    sign = 1.0 if step.sweep > 0 else -1.0
    radius = float(np.hypot(here[0] - x, here[1] - y))
    if flavour == "creo":
        text = say("CIRCLE", x, y, z, 0.0, 0.0, sign, radius)
        position = text.rindex(",", 0, text.rindex(",", 0, text.rindex(",", 0, text.rindex(",")))) + 1
        return f"{text[:position]}  $\n{text[position:].lstrip()}"
    if flavour == "nx":
        return str(say("CIRCLE", x, y, z, 0.0, 0.0, -sign, radius, 0.06, 0.5, 10.0, 0.0))
    if flavour == "solidworks":
        return str(say("CIRCLE", x, y, z, 0, 0, "1." if sign > 0 else "-1."))
    if flavour == "autodesk":
        degrees = float(np.degrees(abs(step.sweep)))
        return str(say("MOVARC", x, y, z, 0, 0, int(sign), radius, "ANGLE", degrees))
    tangent = sign * np.array([-(here[1] - y), here[0] - x]) / radius
    second = "2,INTOF," if abs(step.sweep) > np.pi else ""
    ex, ey, ez = (float(v) for v in step.end)
    return (
        f"INDIRV/{tangent[0]:.5f},{tangent[1]:.5f},0.00000\n"
        f"TLON,GOFWD/(CIRCLE/{x:.4f},{y:.4f},{z:.4f},$\n{radius:.4f}),ON,{second}(LINE/{x:.4f},{y:.4f},{z:.4f},$\n"
        f"{ex:.4f},{ey:.4f},{ez:.4f})\n"
    )
