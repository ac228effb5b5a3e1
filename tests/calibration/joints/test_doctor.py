"""The check of a calibration of any joints: mistakes of readings and numbers are told by name with odds, and
right ones raise no alarm."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from calibration.joints.simulated import known_machine, read
from cases.fast import left_to_a_campaign, some_of_a_campaign

from olp.calibration.joints.adjustment import JointFit
from olp.calibration.joints.deciding import DECIDED
from olp.calibration.joints.doctor import Diagnosis, diagnose_joints
from olp.calibration.joints.findings import fit_or_refuse, joint_findings
from olp.calibration.joints.readings import Points, Reading
from olp.calibration.joints.unknowns import Model
from olp.core.errors import ConfigError

STRUCTURES = (
    *(
        "xyzac_trunnion",
        "gantry_nutating",
        "gantry_wrist",
        "xyzbc_head_table",
        "arm_6r_kr6",
        "arm_7r_on_track",
    ),
    *("linuxcnc_puma560", "polar_rppr", "scara", "linear_delta", "hexapod", "tripod"),
)
#: A rotary axis of each structure that has one.
ROTARY = {
    "xyzac_trunnion": "A", "gantry_nutating": "B", "gantry_wrist": "C", "xyzbc_head_table": "B",
    "arm_6r_kr6": "J3", "arm_7r_on_track": "J5", "linuxcnc_puma560": "J1", "polar_rppr": "W", "scara": "J2",
}  # fmt: skip


def judged(name: str, seed: int = 0, kind: str = "points") -> tuple[Model, Model, JointFit, Points | Reading]:
    """A calibration with its covariance, any machine of its structure, the fit, and new readings."""
    usual, fit, true, values = known_machine(name, seed, kind)
    known = Model(usual.structure, usual.unknowns, base=usual.errors(fit.theta), known=fit.covariance)
    return known, usual, fit, read(kind, usual.machine(true).actual(values), values, seed + 7)


def silent(diagnosis: Diagnosis) -> bool:
    """Whether nothing is said to be wrong."""
    said = (diagnosis.mistakes, diagnosis.of_readings, diagnosis.doubts, diagnosis.other)
    return not any(said) and diagnosis.after < 2.0 and diagnosis.odds == 0.0


def axis(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Model, Points], Points]:
    def changed(model: Model, reading: Points) -> Points:
        values = reading.values.copy()
        column = model.structure.order.index(name)
        values[:, column] = change(values[:, column])
        return replace(reading, values=values)

    return changed


def rows(name: str, order: Iterable[int]) -> Callable[[Model, Points], Points]:
    """A field of rows in another order, counted from 0; rows behind it stay."""

    def changed(_: Model, reading: Points) -> Points:
        column = getattr(reading, name)
        index = np.array([*order, *range(len([*order]), len(column))])
        return replace(reading, **{name: column[index]})

    return changed


def nest(_: Model, reading: Points) -> Points:
    which = reading.which.copy()
    which[4] = (which[4] + 1) % 3
    return replace(reading, which=which)


def nests(_: Model, reading: Points) -> Points:
    return replace(reading, which=np.array((2, 1, 0))[reading.which])


def shown(_: Model, reading: Points) -> Points:
    """Values that were read back, 0.5 mrad early or 0.1 mm, in the columns of the commanded ones."""
    early = np.sign(np.diff(reading.values, axis=0, prepend=0.0)) * np.degrees(5e-4)
    return replace(reading, values=reading.values - early, read_back=reading.values)


SWAPPED = (0, 1, 2, 8, 4, 5, 6, 7, 3)
BLUNDERS = {
    "two postures": (rows("values", SWAPPED), "of lines 5 and 10 are exchanged"),
    "two readings": (rows("measured_mm", SWAPPED), "the readings of lines 5 and 10 are exchanged"),
    "all postures": (lambda _, r: replace(r, values=np.roll(r.values, 1, axis=0)), "one posture later"),
    "nests": (nests, "3 and 1 are swapped"),
    "nest": (nest, "points.csv: line 6 is of"),
    "read back": (shown, "commanded values and those read back are in each other's columns"),
}


def blunder(name: str, what: str) -> tuple[Callable[[Model, Points], Points], str]:
    if what == "sign":
        return axis(ROTARY[name], np.negative), f"axis {ROTARY[name]} runs the other way"
    if what == "radians":
        return axis(ROTARY[name], np.radians), f"axis {ROTARY[name]} is in radians"
    return BLUNDERS[what]


#: Every kind of mistake, on the machine that takes least; the others are for a campaign.
CASES = [("arm_6r_kr6", "sign"), ("scara", "sign"), ("xyzac_trunnion", "radians"), ("polar_rppr", "nest")]
CASES += [*(("xyzac_trunnion", what) for what in ("two readings", "nests", "read back"))]
MORE = [*((name, "sign") for name in ROTARY), ("arm_6r_kr6", "radians"), ("scara", "two postures")]
MORE += [("xyzac_trunnion", what) for what in BLUNDERS]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "what"), left_to_a_campaign(dict.fromkeys((*CASES, *MORE)), {*MORE} - {*CASES})
)
def test_mistakes_of_readings_are_told_with_odds(name: str, what: str) -> None:
    known, usual, fit, reading = judged(name)
    assert isinstance(reading, Points)
    change, words = blunder(name, what)
    diagnosis = diagnose_joints(known, fit.theta, [change(known, reading)], usual)
    assert words in diagnosis.of_readings
    assert diagnosis.odds > DECIDED
    assert not diagnosis.mistakes
    assert not diagnosis.single
    # the numbers are judged with readings that were put right
    assert diagnosis.after < 2.0
    assert all(number.sign in ("right", "undecided") for number in diagnosis.numbers)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["two postures", "read back"])
def test_a_fit_tells_them_with_the_same_words(what: str) -> None:
    """It refuses readings with which nothing settles, or its finding is an error."""
    _, usual, _, reading = judged("xyzac_trunnion")
    assert isinstance(reading, Points)
    change, words = BLUNDERS[what]
    wrong = change(usual, reading)
    try:
        found = joint_findings(fit_or_refuse(usual, [wrong]), [wrong])
    except ConfigError as error:
        assert words in str(error)
        return
    assert words in " ".join(one.message for one in found if one.code == "OLP810")


def test_a_calibration_that_is_right_raises_no_alarm() -> None:
    known, usual, fit, reading = judged("xyzac_trunnion")
    assert silent(diagnose_joints(known, fit.theta, [reading], usual))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind"),
    some_of_a_campaign(zip(STRUCTURES, 4 * ("points", "poses", "lengths"), strict=True), 2),
)
def test_no_structure_raises_a_false_alarm(name: str, kind: str) -> None:
    known, usual, fit, reading = judged(name, 1, kind)
    assert silent(diagnose_joints(known, fit.theta, [reading], usual))


@pytest.mark.parametrize(("factor", "words"), [(-1.0, "the other sign"), (1e3, "stated as mm")])
def test_a_number_that_is_wrong_is_told_and_put_right(factor: float, words: str) -> None:
    known, usual, fit, reading = judged("xyzac_trunnion")
    names = [unknown.name for unknown in usual.unknowns]
    row = int(np.argmax(np.abs(fit.theta) / fit.sigma))
    stated = fit.theta.copy()
    stated[row] *= factor
    wrong = replace(known, base=usual.errors(stated))
    diagnosis = diagnose_joints(wrong, stated, [reading], usual)
    (mistake,) = diagnosis.mistakes
    assert names[row] in mistake.words and words in mistake.words
    assert diagnosis.factors[row] == pytest.approx(1.0 / factor)
    assert np.all(np.delete(diagnosis.factors, row) == 1.0)
    assert diagnosis.odds > DECIDED and not diagnosis.of_readings


def test_an_error_that_is_not_on_the_machine_is_told() -> None:
    known, usual, fit, reading = judged("xyzac_trunnion")
    row = [unknown.name for unknown in usual.unknowns].index("C.X_um")
    stated = fit.theta.copy()
    stated[row] += 0.4
    known = replace(known, base=usual.errors(stated))
    true = usual.errors(np.where(np.arange(len(stated)) == row, 0.0, fit.theta))
    values = reading.values
    pose = replace(usual, base=true, unknowns=()).machine(np.zeros(0)).actual(values)
    diagnosis = diagnose_joints(known, stated, [read("points", pose, values)], usual)
    assert [one.words for one in diagnosis.mistakes] == ["C.X_um: not on the machine"]


@pytest.mark.slow
def test_readings_of_another_machine_are_no_mistake_of_numbers() -> None:
    known, usual, fit, _ = judged("arm_6r_kr6")
    _, _, _, foreign = judged("arm_6r_kr6", 11)
    diagnosis = diagnose_joints(known, fit.theta, [foreign], usual)
    assert not diagnosis.mistakes and not diagnosis.of_readings
    assert diagnosis.other and diagnosis.after > 100.0
