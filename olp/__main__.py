"""The command `olp`, also as `python -m olp`."""

from __future__ import annotations

import os
import sys

from olp.core.errors import INTERRUPTED


def run() -> None:
    """Run the command line; an interrupt while it is imported ends as any other."""
    try:
        _keep_streams()
        from olp.cli import main

        main(prog_name="olp")
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


def _keep_streams() -> None:
    """Take the numbers of closed streams, so that no file that is opened later is written as stdout."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # the lowest free number is given
            os.open(os.devnull, os.O_RDWR)


if __name__ == "__main__":
    run()
