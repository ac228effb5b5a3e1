"""LinuxCNC's own kinematics as judge: its compiled modules, called outside of LinuxCNC.

The modules ask HAL for their pins. `hal_stand_in.c` gives them, and lets a test set their values.
"""

from __future__ import annotations

import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

MODULES = Path("/usr/lib/linuxcnc/modules")
STAND_IN = Path(__file__).with_name("hal_stand_in.c")
#: Joints of a call; no module has more.
_JOINTS = 16


class _Pose(ctypes.Structure):
    """EmcPose: x y z, a b c, u v w."""

    _fields_ = [(name, ctypes.c_double) for name in "xyzabcuvw"]


@functools.cache
def _stand_in() -> ctypes.CDLL:
    compiler = shutil.which("cc")
    if compiler is None or not MODULES.is_dir():
        missing = "LinuxCNC's kinematics or a C compiler is not there"
        if os.environ.get("OLP_REQUIRE_ORACLE") == "1":
            pytest.fail(f"OLP_REQUIRE_ORACLE=1, but {missing}")
        pytest.skip(missing)
    library = Path(tempfile.mkdtemp()) / "stand_in.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", str(library), str(STAND_IN)], check=True)
    loaded = ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    loaded.stand_in_pin.restype = ctypes.POINTER(ctypes.c_double)
    return loaded


@functools.cache
def _module(name: str) -> ctypes.CDLL:
    _stand_in()
    loaded = ctypes.CDLL(str(MODULES / f"{name}.so"))
    assert loaded.rtapi_app_main() == 0
    return loaded


def _set(name: str, pins: Mapping[str, float]) -> None:
    for pin, value in pins.items():
        data = _stand_in().stand_in_pin(f"{name}.{pin}".encode())
        assert data, f"{name} has no pin {pin}"
        data[0] = value


def forward(name: str, pins: Mapping[str, float], joints: np.ndarray) -> np.ndarray:
    """(n, 6) x y z a b c of a module at joint values (n, k), with the pins set."""
    module = _module(name)
    _set(name, pins)
    poses = []
    for row in joints:
        values, pose = (ctypes.c_double * _JOINTS)(*map(float, row)), _Pose()
        flags = (ctypes.c_ulong(0), ctypes.c_ulong(0))
        code = module.kinematicsForward(values, ctypes.byref(pose), *map(ctypes.byref, flags))
        assert code == 0, f"{name} gives {code} at {row}"
        poses.append([getattr(pose, part) for part in "xyzabc"])
    return np.array(poses)


def inverse(
    name: str, pins: Mapping[str, float], poses: np.ndarray, count: int, near: np.ndarray | None = None
) -> np.ndarray:
    """(n, count) joint values of a module at poses (n, 6) x y z a b c, with the pins set. It starts `near`
    (count,) joint values, whose branch it takes from its own forward computation there."""
    module = _module(name)
    _set(name, pins)
    rows, start = [], [0.0] * count if near is None else list(map(float, near))
    flags = (ctypes.c_ulong(0), ctypes.c_ulong(0))
    values = (ctypes.c_double * _JOINTS)(*start)
    if near is not None:
        assert module.kinematicsForward(values, ctypes.byref(_Pose()), *map(ctypes.byref, flags)) == 0
    for row in poses:
        values, pose = (ctypes.c_double * _JOINTS)(*start), _Pose(*map(float, row))
        both = ctypes.byref(flags[1]), ctypes.byref(flags[0])
        assert module.kinematicsInverse(ctypes.byref(pose), values, *both) == 0
        rows.append(list(values)[:count])
    return np.array(rows)
