"""Every parametric program that LinuxCNC installs and runs, and every one of the corpus, is read with
`--flatten`, or refused for a reason that a person accepts.

`python tests/program/rs274/flatten/survey.py` prints the others, too.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from judge import linuxcnc
from program.rs274.flatten.survey import INSTALLED, refused_of_corpus, refused_that_run

#: What is refused, and what the reasons have to name.
ACCEPTED = {
    # turning: no lathe is corrected
    "g76.ngc": "G76 threads",
    "lathe_g70_71_demo.ngc": "cycles of a lathe",
    "lathe_g7x_face_boring.ngc": "cycles of a lathe",
    "lathe_g7x_quadrants.ngc": "cycles of a lathe",
    # the cut is where the spindle is at that moment
    "mmount.ngc": "G33.1 (rigid tapping)",
    # the path is where a probe has touched
    "smartprobe.ngc": "#5070",
}
#: Share that is read, of those that are of no lathe.
LEAST = 0.85


@pytest.mark.oracle
@pytest.mark.slow
def test_what_linuxcnc_runs_is_read_or_refused_for_a_reason() -> None:
    linuxcnc.require()
    if not all(folder.is_dir() for folder in INSTALLED):
        pytest.skip("the programs of LinuxCNC are not installed")
    count, refused = refused_that_run()
    assert refused.keys() <= ACCEPTED.keys(), refused
    for name, why in refused.items():
        assert ACCEPTED[name] in why, (name, why)
    turning = sum("lathe" in ACCEPTED[name] or name == "g76.ngc" for name in refused)
    assert count - len(refused) >= LEAST * (count - turning), refused


@pytest.mark.corpus
@pytest.mark.slow
def test_parametric_programs_of_the_corpus_are_read(corpus: Path) -> None:
    count, refused = refused_of_corpus(corpus)
    # it goes on in G91 from where a tool change ends, which no block states
    assert refused.keys() == {"MaestroFusion360__cnc_programs_TEST_G91.NC"}, refused
    assert count - len(refused) >= LEAST * count
    assert count >= 10
