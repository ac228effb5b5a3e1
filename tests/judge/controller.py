"""The whole of LinuxCNC, without a screen: task, planner and motion, sampled every servo cycle."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import signal
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from judge.linuxcnc import SYSTEM_PYTHON, _parameters, _setup

PERIOD_NS = 1_000_000
SPEED_MM_S = 500.0
ACCELERATION_MM_S2 = 2000.0
#: kinds of motion as the planner names them
TRAVERSE = 1
FEED = 2
ARC = 3
#: starts that are tried: on a busy machine modules fail to load or come late, before the program is looked at
_STARTS = 3
_LATE = re.compile("not within .* s: (machine on|homed|started)")
_DRIVER = Path(__file__).with_name("controller_driver.py")
_LOCKSTEP = Path(__file__).with_name("lockstep.c")
_NETS = {
    "joint.0.pos-cmd": "sampler.0.pin.0",
    "joint.1.pos-cmd": "sampler.0.pin.1",
    "joint.2.pos-cmd": "sampler.0.pin.2",
    "motion.motion-type": "sampler.0.pin.3",
    "joint.0.motor-pos-cmd": "joint.0.motor-pos-fb sampler.0.pin.4",
    "joint.1.motor-pos-cmd": "joint.1.motor-pos-fb sampler.0.pin.5",
    "joint.2.motor-pos-cmd": "joint.2.motor-pos-fb sampler.0.pin.6",
    "iocontrol.0.user-enable-out": "iocontrol.0.emc-enable-in",
    "iocontrol.0.tool-prepare": "iocontrol.0.tool-prepared",
    "iocontrol.0.tool-change": "iocontrol.0.tool-changed",
}


@dataclass(frozen=True, slots=True)
class Run:
    """Commanded axis positions (n, 3) in mm, one row a servo cycle, and the kind of motion (n,); `motor`
    (n, 3) are the commands to the drives, tables of the control included; `pins` are those asked for."""

    axis: np.ndarray
    kind: np.ndarray
    motor: np.ndarray
    pins: np.ndarray

    @property
    def cutting(self) -> np.ndarray:
        """Cycles on a feed move without its first and last one: the kind may be reported a cycle late."""
        now = (self.kind == FEED) | (self.kind == ARC)
        return now & np.roll(now, 1) & np.roll(now, -1)


def require() -> None:
    """Skip the running test without the control; fail it where OLP_REQUIRE_ORACLE=1 promises one."""
    import pytest

    if all(shutil.which(name) for name in ("linuxcnc", "halsampler", "gcc")):
        return
    if os.environ.get("OLP_REQUIRE_ORACLE") == "1":
        pytest.fail("OLP_REQUIRE_ORACLE=1, but LinuxCNC itself, or gcc, is not installed")
    pytest.skip("needs LinuxCNC: apt-get install --no-install-recommends linuxcnc-uspace gcc libc6-dev")


@dataclass(frozen=True, slots=True)
class Kinematics:
    """A component `name`, compiled in `folder`, and the lines of HAL that go with it; `pins` are sampled
    besides. Its functions `begin` and `end` go around motion-controller; a module of LinuxCNC, which is
    `built_in`, has none. `letters` are those of the joints in their order, `options` those of its loadrt.
    With `home` all joints turn, and begin there, in deg: letters are those of poses then."""

    name: str
    folder: Path
    hal: str
    pins: tuple[str, ...] = ()
    acceleration_mm_s2: float = ACCELERATION_MM_S2
    letters: str = "XYZ"
    options: str = ""
    home: tuple[float, ...] = ()
    built_in: bool = False


def run(
    program: bytes, machine: Path, folder: Path, *, limit_s: float = 240.0, tables: Path | None = None,
    kinematics: Kinematics | None = None,
) -> Run:  # fmt: skip
    """Execute a program from axis position 0 with the offsets and tools of a machine folder; `tables` is an
    INI file whose keys of joints are taken over, its files lie beside it. `kinematics` takes the place of the
    identity. The control runs in virtual time, as fast as the task follows and the same on a busy machine.

    Raises RuntimeError where the control reports an error or does not end in time.
    """
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    _configure(machine, folder, tables, kinematics)
    (folder / "p.ngc").write_bytes(program)
    env = {"HOME": str(folder), "PATH": "/usr/bin:/bin:/usr/sbin:/sbin", "CONTROLLER_LIMIT_S": str(limit_s)}
    env["CONTROLLER_FOLDER"] = str(folder)
    if os.getuid() == 0:  # the realtime part refuses to be root
        env |= {"RTAPI_UID": "65534", "RTAPI_FIFO_PATH": str(folder / ".rtapi_fifo")}
    own = None if kinematics is None or kinematics.built_in else kinematics
    env |= _in_step(folder, own)
    lock = Path(tempfile.gettempdir()) / "judge-controller.lock"
    driver_log = folder / "driver.log"
    with lock.open("wb") as one, (folder / "log").open("wb") as log:
        # its realtime part is one a machine: other processes of the tests wait
        fcntl.flock(one, fcntl.LOCK_EX)
        for _ in range(_STARTS):
            if os.getuid() == 0:
                for opened in (folder, *([kinematics.folder] if kinematics else [])):
                    _open(opened)
            try:
                subprocess.run(
                    ["linuxcnc", str(folder / "m.ini")],
                    env=env, cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                    timeout=limit_s + 60, check=False,
                )  # fmt: skip
            finally:
                _end_realtime(folder)
            if driver_log.exists() and not _LATE.search(driver_log.read_text()):
                break
    if not driver_log.exists() or driver_log.read_text() != "ended\n":
        debug = folder / "linuxcnc_debug.txt"
        texts = [p.read_text(errors="replace")[-2000:] for p in (driver_log, debug) if p.exists()]
        detail = texts[0] if texts else "it did not start"
        raise RuntimeError(f"the control did not run the program to its end: {detail}")
    more = len(kinematics.pins) if kinematics else 0
    rows = np.loadtxt(folder / "samples", comments=None, usecols=range(1, 8 + more))
    return Run(rows[:, :3], rows[:, 3].astype(int), rows[:, 4:7], rows[:, 7:])


def _in_step(folder: Path, kinematics: Kinematics | None) -> dict[str, str]:
    """The environment that lets each servo cycle wait for the task, and finds the component."""
    library, counters = folder / "lockstep.so", folder / "counters"
    subprocess.run(["gcc", "-shared", "-fPIC", "-O2", "-o", library, _LOCKSTEP], check=True)
    counters.write_bytes(bytes(4096))
    counters.chmod(0o666)
    env = {"LD_PRELOAD": str(library), "LOCKSTEP": str(counters), "LOCKSTEP_DT": str(PERIOD_NS)}
    if kinematics is not None:
        env["LOCKSTEP_MODULE"] = str(kinematics.folder / f"{kinematics.name}.so")
    return env


def _open(folder: Path) -> None:
    """For the user that the realtime part runs as; another run of pytest closes the folder of them all."""
    for path in (folder, *folder.parents):
        if path.stat().st_uid == os.getuid() and (path.stat().st_mode & 0o055) != 0o055:
            path.chmod(path.stat().st_mode | 0o055)
    folder.chmod(0o777)


def _end_realtime(folder: Path) -> None:
    """On a busy machine the realtime part of a run can outlive it, and would stand in the way of the next."""
    mine = f"CONTROLLER_FOLDER={folder}".encode()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if (process / "comm").read_text() != "rtapi_app\n":
                continue
            if mine in (process / "environ").read_bytes().split(b"\0"):
                os.kill(int(process.name), signal.SIGKILL)
        except (FileNotFoundError, ProcessLookupError, PermissionError):
            continue


def _configure(machine: Path, folder: Path, tables: Path | None, kinematics: Kinematics | None) -> None:
    setup = _setup(machine, {}, {}, None)
    letters = kinematics.letters if kinematics else "XYZ"
    module = kinematics.name if kinematics else "trivkins coordinates=XYZ"
    if kinematics and kinematics.built_in:
        module = f"{kinematics.name} {kinematics.options}"
    sections: dict[str, dict[str, object]] = {
        "EMC": {"VERSION": "1.1", "MACHINE": "judge"},
        "DISPLAY": {"DISPLAY": folder / "display", "PROGRAM_PREFIX": folder},
        "TASK": {"TASK": "milltask", "CYCLE_TIME": 0.001},
        "RS274NGC": {"PARAMETER_FILE": folder / "v.var"},
        "EMCMOT": {"EMCMOT": "motmod", "COMM_TIMEOUT": 10.0, "SERVO_PERIOD": PERIOD_NS},
        "EMCIO": {"EMCIO": "io", "CYCLE_TIME": 0.01, "TOOL_TABLE": folder / "t.tbl"},
        "HAL": {"HALFILE": folder / "m.hal"},
        "TRAJ": {
            "COORDINATES": " ".join(letters), "LINEAR_UNITS": "mm", "ANGULAR_UNITS": "degree",
            "NO_FORCE_HOMING": 1, "DEFAULT_LINEAR_VELOCITY": SPEED_MM_S, "MAX_LINEAR_VELOCITY": SPEED_MM_S,
            "MAX_LINEAR_ACCELERATION": ACCELERATION_MM_S2,
        },
        "KINS": {
            "KINEMATICS": module,
            "JOINTS": len(letters),
        },
    }  # fmt: skip
    reach = {"MIN_LIMIT": -5000, "MAX_LIMIT": 5000}
    most = kinematics.acceleration_mm_s2 if kinematics else ACCELERATION_MM_S2
    reach |= {"MAX_VELOCITY": SPEED_MM_S, "MAX_ACCELERATION": most}
    home = {"HOME": 0.0, "HOME_OFFSET": 0.0, "HOME_SEARCH_VEL": 0, "HOME_LATCH_VEL": 0, "HOME_SEQUENCE": 0}
    for joint, axis in enumerate(letters):
        turns = bool(kinematics and kinematics.home)
        kind = "ANGULAR" if turns or axis in "ABC" else "LINEAR"
        if kinematics and turns:
            home |= dict.fromkeys(("HOME", "HOME_OFFSET"), kinematics.home[joint])
        sections[f"AXIS_{axis}"] = dict(reach)
        sections[f"JOINT_{joint}"] = {"TYPE": kind, "FERROR": 1000, "MIN_FERROR": 1000, **home, **reach}
    if tables is not None:
        section = ""
        for line in tables.read_text().splitlines():
            key, mark, value = line.partition(" = ")
            if line.startswith("[JOINT_"):
                section = line.strip("[]")
            elif mark and section:
                sections[section][key] = folder / value if key == "COMP_FILE" else value
        for file in tables.parent.glob("*.comp"):
            (folder / file.name).write_bytes(file.read_bytes())
    # called with options of a screen, which it has no use for
    (folder / "display").write_text(f"#!/bin/sh\nexec {SYSTEM_PYTHON} -I {_DRIVER}\n")
    (folder / "display").chmod(0o755)
    (folder / "m.ini").write_text(
        "".join(
            f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in section.items())
            for name, section in sections.items()
        )
    )
    own = kinematics or Kinematics("trivkins coordinates=XYZ", folder, "")
    more = {f"joint.{j}.motor-pos-cmd": f"joint.{j}.motor-pos-fb" for j in range(3, len(letters))}
    nets = {**_NETS, **more, **{pin: f"sampler.0.pin.{7 + i}" for i, pin in enumerate(own.pins)}}
    linked = {source: signal for signal, source in re.findall(r"^net (\S+) (\S+) =>", own.hal, re.MULTILINE)}
    around = [f"addf {own.name}.{function} servo-thread\n" for function in ("begin", "end")]
    before, behind = around if kinematics and not kinematics.built_in else ("", "")
    (folder / "m.hal").write_text(
        f"loadrt {own.name} {own.options}\n"
        f"loadrt motmod servo_period_nsec={PERIOD_NS} num_joints={len(letters)}\n"
        f"loadrt sampler depth=100000 cfg=fffsfff{'f' * len(own.pins)}\n"
        f"addf motion-command-handler servo-thread\n{before}addf motion-controller servo-thread\n{behind}"
        "addf sampler.0 servo-thread\nsetp sampler.0.enable 0\n"
        + own.hal
        + "".join(f"net {linked.get(a, f'n{i} {a}')} => {b}\n" for i, (a, b) in enumerate(nets.items()))
    )
    (folder / "v.var").write_text(_parameters(setup))
    (folder / "t.tbl").write_text(
        "".join(f"T{n} P{n} X{x!r} Y{y!r} Z{z!r} D{d!r}\n" for n, (x, y, z, d) in setup.tools.items())
    )
