"""The command `olp`, also as `python -m olp`."""

from __future__ import annotations

import sys

from olp.core.errors import INTERRUPTED


def run() -> None:
    """Run the command line; an interrupt while it is imported ends as any other."""
    try:
        from olp.cli import main
        from olp.cli.endings import keep_streams

        keep_streams()
        main(prog_name="olp")
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    run()
