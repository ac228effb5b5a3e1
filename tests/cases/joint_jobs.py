"""The jobs that ship for machines with rotary joints."""

from __future__ import annotations

#: By folder of `programs` the program.
JOINT_JOBS = {
    "trunnion-mill": "dome.nc",
    "gantry-wrist": "trim.mpf",
    "arm-payload": "deburr.csv",
    "hexapod": "lens.csv",
}
