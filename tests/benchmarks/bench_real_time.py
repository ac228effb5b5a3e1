"""What a cycle of control code costs: `python tests/benchmarks/bench_real_time.py`.

Each machine has every kind of error. The C file is compiled with -O2 and follows a smooth motion, that of the
arm in poses. The figures are the median and the 99.9th hundredth of the time of a cycle, in us of this
processor.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "files" / "control_code")]
from test_joint_code import case, walk  # noqa: E402

from olp.files.control_code.joint_code import joint_code  # noqa: E402
from olp.files.control_code.registry import write_code  # noqa: E402

CYCLES = 20_000
CLOCK = """
#define _POSIX_C_SOURCE 199309L
#include <time.h>
"""
TIMED = """
void timed(int n, const double *wanted, const olp_state *state, double *us)
{
    olp_follower at;
    double command[OLP_AXES];
#ifdef OLP_POSES
    static double poses[6 * 20000], value[OLP_AXES];
    for (int k = 0; k < OLP_AXES; k++) value[k] = wanted[k];
    for (int i = 0; i < n; i++) olp_pose_of_axes(wanted + i * OLP_AXES, state, poses + 6 * i);
#endif
    memset(&at, 0, sizeof at);
    at.share = 1.0;
    for (int i = 0; i < n; i++) {
        struct timespec from, to;
        clock_gettime(CLOCK_MONOTONIC, &from);
#ifdef OLP_POSES
        /* programs state poses, which the joints follow first */
        if (!olp_axes_of_pose(poses + 6 * i, state, value)) us[0] = 1e9;
#endif
        olp_follow(&at, &olp_first_bounds, state, wanted + i * OLP_AXES, 1e-3, command);
        clock_gettime(CLOCK_MONOTONIC, &to);
        us[i] = 1e6 * (to.tv_sec - from.tv_sec) + 1e-3 * (to.tv_nsec - from.tv_nsec);
    }
}
"""


def main() -> None:
    print("machine              axes   median us   99.9 % us")
    for name in ("xyzac_trunnion", "gantry_nutating", "arm_6r_kr6"):
        machine, box = case(name)
        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder) / "model.c"
            source = write_code(joint_code(machine, box, "0" * 64), "c", target)[target]
            target.write_bytes(CLOCK.encode() + source + TIMED.encode())
            library = Path(folder) / "model.so"
            subprocess.run(
                ["cc", "-O2", "-shared", "-fPIC", "-o", str(library), str(target), "-lm"], check=True
            )
            timed = ctypes.CDLL(str(library)).timed
        wanted = walk(machine, 4, CYCLES)
        payload = machine.errors.payload
        fields = [*machine.tool_mm, payload.kg, *payload.centre_mm, *([0.0] * wanted.shape[1])]
        state, us = (ctypes.c_double * len(fields))(*fields), np.empty(CYCLES)
        pointers = [values.ctypes.data_as(ctypes.c_void_p) for values in (wanted, us)]
        timed(CYCLES, pointers[0], ctypes.byref(state), pointers[1])
        middle, late = np.percentile(us, [50.0, 99.9])
        print(f"{name:20s} {wanted.shape[1]:4d} {middle:11.1f} {late:11.1f}")


if __name__ == "__main__":
    main()
