"""Texts of programs in many dialects, with numbers in every form in which people and posts write them."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

#: Lines of dialects; `{}` is a number.
LINES = (
    "G1 X{} Y{} Z{}", "X{}Y{}", "n{} g01x{}y{}z{}", "G2 X{} Y{} I{} J{} F1200", "X={} Y=AC({}) ; {} mm",
    "L  X{} Y{} Z{} R0 FMAX M91", "{} L X{} Y+{} FQ{}", "GOTO/{},{},{}", "GOTO/{},{},{},0.0,0.0,1.0",
    "PTMEAS/CART,{},{},{},0.0000,0.0000,1.0000", "F(H{})=FEAT/CIRCLE,INNER,CART,{},{},{},0,0,1,{}",
    "{},{},{}", "{} {}\t{}", "MoveL [[{},{},{}],[1,0,0,0]], v100, fine, tool0;", "#{}=[{}+{}*2]",
    "(PASS {} of {})", "", "M30", "; naïve 🛠 -{}.", "X{}X{}X{}", "X-{}-{}--{}", "..{}. {}.{}.{}", "Xx{}e{}",
    "%",
)  # fmt: skip


def _fixed(decimals: int) -> Callable[[float], str]:
    return lambda value: f"{value:.{decimals}f}"


def _trimmed(value: float) -> str:
    return f"{value:.4f}".rstrip("0").rstrip(".")


#: Forms of numbers.
FORMS: tuple[Callable[[float], str], ...] = (
    _fixed(0), _fixed(3), _fixed(4), _fixed(9), _trimmed,
    lambda value: f"{value:.4f}".rstrip("0"),
    lambda value: f"{value:+.3f}",
    lambda value: f"{value:.4f}".replace("0.", ".", 1) if abs(value) < 1 else f"{value:.4f}",
    lambda value: f"{value:09.3f}",
    lambda value: f"{int(value):05d}",
    lambda value: f"-{abs(value) * 0:.3f}",
    lambda value: f"{value:.12f}",
    lambda value: f"{int(value) * 10**9 + 7}",
)  # fmt: skip


def text(seed: int, count: int, *, uneven: float = 0.1) -> str:
    """A text of `count` lines: stretches of one kind of line with numbers in one form, of a share `uneven` of
    which one line is unlike."""
    rng = random.Random(seed)
    lines: list[str] = []
    while len(lines) < count:
        line, forms = rng.choice(LINES), [rng.choice(FORMS) for _ in range(5)]
        value, step = rng.uniform(-50.0, 50.0), rng.choice([0.0, 0.001, 1.7])
        for _ in range(rng.randint(1, 60)):
            one = rng.choice(LINES) if rng.random() < uneven else line
            own = [rng.choice(FORMS) if rng.random() < uneven else form for form in forms]
            value += step
            lines.append(_filled(one, own, value + rng.choice([0.0, 100.0])))
    return "\n".join(lines[:count])


def _filled(line: str, forms: Sequence[Callable[[float], str]], value: float) -> str:
    parts = line.split("{}")
    numbers = [forms[k % len(forms)](value * (-1) ** k / (k + 1)) for k in range(len(parts) - 1)]
    return "".join(a + b for a, b in zip(parts, [*numbers, ""], strict=True))
