"""A judge of unrolled Sinumerik programs: the program as Python source, run by Python.

It knows R-parameters, DEF REAL, IF, FOR, WHILE, REPEAT, IC and AC, G90 and G91, and TRANS. It shares no code
with the package.
"""

from __future__ import annotations

import math
import re

_STEP = "    "
_WORD = re.compile(r"\b([XYZ])(?:=(\S+)|([-+]?[\d.]+))")


def _expression(text: str) -> str:
    text = re.sub(r"(?<![<>=])<>(?!=)", "!=", text)
    text = re.sub(r"\bAND\b", "and", re.sub(r"\bOR\b", "or", re.sub(r"\bNOT\b", "not", text)))
    return re.sub(r"\bMOD\b", "%", text)


def source(program: str) -> str:
    """The Python source of a program; each block with X, Y or Z calls `move`."""
    rows, depth = [], 0
    for line in program.splitlines():
        code = re.sub(r"^N\d+\s*", "", line.partition(";")[0].strip())
        word = code.split(maxsplit=1)[0] if code else ""
        rest = code[len(word) :]
        if word in ("ENDIF", "ENDFOR", "ENDWHILE"):
            depth -= 1
            continue
        if word == "UNTIL":
            rows.append(_STEP * depth + f"if {_expression(rest)}: break")
            depth -= 1
            continue
        lead = _STEP * depth
        if word == "IF":
            rows.append(f"{lead}if {_expression(rest)}:")
        elif word == "ELSE":
            rows.append(_STEP * (depth - 1) + "else:")
        elif word == "WHILE":
            rows.append(f"{lead}while {_expression(rest)}:")
        elif word == "REPEAT":
            rows.append(f"{lead}while True:")
        elif word == "FOR":
            name, first, last = re.fullmatch(r"\s*(\w+)=(.*) TO (.*)", rest).groups()  # type: ignore[union-attr]
            rows.append(f"{lead}for {name} in range(int({first}), int({last}) + 1):")
        elif word == "DEF":
            rows.append(f"{lead}{rest.split()[1]}")
        elif re.fullmatch(r"[RV]\d+=.*", code):
            rows.append(lead + _expression(code))
        elif word == "TRANS":
            rows.append(f"{lead}shift({_words(rest)})")
        else:
            if "G90" in code or "G91" in code:
                rows.append(f"{lead}mode({'G91' in code})")
            if _WORD.search(code):
                rows.append(f"{lead}move({_words(code)})")
        if word in ("IF", "WHILE", "REPEAT", "FOR"):
            depth += 1
    return "\n".join(rows)


def _words(code: str) -> str:
    parts = []
    for axis, value, number in _WORD.findall(code):
        text = _expression(value or number)
        kind = re.match(r"(IC|AC)\((.*)\)$", text)
        parts.append(f"{axis}=({kind[1]!r}, {kind[2]})" if kind else f"{axis}=('', {text})")
    return ", ".join(parts)


def ends(program: str) -> list[tuple[float, float, float]]:
    """The positions at the ends of all blocks with X, Y or Z, in the frame of the machine."""
    position, offset, state = {"X": 0.0, "Y": 0.0, "Z": 0.0}, {"X": 0.0, "Y": 0.0, "Z": 0.0}, {"G91": False}
    found: list[tuple[float, float, float]] = []

    def move(**words: tuple[str, float]) -> None:
        for axis, (kind, value) in words.items():
            relative = kind == "IC" or (not kind and state["G91"])
            position[axis] = position[axis] + value if relative else offset[axis] + value
        found.append((position["X"], position["Y"], position["Z"]))

    def shift(**words: tuple[str, float]) -> None:
        offset.update({"X": 0.0, "Y": 0.0, "Z": 0.0})
        offset.update({axis: value for axis, (_, value) in words.items()})

    names = {
        "move": move, "shift": shift, "mode": lambda relative: state.update(G91=relative), "ABS": abs,
        "SQRT": math.sqrt, "SIN": lambda a: math.sin(math.radians(a)), "TRUNC": math.trunc,
        "COS": lambda a: math.cos(math.radians(a)),
    }  # fmt: skip
    exec(source(program), names)
    return found
