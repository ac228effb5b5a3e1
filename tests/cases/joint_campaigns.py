"""Campaigns on simulated machines of any joints, as a shop would measure them: plans with files of readings,
and how far the calibration from them is off at other postures, beside the information limit.

The truth and the limit come from `judge.located`, which shares nothing with what it judges. The dimensions of
each machine differ from those of `olp init --structure` by some percent. Its location errors are all drawn,
also those that no pose shows.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner
from judge.located import Array, Located, Name, best_of, errors_of, slopes, turned, vector_of, without_frame
from scipy.spatial.transform import Rotation

import olp
from olp.cli import main

#: The structures of `olp init`.
STRUCTURES = (
    "trunnion-ac", "head-table", "gantry-wrist", "arm-6", "scara", "polar", "linear-delta", "tripod",
    "hexapod",
)  # fmt: skip
MILLS = ("trunnion-ac", "head-table", "gantry-wrist")
PLATFORMS = ("linear-delta", "tripod", "hexapod")
#: Instruments on machine tools, arms and platforms, each with its usual number of readings.
INSTRUMENTS = {
    "R-test": 40, "two balls": 40, "tracker": 50, "6D": 40, "ball-bar": 100, "planes": 100, "one point": 40,
    "payload": 40,
}  # fmt: skip
#: Standard deviations of location errors: um of shifts and lengths, urad of tilts, urad of zeros.
SPREAD = {"mill": (200.0, 500.0, 1000.0), "other": (1000.0, 3000.0, 3000.0)}
#: Standard deviations of readings in um: of balls, and of the others on machine tools and elsewhere.
BALL_UM, MILL_UM, OTHER_UM, TURN_URAD = 1.5, 8.0, 20.0, 40.0
NESTS = np.array(((0.0, 0.0, 0.0), (60.0, 0.0, 0.0), (0.0, 70.0, 20.0)))
#: Weights of an arm, and what it holds in a second run, kg and mm.
MASSES = ({"on": "J2", "kg": 16.0, "centre_mm": [250.0, 10.0, 400.0]},
          {"on": "J3", "kg": 11.0, "centre_mm": [560.0, -5.0, 430.0]})  # fmt: skip
HELD = (6.0, np.array((20.0, 0.0, 60.0)))
SOFT = ("J2", "J3")
SOFT_URAD_NM = 3.0
#: Postures at which a calibration is judged.
JUDGED = 60


@dataclass(frozen=True)
class Run:
    """Readings of one set-up: the commanded values (n, k), what is read as a function of errors and own
    unknowns (l,), how well in mm or rad (m,), their table and file. `missed` (n, m) is what was read
    less what the true errors predict, in mm or rad. `shown` (n, k) is what the control showed, where the file
    has columns of it."""

    values: Array
    predict: Callable[[dict[Name, float], Array], Array]
    own: int
    sigma: Array
    table: str
    columns: tuple[str, ...]
    read: Array
    missed: Array
    which: tuple[str, Sequence[str]] | None
    shown: Array | None = None


@dataclass(frozen=True)
class Score:
    """How far the tip is off at other postures in the best frame, rms in um; how far it is from where the
    best estimate from the same readings has it; and how far off that is on average, the limit. Of how many
    components (2 sigma) the stated uncertainty covers."""

    off_um: float
    beside_um: float
    limit_um: float
    stated_um: float
    covered: float
    components: int


def machine_of(folder: Path, structure: str, rng: np.random.Generator) -> Path:
    """A machine that was not seen before, in a new folder."""
    assert CliRunner().invoke(main, ["init", str(folder), "--structure", structure]).exit_code == 0
    path, factors = folder / "machine.toml", rng.uniform(0.9, 1.1, 3)

    def other(line: re.Match[str]) -> str:
        point = factors * [float(cell) for cell in line[2].split(",")]
        return f"{line[1]}{', '.join(f'{number:.4f}' for number in point)}]"

    text = re.sub(r"(point_mm = \[)(.*)\]", other, path.read_text())
    text = text.replace("[-1000.0, 1000.0]", "[-300.0, 300.0]").replace("[-360.0, 360.0]", "[-180.0, 180.0]")
    path.write_text(text)
    return path


def instruments_of(structure: str) -> tuple[str, ...]:
    """The instruments that a shop has: a platform that does not turn has one posture at a point."""
    if structure in MILLS:
        return ("R-test", "two balls", "tracker", "6D", "ball-bar", "planes", "one point")
    if structure == "arm-6":
        # balls are left to machine tools: an arm that is off by 10 mm is out of the range of an R-test
        return ("tracker", "payload", "6D", "ball-bar", "planes", "one point")
    return ("tracker", "6D", "ball-bar", "planes")


def spreads(structure: str, names: Sequence[Name], size: float) -> Array:
    """(k,) standard deviations of parameters, um, urad and urad per Nm."""
    shift, tilt, zero = SPREAD["mill" if structure in MILLS else "other"]
    kinds = {"zero_urad": zero, "own_urad_Nm": SOFT_URAD_NM / size}
    return np.array([size * kinds.get(key, shift if key.endswith("um") else tilt) for _, _, key in names])


class Campaign:
    """One machine with its truth, to be measured by one instrument."""

    def __init__(self, folder: Path, structure: str, instrument: str, seed: int, size: float = 1.0) -> None:
        self.structure, self.instrument, self.size = structure, instrument, size
        self.rng = np.random.default_rng(
            [seed, STRUCTURES.index(structure), list(INSTRUMENTS).index(instrument)]
        )
        self.folder, self.mill = folder, structure in MILLS
        loaded = instrument == "payload"
        self.machine = Located(machine_of(folder, structure, self.rng), MASSES if loaded else ())
        self.names = self.machine.parameters()
        self.names += [("elasticity", name, "own_urad_Nm") for name in SOFT] if loaded else []
        self.spread = spreads(structure, self.names, size)
        theta = self.rng.normal(0.0, self.spread)
        if loaded:
            theta[-len(SOFT) :] = SOFT_URAD_NM
        self.theta = theta
        self.sigma = 1e-3 * (MILL_UM if self.mill else OTHER_UM)
        self.tool = np.array((30.0, -20.0, -100.0 if self.mill else 100.0))
        if instrument in ("R-test", "two balls"):
            self.sigma, self.tool = 1e-3 * BALL_UM, np.array((0.0, 0.0, -120.0 if self.mill else 100.0))
        self.runs = list(self._runs())

    def errors(self, theta: Array) -> dict[Name, float]:
        return dict(zip(self.names, theta.tolist(), strict=True))

    def random_values(self, count: int) -> Array:
        """(n, k) within the middle of the travels, where platforms close."""
        low, high = self.machine.limits.T
        half = 0.5 * (high - low) * (0.2 if self.structure in PLATFORMS else 1.0)
        return self.rng.uniform(0.5 * (low + high) - half, 0.5 * (low + high) + half, (count, len(low)))

    def tips(self, values: Array, errors: dict[Name, float], tool: Array, payload: Any = None) -> Array:
        whole = self.machine.pose(values, errors, payload or (0.0, np.zeros(3)))
        return np.asarray(whole[:, :3, :3] @ tool + whole[:, :3, 3])

    def brought(
        self, values: Array, miss: Callable[[Array], Array], axes: Sequence[int]
    ) -> tuple[Array, Array]:
        """(n, k) postures at which a function (n, m) of axis values is zero, by moving some axes, and which
        rows of `values` they are from."""
        values = values.copy()
        for _ in range(40):
            off = miss(values)
            table = np.zeros((*off.shape, len(axes)))
            for column, axis in enumerate(axes):
                step = np.zeros(values.shape[1])
                step[axis] = 1e-4
                table[..., column] = (miss(values + step) - miss(values - step)) / 2e-4
            move = np.einsum("nkm,nm->nk", np.linalg.pinv(table, rcond=1e-3), off)
            values[:, axes] -= np.clip(move, -15.0, 15.0)
        low, high = self.machine.limits.T
        met = (np.abs(miss(values)).max(axis=1) < 1e-6) & np.all((values >= low) & (values <= high), axis=1)
        return values[met], np.flatnonzero(met)

    def axes_to_move(self) -> list[int]:
        machine = self.machine
        return [k for k, n in enumerate(machine.order) if not self.mill or machine.kind(n) == "linear"]

    def _runs(self) -> Any:
        kind, count = self.instrument, INSTRUMENTS[self.instrument]
        if kind in ("tracker", "payload"):
            for k, payload in enumerate([None, HELD] if kind == "payload" else [None]):
                yield self._tracker(f"points-{k}.csv", self.random_values(count), payload)
        elif kind == "6D":
            yield self._six(self.random_values(count))
        elif kind == "ball-bar":
            yield self._lengths(self.random_values(count))
        elif kind == "planes":
            yield self._planes(self.random_values(4 * count), count)
        else:
            yield self._balls(
                self.random_values(6 * count), count, 2 if kind == "two balls" else 1, kind == "one point"
            )

    def noise(self, *shape: int) -> Array:
        return np.asarray(self.rng.normal(0.0, self.sigma, shape))

    def head(self, kind: str, file: str, more: str = "") -> str:
        table = f'[[{kind}]]\nfile = "{file}"\nsigma_um = {1e3 * self.sigma}\n'
        return f"{table}tool_mm = {self.tool.tolist()}\n{more}"

    def _tracker(self, file: str, values: Array, payload: Any) -> Run:
        turn, shift = turned(np.array((0.3, 1.0, -2.0))), np.array((3000.0, -500.0, 200.0))
        which = self.rng.integers(0, 3, len(values))

        def predict(errors: dict[Name, float], own: Array) -> Array:
            whole = self.machine.pose(values, errors, payload or (0.0, np.zeros(3)))
            at = (whole[:, :3, :3] @ (self.tool + NESTS[which])[..., None])[..., 0] + whole[:, :3, 3]
            return np.asarray(at @ turn.T @ turned(own[3:]).T + shift + own[:3])

        more = f"payload_kg = {payload[0]}\npayload_centre_mm = {payload[1].tolist()}\n" if payload else ""
        more += "[points.nests_mm]\n" + "".join(f"N{k} = {nest.tolist()}\n" for k, nest in enumerate(NESTS))
        noise = self.noise(len(values), 3)
        read = predict(self.errors(self.theta), np.zeros(6)) + noise
        columns = tuple(f"measured_{c}_mm" for c in "XYZ")
        named, table = ("nest", [f"N{k}" for k in which]), self.head("points", file, more)
        return Run(values, predict, 6, np.full(3, self.sigma), table, columns, read, noise, named)

    def _six(self, values: Array) -> Run:
        turn, shift = turned(np.array((0.3, 1.0, -2.0))), np.array((3000.0, -500.0, 200.0))
        count, true = len(values), self.machine.pose(values, self.errors(self.theta))
        real = turn @ true[:, :3, :3]

        def predict(errors: dict[Name, float], own: Array) -> Array:
            whole = self.machine.pose(values, errors)
            at = (
                (whole[:, :3, :3] @ self.tool + whole[:, :3, 3]) @ turn.T @ turned(own[3:]).T
                + shift
                + own[:3]
            )
            away = vector_of(turned(own[3:]) @ turn @ whole[:, :3, :3] @ np.swapaxes(real, -1, -2))
            return np.concatenate((at, away), 1)

        noise = self.noise(count, 3)
        at = predict(self.errors(self.theta), np.zeros(6))[:, :3] + noise
        slip = self.rng.normal(0.0, 1e-6 * TURN_URAD, (count, 3))
        slips = turned(slip) @ real
        angles = Rotation.from_matrix(slips).as_euler("xyz", degrees=True)
        columns = tuple(f"measured_{c}_mm" for c in "XYZ") + tuple(f"measured_{c}_deg" for c in "ABC")
        sigma = np.array([self.sigma] * 3 + [1e-6 * TURN_URAD] * 3)
        table = self.head("poses", "poses.csv", f"sigma_urad = {TURN_URAD}\n")
        read, missed = np.concatenate((at, angles), 1), np.concatenate((noise, slip), 1)
        return Run(values, predict, 6, sigma, table, columns, read, missed, None)

    def _lengths(self, values: Array) -> Run:
        middle = self.tips(values, {}, self.tool).mean(axis=0)
        centres = middle + np.array(((500.0, 200.0, -300.0), (-600.0, 100.0, 200.0), (0.0, -700.0, 500.0)))
        which = np.arange(len(values)) % 3

        def predict(errors: dict[Name, float], own: Array) -> Array:
            away = self.tips(values, errors, self.tool) - (centres + own.reshape(3, 3))[which]
            return np.asarray(np.linalg.norm(away, axis=1))[:, None]

        noise = self.noise(len(values), 1)
        read = predict(self.errors(self.theta), np.zeros(9)) + noise
        about = centres + self.rng.uniform(-1.0, 1.0, (3, 3))
        more = "[lengths.centres_mm]\n" + "".join(f"S{k} = {c.tolist()}\n" for k, c in enumerate(about))
        named = ("centre", [f"S{k}" for k in which])
        table = self.head("lengths", "lengths.csv", more)
        return Run(values, predict, 9, np.array([self.sigma]), table, ("length_mm",), read, noise, named)

    def _planes(self, values: Array, count: int) -> Run:
        true, which = self.errors(self.theta), np.arange(len(values)) % 3
        normals = np.array(((0.1, 0.0, 1.0), (1.0, 0.1, 0.0), (0.0, 1.0, 0.1)))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        middle, noise = self.tips(values, {}, self.tool).mean(axis=0), self.noise(len(values), 1)

        def away(values: Array, which: Array, errors: dict[Name, float], own: Array) -> Array:
            tips, change = self.tips(values, errors, self.tool), own.reshape(3, 3)[which]
            arm, normal = tips - middle, normals[which]
            aside = normals[(which + 1) % 3], normals[(which + 2) % 3]
            lean = sum(np.sum(arm * a, 1) * change[:, k] for k, a in enumerate(aside))
            return np.asarray(np.sum(arm * normal, 1) + lean + change[:, 2])[:, None]

        met, rows = self.brought(
            values, lambda v: away(v, which, true, np.zeros(9)) - noise, self.axes_to_move()
        )
        met, rows = met[:count], rows[:count]
        named = ("plane", [f"P{k}" for k in which[rows]])

        def predict(errors: dict[Name, float], own: Array) -> Array:
            return away(met, which[rows], errors, own)

        sigma, table = np.array([self.sigma]), self.head("planes", "planes.csv")
        missed = -predict(true, np.zeros(9))
        return Run(met, predict, 9, sigma, table, (), np.zeros((len(met), 0)), missed, named)

    def _balls(self, values: Array, count: int, balls: int, by_hand: bool) -> Run:
        middle = self.tips(values, {}, self.tool).mean(axis=0)
        if self.structure == "arm-6":
            middle = np.array((600.0, 200.0, 300.0))
        places = middle + np.array(((50.0, 30.0, -40.0), (-80.0, 120.0, 60.0)))[:balls]
        which, true = np.arange(len(values)) % balls, self.errors(self.theta)
        noise, used = self.noise(len(values), 3), true if by_hand else {}

        def aim(values: Array) -> Array:
            return self.tips(values, used, self.tool) - places[which] - (noise if by_hand else 0.0)

        met, rows = self.brought(values, aim, self.axes_to_move())
        met, rows = met[:count], rows[:count]

        def predict(errors: dict[Name, float], own: Array) -> Array:
            return self.tips(met, errors, self.tool) - (places + own.reshape(-1, 3))[which[rows]]

        own = 3 * balls
        if by_hand:
            table, columns, read = self.head("postures", "point.csv"), (), np.zeros((len(met), 0))
            missed = -predict(true, np.zeros(own))
        else:
            table = self.head("ball", "ball.csv", 'reads = "tip"\naxes = "workpiece"\n')
            columns = ("dX_um", "dY_um", "dZ_um")
            # the probe is set to zero somewhere near the ball
            zero = self.rng.uniform(-0.05, 0.05, 3 * balls)
            read = 1e3 * (predict(true, zero) + noise[rows])
            missed = 1e-3 * read - predict(true, np.zeros(own))
        name = "point" if by_hand else "ball"
        named = (name, [f"B{k}" for k in which[rows]])
        return Run(met, predict, own, np.full(3, self.sigma), table, columns, read, missed, named)

    def written(self) -> Path:
        """The plan with its files."""
        head = f'schema = "olp-measurements-1"\nmachine = "{self.structure}"\nmeasured = 2026-11-20\n'
        head += "temperature_degC = 20.0\n"
        if self.instrument == "payload":
            head += f"elasticity = {list(SOFT)}\n".replace("'", '"')
        tables = [run.table for run in self.runs]
        if self.instrument == "payload":
            tables += [
                f'[[masses]]\non = "{m["on"]}"\nkg = {m["kg"]}\ncentre_mm = {m["centre_mm"]}\n'
                for m in MASSES
            ]
        for run in self.runs:
            units = ["deg" if self.machine.kind(n) == "rotary" else "mm" for n in self.machine.order]
            names = [f"{n}_{unit}" for n, unit in zip(self.machine.order, units, strict=True)]
            read = run.read
            if run.shown is not None:
                names += [f"read_back_{name}" for name in names]
                read = np.concatenate((run.shown, run.read), 1)
            lines = [",".join([*names, *run.columns, *([run.which[0]] if run.which else [])])]
            for k, row in enumerate(np.concatenate((run.values, read), 1).tolist()):
                cells = [f"{number:.9g}" for number in row]
                lines.append(",".join([*cells, *([run.which[1][k]] if run.which else [])]))
            file = run.table.split('"')[1]
            (self.folder / file).write_text("\n".join(lines) + "\n")
        plan = self.folder / "measurements.toml"
        plan.write_text("\n".join([head, *tables]))
        return plan

    def best(self) -> tuple[Array, Array]:
        """By how much the best estimate of the parameters is off (k,), and the least covariance (k, k). It
        knows the spread of such machines, and how the readings depend on the errors there are."""
        rows, owns = [], []
        width = sum(run.own for run in self.runs)
        before = 0
        for run in self.runs:

            def read(theta: Array, run: Run = run) -> Array:
                return run.predict(self.errors(theta), np.zeros(run.own)) / run.sigma

            def moved(own: Array, run: Run = run) -> Array:
                return run.predict(self.errors(self.theta), own) / run.sigma

            rows.append(slopes(read, self.theta, 0.01 * self.spread))
            own = slopes(moved, np.zeros(run.own), np.full(run.own, 1e-5))
            whole = np.zeros((len(own), width))
            whole[:, before : before + run.own] = own
            owns.append(whole)
            before += run.own
        missed = np.concatenate([(run.missed / run.sigma).ravel() for run in self.runs])
        return best_of(np.concatenate(rows), np.concatenate(owns), self.spread, missed, self.theta)

    def judged(self) -> tuple[Array, Array, Any]:
        """Other postures, a longer tool, and what it holds."""
        return (
            self.random_values(JUDGED),
            self.tool * (1.0, 1.0, 1.6),
            HELD if self.instrument == "payload" else None,
        )

    def off(self, fitted: olp.FittedJoints, values: Array, tool: Array, payload: Any) -> tuple[Array, Array]:
        """(n, 3) mm by which the tip of a calibration is off in the best frame, and what it states."""
        target = self.folder / "calibration.toml"
        for path, data in fitted.files(target).items():
            path.write_bytes(data)
        true = self.tips(values, self.errors(self.theta), tool, payload)
        off = laid(self.tips(values, errors_of(target), tool, payload), true) - true
        return off, fitted.fit.sigma_in_best_frame(values, tool)[0]

    def score(self) -> Score:
        """The calibration of `olp calibrate fit` at other postures with a longer tool."""
        fitted = olp.fit_joint_calibration(self.written(), self.folder / "machine.toml")
        values, tool, payload = self.judged()
        true = self.tips(values, self.errors(self.theta), tool, payload)
        off, stated = self.off(fitted, values, tool, payload)

        def tip(theta: Array) -> Array:
            return self.tips(values, self.errors(theta), tool, payload)

        table = slopes(tip, self.theta, 0.01 * self.spread).reshape(JUDGED, 3, -1)
        table = without_frame(table, true)
        change, covariance = self.best()
        least = np.sqrt(np.einsum("nik,kl,nil->ni", table, covariance, table))
        sizes = (1e3 * float(np.sqrt(np.mean(one**2))) for one in (off, off - table @ change, least, stated))
        return Score(*sizes, float(np.sum(np.abs(off) < 2.0 * stated)), off.size)


def laid(points: Array, on: Array) -> Array:
    """(n, 3) points shifted and turned onto others with the least sum of squares."""
    a, b = points.mean(axis=0), on.mean(axis=0)
    left, _, right = np.linalg.svd((points - a).T @ (on - b))
    turn = right.T @ np.diag((1.0, 1.0, np.sign(np.linalg.det(right.T @ left.T)))) @ left.T
    return np.asarray((points - a) @ turn.T + b)
