"""Draws `viewer/pictures/review.png`, the gantry's plate in the review page, with Chromium."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from judge import browser  # noqa: E402

from olp.review.job import view  # noqa: E402

JOB = ROOT / "programs" / "gantry-plate"
SIZE = (1600, 900)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "review.html"
        view(JOB / "plate.ngc", JOB / "machine.toml", JOB / "job.toml").write(file)
        with (
            browser.driver() as play,
            browser.launched(play, *browser.SOFTWARE_GL) as chromium,
            browser.opened(chromium, file, size=SIZE) as page,
        ):
            page.evaluate("olp.app.scene.refill()")
            page.wait_for_timeout(1000)
            shot = Image.open(io.BytesIO(page.screenshot()))
    shot.convert("RGB").save(ROOT / "viewer" / "pictures" / "review.png", optimize=True)


if __name__ == "__main__":
    main()
