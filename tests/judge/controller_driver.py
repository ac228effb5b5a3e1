#!/usr/bin/python3
"""Stands where LinuxCNC's screen would: switches the machine on, runs p.ngc, and logs every servo cycle."""

import os
import signal
import subprocess
import time
from pathlib import Path

import linuxcnc

FOLDER = Path(os.environ["CONTROLLER_FOLDER"])


def main(folder, limit_s):
    command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()

    def until(condition, seconds, what):
        end = time.monotonic() + seconds
        while True:
            status.poll()
            message = errors.poll()
            if message and message[0] in (linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR):
                raise RuntimeError(message[1])
            if condition():
                return
            if time.monotonic() > end:
                raise RuntimeError(f"not within {seconds} s: {what}")
            time.sleep(0.01)

    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.wait_complete()
    command.state(linuxcnc.STATE_ON)
    command.wait_complete()
    until(lambda: status.task_state == linuxcnc.STATE_ON, 10, "machine on")
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.home(-1)
    until(lambda: all(status.homed[: status.joints]), 20, "homed")
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.program_open(str(folder / "p.ngc"))
    command.wait_complete()
    with (folder / "samples").open("wb") as sink:
        sampler = subprocess.Popen(["halsampler", "-t"], stdout=sink)
        try:
            time.sleep(0.3)
            subprocess.check_call(["halcmd", "setp", "sampler.0.enable", "1"])
            command.auto(linuxcnc.AUTO_RUN, 0)
            until(lambda: status.interp_state != linuxcnc.INTERP_IDLE, 10, "started")
            until(
                lambda: status.interp_state == linuxcnc.INTERP_IDLE and status.inpos and status.queue == 0,
                limit_s,
                "ended",
            )
            time.sleep(0.2)
            subprocess.check_call(["halcmd", "setp", "sampler.0.enable", "0"])
            lost = subprocess.check_output(["halcmd", "getp", "sampler.0.overruns"]).decode().strip()
            if lost != "0":
                raise RuntimeError(f"{lost} samples lost")
            time.sleep(0.3)
        finally:
            sampler.send_signal(signal.SIGINT)
            sampler.wait(10)


if __name__ == "__main__":
    try:
        main(FOLDER, float(os.environ["CONTROLLER_LIMIT_S"]))
        said = "ended\n"
    except Exception as error:
        said = f"{error!r}\n"
    (FOLDER / "driver.log").write_text(said)
