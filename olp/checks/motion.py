"""Checks of a program's motion: feeds, accelerations, reversals, and rapids that come too low."""

from __future__ import annotations

import numpy as np

from olp.checks.base import finding, lines_of
from olp.compensation.plan import targets, zero_shifts
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES, quarter_shares
from olp.core.machine import Machine
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.findings.catalogue import Finding
from olp.program.feeds.moves import Scan, lengths_mm
from olp.program.feeds.stated import programmed
from olp.program.program import Program
from olp.proof.deviation import cutting_moves
from olp.proof.proof import Proof

#: a joint that turns by more is a corner, where every control slows down: 20 degrees
_SMOOTH_RAD = 0.35
#: a move between two reversals of an axis is short below this many times its backlash
_SHORT = 10.0
#: short moves in a row that make a passage
_ROW = 5
#: relative change above which a feed counts as changed; that of G93 goes with the length of its block
_CHANGED = 0.05
#: factor on a limit that an axis may reach by the digits of feeds and lengths
_ON_LIMIT = 1.0 + 1e-6
#: where a move is sampled for its lowest Z, as shares of its length
_SHARES = np.linspace(0.125, 1.0, 8)
#: the key of the limit that no finding asks for
_JERK = "jerk_mm_s3"
#: ten times the G code of feeds in inverse time (G93)
_INVERSE = 930
#: ten times the G code of feeds per turn of the spindle (G95)
_PER_TURN = 950


@dataclass(frozen=True, slots=True, eq=False)
class Feeds:
    """(n,) feed of each move in mm/s (see `olp.program.feeds.moves`), or the finding that there is none."""

    mm_s: Array | None
    modes: dict[int, list[int]]
    refused: Finding | None

    @staticmethod
    def of(program: Program) -> Feeds:
        """The feeds of a program that was read with its words."""
        modes: dict[int, list[int]] = {}
        if program.statements is None:
            assert program.words is not None
            scan = Scan.of(program, program.words, block_delete=False)
            modes = {
                code: program.original_lines(scan.code_line[scan.code == code]).tolist()
                for code in (_INVERSE, _PER_TURN)
                if (scan.code == code).any()
            }
        try:
            return Feeds(programmed(program), modes, None)
        except ProgramError as error:
            line = [] if error.line is None else program.original_lines([error.line]).tolist()
            return Feeds(None, modes, finding("OLP307", error.message, line))

    def findings(self) -> list[Finding]:
        """Missing feeds, and feed modes other than speeds."""
        findings = [] if self.refused is None else [self.refused]
        names = {_INVERSE: "G93 (one over the time)", _PER_TURN: "G95 (per turn of the spindle)"}
        for code, lines in self.modes.items():
            findings.append(finding("OLP308", f"feed mode {names[code]}", lines))
        return findings


def demand_findings(path: Toolpath, feed_mm_s: Array, machine: Machine) -> list[Finding]:
    """Velocities and accelerations of an axis that the programmed feed asks for, beyond its limits; or that
    the machine file leaves limits out.

    The acceleration is v^2 / r towards the centre of arcs. At joints of feed moves that turn by less than 20
    degrees, it is the change of velocity over half the time of both moves."""
    axes = [machine.axes[name] for name in "XYZ"]
    velocity, acceleration = _demands(path, feed_mm_s)
    unlimited = [key for key in machine.missing_limits if not key.endswith(_JERK)]
    findings = []
    if unlimited:
        findings.append(finding("OLP207", f"the machine file leaves out {', '.join(unlimited)}"))
    for code, asked, limit, unit, what in (
        ("OLP205", velocity, [a.velocity_mm_s for a in axes], "mm/s", "velocity"),
        ("OLP206", acceleration, [a.acceleration_mm_s2 for a in axes], "mm/s2", "acceleration"),
    ):
        bound = np.array([np.inf if most is None else most for most in limit])
        beyond: Mask = asked > bound * _ON_LIMIT
        moves: Mask = np.asarray(beyond.any(axis=1))
        if bool(moves.any()):
            share = np.where(beyond, asked / bound, 0.0)
            move, axis = np.unravel_index(int(share.argmax()), share.shape)
            most = f"{asked[move, axis]:.4g} {unit} of {'XYZ'[axis]}, whose limit is {bound[axis]:g} {unit}"
            text = f"{int(moves.sum())} moves need more {what} than an axis has, at most {most}"
            findings.append(finding(code, text, lines_of(path, moves)))
    return findings


