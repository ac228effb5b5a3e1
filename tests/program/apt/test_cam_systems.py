"""Programs in the habits of CAM systems: corrected as an independent reader judges, or refused."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.cl_files import CL_FILES
from judge import machines
from judge.cldata import read_apt
from judge.model import JudgeModel

import olp
from olp.core.errors import ProgramError

ORIGIN = np.array([250.0, 200.0, -300.0])
LENGTHS = {1: 120.0, 2: 120.0, 3: 120.0, 4: 120.0}
RECIPE = replace(
    machines.Recipe(increment_mm=0.0001), tools={n: {"Z_mm": length} for n, length in LENGTHS.items()}
)
#: without --flatten
REFUSED = {"copy_same.apt": "OLP511"}
#: the reader of the judge has no holes, no leaning arcs, and no cards
UNJUDGED = re.compile("drill|hole|tilted|3d_circle|apt360|copy|camworks")
ALLOWED_UM = 1.0 + 0.09


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 7, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


@pytest.mark.parametrize("name", sorted(CL_FILES))
def test_a_program_of_a_cam_system_is_corrected_or_says_why_not(name: str, zero: Path, bent: Path) -> None:
    data = CL_FILES[name].encode()
    if name in REFUSED:
        with pytest.raises(ProgramError) as caught:
            olp.correct(data, zero)
        assert caught.value.code == REFUSED[name]
        assert caught.value.line
        return
    assert olp.correct(data, zero).data == data
    result = olp.correct(data, bent)
    assert result.data != data
    assert olp.verify(data, result.data, bent).report["deviation"]["path_max_um"] == pytest.approx(
        result.report["deviation"]["path_max_um"], abs=1e-6
    )
    if UNJUDGED.search(name):
        return
    frames = {"G54": (np.eye(3), ORIGIN)}
    nominal, own = (read_apt(d, frames, LENGTHS, tool=1) for d in (data, result.data))
    model, reach = JudgeModel(bent), np.array([0.0, 0.0, -120.0])
    places = [np.array(m.axis) for m in (nominal, own)]
    lines = data.splitlines()
    stated = [p for p, line in zip(places[0], nominal.line, strict=True) if b"GOHOME" not in lines[line - 1]]
    tips = places[1] + model.error_mm(places[1], np.broadcast_to(reach, places[1].shape))
    # every nominal point is reached, in its order
    at = 0
    for place in stated:
        away = np.sqrt(((tips[at:] - place) ** 2).sum(axis=1))
        near = int(np.argmax(away <= ALLOWED_UM * 1e-3))
        assert away[near] <= ALLOWED_UM * 1e-3, place - ORIGIN
        at += near


@pytest.mark.parametrize(
    "statement", ["RAPID/ MODIFY, 5", "POCKET/1", "CLDIST/5", "PROBE/5", "MOVETO/1,2,3", "SYN/A,GOTO"]
)
def test_words_that_could_move_are_not_among_those_that_pass(statement: str, zero: Path) -> None:
    text = f"PARTNO A\nUNITS/MM\nLOADTL/1\nGOTO/1,2,3\n{statement}\nGOTO/4,5,6\n"
    with pytest.raises(ProgramError) as caught:
        olp.correct(text.encode(), zero)
    assert caught.value.line == 5
