"""Random contours of conversational programs: all that a control makes from several blocks."""

from __future__ import annotations

import cmath
import math
import random


def contour(seed: int, count: int = 14) -> bytes:
    """A program of contours; legs are long enough for what is between them."""
    draw = random.Random(seed)
    lines = ["BEGIN PGM CONTOUR MM", "TOOL CALL 1 Z S2000", "L X+0 Y+0 Z+5 R0 FMAX M3", "L Z-1 F400"]
    here, heading, after_corner = 0j, 1 + 0j, ""
    lines += ["L X+25 Y+0"]
    here, scaled = 25 + 0j, False

    def n(value: float) -> str:
        return f"{value:+.3f}"

    def spot(leg: float) -> complex:
        """A place that far away, not back along the path."""
        turn = draw.uniform(20, 110) * draw.choice((1, -1))
        p = here + leg * heading * cmath.exp(1j * math.radians(turn))
        return complex(round(p.real, 3), round(p.imag, 3))

    for _ in range(count):
        kind = draw.choice(("L", "L", "mixed", "LP", "CR", "CT", "frame", "appr"))
        corner = after_corner
        after_corner = ""
        if corner == "CHF" and kind == "CR":
            kind = "L"
        if kind == "frame" and not corner:
            lines += draw.choice((
                ["CYCL DEF 10.0 ROTATION", f"CYCL DEF 10.1 ROT{n(draw.uniform(-170, 170))}"],
                ["CYCL DEF 10.0 ROTATION", "CYCL DEF 10.1 ROT+0", "CYCL DEF 8.0 MIRROR",
                 f"CYCL DEF 8.1 {draw.choice(('X', 'Y', 'X Y', ''))}"],
            ))  # fmt: skip
            if draw.random() < 0.5:
                factor = n(draw.uniform(0.6, 1.8))
                lines += ["CYCL DEF 26.0 AXIS-SPEC. SCALING", "CYCL DEF 26.1 X+1 Y+1 CCX+0 CCY+0",
                          "CYCL DEF 11.0 SCALING", "CYCL DEF 11.1 SCL +1"]  # fmt: skip
                scaled = draw.random() < 0.7
                if scaled:
                    cycle = draw.choice((11, 26))
                    words = f"X{factor} Y{factor} CCX{n(draw.uniform(-9, 9))} CCY{n(draw.uniform(-9, 9))}"
                    lines += [f"CYCL DEF {cycle}.0 SCALING"]
                    lines += [f"CYCL DEF {cycle}.1 " + (f"SCL{factor}" if cycle == 11 else words)]
            lines += ["L X+0 Y+0", "L X+25 Y+0"]
            here, heading = 25 + 0j, 1 + 0j
            continue
        if kind == "appr" and scaled:
            # whether its radius is scaled is not known
            kind = "L"
        if kind == "appr" and not corner:
            form = draw.choice(("LT LEN7", "LN LEN6", "CT CCA80 R+5", "CT CCA100 R-4", "LCT R5", "PLCT R5"))
            end = spot(40)
            name, size = form.split(" ", 1)
            words = f"X{n(end.real)} Y{n(end.imag)}"
            if name == "PLCT":
                lines.append(f"CC X{n(end.real - 3)} Y{n(end.imag)}")
                words = "PR+3 PA+0"
            way = cmath.exp(1j * draw.uniform(0, 6))
            goal = end + 30 * way
            away = goal + 30 * way * cmath.exp(-0.5j)
            lines += [f"APPR {name} {words} {size} R0 F300", f"L X{n(goal.real)} Y{n(goal.imag)}"]
            out = draw.choice(("LT LEN7", "LN LEN6", "CT CCA80 R+5", "LCT R4"))
            lines.append(f"DEP {out}" + (f" X{n(away.real)} Y{n(away.imag)}" if "LCT" in out else ""))
            lines += ["L X+0 Y+0", "L X+25 Y+0"]
            here, heading = 25 + 0j, 1 + 0j
            continue
        end = spot(draw.uniform(25, 50))
        if kind == "mixed":
            lines.append(f"L IX{n(end.real - here.real)} Y{n(end.imag)} R0")
        elif kind == "LP":
            pole = spot(20)
            radius, angle = round(draw.uniform(30, 50), 3), draw.uniform(20, 80)
            base = math.degrees(cmath.phase(heading))
            lines.append(f"CC X{n(pole.real)} Y{n(pole.imag)}")
            lines.append(f"LP PR{n(radius)} PA{n(base + angle)}")
            end = pole + cmath.rect(radius, math.radians(round(base + angle, 3)))
        elif kind == "CR":
            size = abs(end - here) * draw.uniform(0.8, 1.5)
            lines.append(f"CR X{n(end.real)} Y{n(end.imag)} R{n(size)} DR{draw.choice('+-')}")
            here, heading = end, cmath.exp(1j * draw.uniform(0, 6))
            lines.append(f"L X{n((here + 30 * heading).real)} Y{n((here + 30 * heading).imag)}")
            here += 30 * heading
            here = complex(round(here.real, 3), round(here.imag, 3))
            continue
        elif kind == "CT" and not corner:
            lines.append(f"CT X{n(end.real)} Y{n(end.imag)}")
            off = cmath.phase((end - here) / heading)
            here, heading = end, heading * cmath.exp(2j * off)
            continue
        else:
            lines.append(f"L X{n(end.real)} Y{n(end.imag)}")
        heading, here = (end - here) / abs(end - here), end
        if draw.random() < 0.6:
            lines.append(draw.choice(("RND R", "RND ", "CHF ")) + f"{draw.uniform(0.5, 3):.3f}")
            lines[-1] += draw.choice(("", "", " F150"))
            after_corner = lines[-1][:3]
    if after_corner:
        lines.append(f"L X{n((here + 20j * heading).real)} Y{n((here + 20j * heading).imag)}")
    lines += ["L Z+50 R0 FMAX M30", "END PGM CONTOUR MM"]
    return ("\n".join(lines) + "\n").encode()