def _demands(path: Toolpath, feed_mm_s: Array) -> tuple[Array, Array]:
    """(n, 3) largest velocity and acceleration of each axis on feed moves, 0 where nothing is known."""
    count = len(path)
    start, length = path.starts_mm(), lengths_mm(path)
    with np.errstate(invalid="ignore", divide="ignore"):
        direction = (path.end_mm - start) / length[:, None]
    usable = (path.kind != Kind.RAPID) & np.isfinite(feed_mm_s) & (length > 0)
    first, last = np.where(usable[:, None], direction, np.nan), np.where(usable[:, None], direction, np.nan)
    speed = np.where(usable, feed_mm_s, 0.0)
    velocity = np.abs(np.nan_to_num(first)) * speed[:, None]
    acceleration = np.zeros((count, 3))
    arcs, rows = path.arcs, path.arcs.move
    if len(arcs):
        quarters = _quarters(path)
        begin, end, most, radius, climb = _arc_directions(path, length, quarters)
        first[rows], last[rows] = begin, end
        velocity[rows] = np.where(usable[rows, None], most * speed[rows, None], 0.0)
        # towards the centre: at most the axis' share of the direction to it
        normal = _normals(path, quarters) * (speed[rows] * climb)[:, None] ** 2 / radius[:, None]
        acceleration[rows] = np.where(usable[rows, None], normal, 0.0)
    joint = _joints(first, last, speed, length, usable & cutting_moves(path))
    return velocity, np.fmax(acceleration, joint)


def _quarters(path: Toolpath) -> list[Mask]:
    """For each quarter of a circle, which arcs (m,) go through the point at its end."""
    arcs = path.arcs
    start = path.starts_mm()[arcs.move]
    return [
        np.asarray(np.isfinite(quarter_shares(start, arcs.centre_mm, arcs.plane, arcs.sweep_rad, quarter)))
        for quarter in range(4)
    ]


def _arc_directions(
    path: Toolpath, length: Array, quarters: list[Mask]
) -> tuple[Array, Array, Array, Array, Array]:
    """Of each arc: unit directions at its start and end (m, 3), the largest share of each axis (m, 3), its
    radius, and the share of the speed in its plane."""
    arcs, move = path.arcs, path.arcs.move
    start, end = path.starts_mm()[move], path.end_mm[move]
    axes, rows = np.array(PLANES)[arcs.plane], np.arange(len(arcs))
    one, two, three = axes[:, 0], axes[:, 1], axes[:, 2]
    c0, c1 = arcs.centre_mm[rows, one], arcs.centre_mm[rows, two]
    radius = np.hypot(start[rows, one] - c0, start[rows, two] - c1)
    around = np.clip(np.abs(arcs.sweep_rad) * radius / length[move], 0.0, 1.0)
    directions = []
    for point in (start, end):
        angle = np.arctan2(point[rows, two] - c1, point[rows, one] - c0)
        direction = np.zeros((len(arcs), 3))
        direction[rows, one] = -np.sin(angle) * np.sign(arcs.sweep_rad) * around
        direction[rows, two] = np.cos(angle) * np.sign(arcs.sweep_rad) * around
        direction[rows, three] = (end[rows, three] - start[rows, three]) / length[move]
        directions.append(direction)
    most = np.maximum(np.abs(directions[0]), np.abs(directions[1]))
    for quarter, passed in enumerate(quarters):
        across = two if quarter % 2 == 0 else one
        most[rows[passed], across[passed]] = around[passed]
    return directions[0], directions[1], most, radius, around


def _normals(path: Toolpath, quarters: list[Mask]) -> Array:
    """(m, 3) the largest share of each axis in the direction to the centre of an arc."""
    arcs, move = path.arcs, path.arcs.move
    start, end = path.starts_mm()[move], path.end_mm[move]
    axes, rows = np.array(PLANES)[arcs.plane], np.arange(len(arcs))
    largest = np.zeros((len(arcs), 3))
    for point in (start, end):
        away = point - arcs.centre_mm
        away[rows, axes[:, 2]] = 0.0
        with np.errstate(invalid="ignore", divide="ignore"):
            largest = np.fmax(largest, np.abs(away) / np.sqrt((away * away).sum(axis=1))[:, None])
    for quarter, passed in enumerate(quarters):
        along = axes[:, quarter % 2]
        largest[rows[passed], along[passed]] = 1.0
    return largest


