"""Corrected texts of random programs on machines whose errors make words appear: LinuxCNC must accept each of
them, and the judge of the whole cut must find what olp states as its maximum."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from cases.whole_cut import judge_whole, not_below
from fuzz import nominal
from fuzz.grammar import Drawn
from fuzz.nominal import CRASH, DIFFERENT, REFUSED, SAME, UNJUDGED, Outcome
from judge import linuxcnc, machines
from judge.linuxcnc import InterpreterError

import olp
from olp.core.errors import OlpError
from olp.core.machine import Setup

_TRAVEL = ((-400.0, 400.0),) * 3
#: what each machine has besides squareness and curves
_MACHINES = (
    {"chain": "FXYZ"},
    {"chain": "XFYZ", "backlash_um": {"X": 6.0, "Y": 15.0, "Z": 6.0}},
    {"chain": "YFXZ", "off_datum": True, "waves": 12.0},
    {"chain": "XYFZ", "directed": "XZ", "interpolation": "linear"},
    {"chain": "FZYX", "backlash_um": {"Z": 15.0}, "waves": 6.0, "cyclic": True},
)


@dataclass(slots=True)
class Judge:
    """Machines with errors; a program is corrected on the one of its number."""

    setups: tuple[tuple[Path, Setup], ...]

    @staticmethod
    def of(folder: Path) -> Judge:
        setups = []
        for number, more in enumerate(_MACHINES):
            recipe = replace(nominal.recipe(), travel=_TRAVEL, **more)
            path = machines.random_machine(folder / f"m{number}", number, recipe)
            setups.append((path, nominal.loaded(path)))
        return Judge(tuple(setups))

    def outcome(self, drawn: Drawn) -> Outcome:
        path, setup = self.setups[drawn.machine % len(self.setups)]
        start = (None, None, None) if drawn.start_mm is None else drawn.start_mm
        setup = replace(setup, job=replace(setup.job, start_mm=start))
        try:
            result = olp.correct(drawn.data, setup)
        except OlpError as error:
            return Outcome(REFUSED, str(error), getattr(error, "line", 0) or 0)
        except Exception as error:
            return Outcome(CRASH, f"olp: {type(error).__name__}: {error}")
        how = {} if drawn.start_mm is None else {"start_mm": drawn.start_mm}
        try:
            linuxcnc.interpret(drawn.data, path.parent, find_known=False, seconds=nominal.SECONDS, **how)
        except (InterpreterError, RuntimeError) as refusal:
            return Outcome(UNJUDGED, str(refusal))
        try:
            linuxcnc.interpret(result.data, path.parent, find_known=False, seconds=nominal.SECONDS, **how)
        except (InterpreterError, RuntimeError) as refusal:
            return Outcome(DIFFERENT, f"the corrected text is refused: {refusal}")
        return self._judged(drawn, result, path)

    def _judged(self, drawn: Drawn, result: olp.Correction, path: Path) -> Outcome:
        stated = result.report["deviation"]["path_max_um"]
        try:
            whole = judge_whole(drawn.data, result.data, path.parent, start_mm=drawn.start_mm)
            if not whole.judged:
                return Outcome(UNJUDGED, "no cut at a known position")
            if not whole.matched:
                return Outcome(UNJUDGED, "the holes of a line are split")
            # before the axes have taken up their backlash the stated maximum is a bound, far above perhaps
            not_below(stated, whole)
        except AssertionError as error:
            return Outcome(DIFFERENT, str(error).splitlines()[0], whole.worst_line)
        except (ValueError, IndexError, RuntimeError) as error:
            return Outcome(UNJUDGED, f"the judge: {type(error).__name__}: {error}")
        return Outcome(SAME)
