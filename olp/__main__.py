"""The command `olp`, also as `python -m olp`."""

from __future__ import annotations

import gc
import sys

from olp.core.errors import INTERRUPTED

#: Objects that are made before unreachable ones are looked for. Modules and models are all reachable, and
#: Python's own 700 would look through them again and again while they are loaded: a tenth of a short run.
_COLLECT_AFTER = 100_000


def run() -> None:
    """Run the command line; an interrupt while it is imported ends as any other."""
    gc.set_threshold(_COLLECT_AFTER)
    try:
        from olp.cli import main
        from olp.cli.endings import keep_streams

        keep_streams()
        main(prog_name="olp")
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    finally:
        gc.freeze()  # the interpreter would look through all objects again, to free what ends with it anyway


if __name__ == "__main__":
    run()