def _joints(first: Array, last: Array, speed: Array, length: Array, usable: Mask) -> Array:
    """(n, 3) acceleration at the start of each move that continues the one before smoothly."""
    acceleration = np.zeros((len(first), 3))
    if len(first) < 2:
        return acceleration
    smooth = usable[1:] & usable[:-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        turn = np.arccos(np.clip(np.einsum("ij,ij->i", last[:-1], first[1:]), -1.0, 1.0))
        smooth &= turn < _SMOOTH_RAD
        time = 0.5 * (length[:-1] / speed[:-1] + length[1:] / speed[1:])
        change = first[1:] * speed[1:, None] - last[:-1] * speed[:-1, None]
        # steps of the feed are left out: every control makes ramps of them
        change = np.where((np.abs(speed[1:] - speed[:-1]) <= 1e-9 * speed[1:])[:, None], change, 0.0)
        acceleration[1:][smooth] = (np.abs(change) / time[:, None])[smooth]
    return np.nan_to_num(acceleration)


def changed_findings(proof: Proof, nominal_mm_s: Array, written_mm_s: Array) -> list[Finding]:
    """Moves with another feed in the corrected program."""
    owner = proof.owner()
    nominal = nominal_mm_s[owner]
    with np.errstate(invalid="ignore"):
        change = np.abs(written_mm_s - nominal) / nominal
    moves = np.isfinite(change) & (change > _CHANGED) & cutting_moves(proof.written)
    if not moves.any():
        return []
    worst = int(np.where(moves, change, 0.0).argmax())
    what = (
        f"{int(moves.sum())} moves have another feed than in the nominal program: "
        f"{written_mm_s[worst] * 60:.4g} mm/min for {nominal[worst] * 60:.4g} mm/min"
    )
    return [finding("OLP309", what, lines_of(proof.nominal, owner[moves]))]


def reversal_findings(path: Toolpath, model: ErrorModel) -> list[Finding]:
    """Passages in which an axis with backlash reverses after every short move."""
    backlash = model.backlash_at(path.end_mm) if len(path) else None
    findings: list[Finding] = []
    for axis in range(3 if backlash is not None else 0):
        assert backlash is not None
        width = float(np.nanmax(np.nan_to_num(np.abs(backlash[:, axis])), initial=0.0))
        moves = _heavy(path.end_mm[:, axis], _SHORT * width) if width > 0 else np.zeros(0, np.int64)
        if len(moves):
            what = (
                f"{'XYZ'[axis]} reverses {len(moves)} times after moves below {_SHORT * width:.3g} mm, "
                f"{_SHORT:g} times its backlash"
            )
            findings.append(finding("OLP204", what, lines_of(path, moves)))
    return findings


def _heavy(command: Array, short_mm: float) -> Index:
    """The moves at whose ends an axis reverses, in passages of at least _ROW short moves; an unknown position
    ends a passage."""
    known = np.flatnonzero(np.isfinite(command))
    step = np.diff(command[known])
    moving = np.flatnonzero(step != 0)
    turn = moving[:-1][np.sign(step[moving[1:]]) != np.sign(step[moving[:-1]])]
    position = command[known[turn + 1]]
    short = np.abs(np.diff(position)) < short_mm
    # runs of short moves between consecutive reversals
    edge = np.flatnonzero(np.diff(np.concatenate(([0], short.view(np.int8), [0]))))
    rows = [np.arange(a, b + 1) for a, b in edge.reshape(-1, 2).tolist() if b - a >= _ROW]
    return known[turn[np.concatenate(rows)] + 1] if rows else np.zeros(0, np.int64)


def low_findings(proof: Proof, model: ErrorModel) -> list[Finding]:
    """First moves and rapids that take the tip lower in Z than the nominal program does and intends."""
    path, written = proof.nominal, proof.written
    # the control decides how many strokes a canned cycle has
    ours, theirs = ((p.flag & np.uint8(Flag.CYCLE)) == 0 for p in (path, written))
    rapid = (path.kind == Kind.RAPID) & ours
    if len(rapid):
        rapid[int(np.isfinite(path.end_mm[:, 2]).argmax())] = True
    shift = zero_shifts(path.frames, model)
    goal = targets(path, shift)
    meant = np.concatenate(([np.array(path.start_mm)], goal[:-1])) if len(path) else goal
    # intended: straight between waypoints; the real path is also sampled between them
    low = np.fmin(np.fmin(meant[:, 2], goal[:, 2]), _lowest(path, model))
    reached = np.full(len(path), np.inf)
    np.fmin.at(reached, proof.owner()[theirs], _lowest(written, model)[theirs])
    play = model.backlash_at(path.end_mm)
    loose = 0.0 if play is None else float(np.nanmax(np.nan_to_num(play[:, 2]), initial=0.0)) / 2
    with np.errstate(invalid="ignore"):
        below = low - reached - loose > proof.allowed_mm
        moves = rapid & below & np.isfinite(reached)
    if not moves.any():
        return []
    deep = float((low - reached)[moves].max())
    what = (
        f"{int(moves.sum())} first moves or rapids come up to {deep:.4g} mm lower than in the nominal program"
    )
    return [finding("OLP310", what, lines_of(path, moves))]


def _lowest(path: Toolpath, model: ErrorModel) -> Array:
    """(n,) lowest Z of the tip on each move, from eight points along it; NaN where it is unknown."""
    start, tool = path.starts_mm(), path.tool_mm()
    lowest = np.full(len(path), np.nan)
    for share in _SHARES.tolist():
        position = path.end_mm if share == 1.0 else start + share * (path.end_mm - start)
        lowest = np.fmin(lowest, position[:, 2] + np.nan_to_num(model.error(position, tool)[:, 2]))
    return lowest
