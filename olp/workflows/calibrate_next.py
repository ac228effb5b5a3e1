"""What to measure next: the readings that lower the uncertainty of a calibration most, and their files."""

from __future__ import annotations

import datetime
from collections.abc import Collection, Sequence
from typing import Any, Literal

from olp.calibration.design import line_offers, offers
from olp.calibration.design.choosing import Criterion, choose
from olp.calibration.design.known import Known, judged_rows
from olp.calibration.design.prediction import Prediction, known_of_machines
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, UsageError
from olp.core.machine import Machine, Setup, Vector
from olp.core.units import MM_PER_UM, UM_PER_MM
from olp.files.calibration.covariance import load_known
from olp.findings.catalogue import Finding
from olp.workflows.calibrate_plan import (
    TRACKER,
    MeasurementPlan,
    Method,
    box_of,
    findings_of_plan,
    judged_of,
    plan_rows,
    quickest,
    reflectors_of,
    timed,
)
from olp.workflows.measuring_time import DWELL_S
from olp.workflows.session import PathLike, Session

NextInstrument = Literal["tracker", "multilateration", "lines", "targets"]
NEXT: tuple[NextInstrument, ...] = ("tracker", "multilateration", "lines", "targets")
#: Points that every station measures.
TARGETS = 60
#: Seed of random positions; another one than that of a first plan.
_SEED = 21


def plan_next(
    machine: PathLike | Setup,
    count: int,
    *,
    calibration: PathLike | None = None,
    criterion: Criterion = "A",
    uncertainty_um: float = 5.0,
    instrument: NextInstrument | None = None,
    box_mm: Sequence[tuple[float, float]] | None = None,
    tools: Sequence[Vector] = (),
    sigma_um: float | None = None,
    dwell_s: float | None = None,
    settle_s: float = 1.0,
    points: int | None = None,
    components: Collection[str] = (),
    date: datetime.date | None = None,
) -> MeasurementPlan:
    """The `count` points of a tracker, stations of lengths to `points` points each, lines, or targets of
    lines, that help most.

    `calibration` is what was measured so far; its covariance says what is known already. That has faded by
    its growth_per_year until `date`. Without one nothing was measured. Criterion "A" lowers the mean square
    of the error over the box, "D" the volume of all uncertainty. `components` are the errors that lines may
    read, all of them if left out. The other arguments are those of
    `plan_measurements`; without `box_mm` it is the calibrated box. Raises UsageError, ConfigError and
    CannotCompute.
    """
    session = Session.start(machine)
    setup = session.setup
    described = setup.machine
    described.motion_limits()
    known, box = _known(session, described, calibration, box_mm, date)
    reflectors = list(tools) or reflectors_of(described)
    judged = judged_of(described, reflectors)
    rows = judged_rows(known, box, judged)
    sigma = TRACKER if sigma_um is None else sigma_um * MM_PER_UM
    methods: list[Method] = []
    tables: dict[str, list[dict[str, Any]]] = {}
    before = 0.0
    for name in NEXT if instrument is None else (instrument,):
        wait = (DWELL_S[name] if dwell_s is None else dwell_s) + settle_s
        offer, noun = _offer(name, described, known, box, reflectors, sigma, points or TARGETS, components)
        if not offer.fewest <= count <= len(offer.candidates.rows):
            raise UsageError(
                f"{count} {noun} cannot be planned; expected {offer.fewest} to {len(offer.candidates.rows)}"
            )
        choice = choose(offer.candidates, rows, count, criterion)
        planned = offer.planned(choice.index)
        after = Prediction(float(choice.rms_mm[-1]), choice.worst_mm, ())
        method = timed(name, f"{count} {noun}", planned, after, described, wait, box)
        methods.append(method)
        before = float(choice.rms_mm[0])
        tables[name] = [
            {"number": k, **offer.row(int(one)), "predicted_um": float(rms) * UM_PER_MM}
            for k, (one, rms) in enumerate(zip(choice.index, choice.rms_mm[1:], strict=True), start=1)
        ]
    chosen = quickest(methods, uncertainty_um)
    report: dict[str, Any] = {
        "schema": "olp-next-1",
        "calibration": None if calibration is None else str(calibration),
        "criterion": criterion,
        "known_um": before * UM_PER_MM,
        "next": tables[chosen.instrument],
        **plan_rows(described, box, chosen, methods, uncertainty_um, reflectors, judged),
    }
    used = (DWELL_S[chosen.instrument] if dwell_s is None else dwell_s) + settle_s
    findings: tuple[Finding, ...] = tuple(findings_of_plan(chosen, uncertainty_um))
    return MeasurementPlan(setup, chosen, tuple(methods), report, findings, used, session.sources.files)


def _known(
    session: Session, machine: Machine, calibration: PathLike | None,
    box_mm: Sequence[tuple[float, float]] | None, date: datetime.date | None,
) -> tuple[Known, Array]:  # fmt: skip
    """What was measured so far, and the box. Raises ConfigError and UsageError."""
    if calibration is None:
        box = box_of(machine, box_mm)
        return known_of_machines(machine.chain, box), box
    old, uncertainty = load_known(calibration, machine, session.sources.read)
    covered = [(float(low), float(high)) for low, high in old.box_mm]
    box = box_of(machine, box_mm or covered)
    skip = frozenset(machine.compensated_by_controller - old.active_during_measurement)
    days = None if date is None or old.measured is None else (date - old.measured).days
    known = Known.of_calibration(old, machine.chain, uncertainty.aged(days), skip)
    if not known.size:
        raise CannotCompute("the control corrects every error that the calibration states")
    return known, box


def _offer(
    name: NextInstrument, machine: Machine, known: Known, box: Array, tools: Sequence[Vector], sigma: float,
    targets: int, components: Collection[str],
) -> tuple[offers.Offer, str]:  # fmt: skip
    if name == "tracker":
        return offers.points(machine.name, known, box, tools, sigma, _SEED), "points of a tracker"
    if name == "multilateration":
        offer = offers.stations(machine.name, known, box, tools, targets, _SEED)
        return offer, f"stations with {targets} lengths"
    wanted = components or line_offers.READ
    unknown = sorted(set(wanted) - set(line_offers.READ))
    if unknown:
        raise UsageError(f"{unknown[0]} is read by no line; expected some of {', '.join(line_offers.READ)}")
    if name == "lines":
        return line_offers.lines(machine.name, known, box, tools[0], wanted, _SEED), "lines"
    return line_offers.targets(machine.name, known, box, tools[0], wanted), "targets of lines"


__all__ = ["NEXT", "NextInstrument", "plan_next"]
