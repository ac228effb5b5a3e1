"""The layers of a review in a visualizer of meshcat's: what is put where."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judge.machines import shift_machine

import olp
from olp.core.errors import UsageError
from olp.review import notebook
from olp.review.job import Review

TEXT = b"G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nT2 M6\nG43 H2\nG0 X0 Y50 Z20\nG1 X100\nM2\n"


class Visualizer:
    """Keeps what is put into it, as meshcat's does without a browser."""

    def __init__(self, path: str = "", held: dict[str, tuple[Any, ...]] | None = None) -> None:
        self.path, self.held = path, {} if held is None else held

    def __getitem__(self, name: str) -> Visualizer:
        return Visualizer(f"{self.path}/{name}", self.held)

    def set_object(self, *shapes: Any) -> None:
        self.held[self.path] = shapes


@pytest.fixture
def review(tmp_path: Path) -> Review:
    machine = shift_machine(tmp_path / "m", (30.0, -20.0, 10.0))
    measured = tmp_path / "m.csv"
    measured.write_text("# frame=G54\nX_mm,Y_mm,Z_mm\n0,0,20.01\n50,0,20.01\n")
    return olp.view(TEXT, machine, measured=[measured], time=False)


def points(held: tuple[Any, ...]) -> np.ndarray:
    return np.asarray(held[0].geometry.position).T


@pytest.mark.filterwarnings("ignore")
def test_layers_are_drawn_where_their_deviations_lead_to(review: Review) -> None:
    vis = Visualizer()
    olp.add_layers(vis, review, exaggeration=100.0, under="job")
    names = {name for name in vis.held if "/bodies/" not in name}
    assert names == {
        f"/job/{layer}" for layer in ("nominal", "uncorrected", "command", "corrected", "measured-1")
    }
    nominal = points(vis.held["/job/nominal"])
    # metres
    away = points(vis.held["/job/uncorrected"]) - nominal
    np.testing.assert_allclose(away, np.tile([3e-3, -2e-3, 1e-3], (len(nominal), 1)), atol=1e-7)
    np.testing.assert_allclose(points(vis.held["/job/corrected"]), nominal, atol=1e-7)
    assert nominal[:, 0].max() - nominal[:, 0].min() == pytest.approx(0.1)
    bodies = {name.rpartition("/")[2] for name in vis.held if "/bodies/" in name}
    assert bodies == {body.name for body in review.scene.bodies}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("most", [200_000, 50])
def test_no_line_crosses_a_gap(review: Review, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """After the tool change a new path begins, also where samples are left out."""
    monkeypatch.setattr(notebook, "_MOST", most)
    vis = Visualizer()
    notebook.add_layers(vis, review)
    pairs = points(vis.held["/olp/nominal"]).reshape(-1, 2, 3)
    y = pairs[:, :, 1] - pairs[:, :, 1].min()
    assert np.abs(y[:, 0] - y[:, 1]).max() < 1e-9
    length = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1).sum()
    assert length == pytest.approx(0.2, abs=1e-6)
    assert len(pairs) <= most + 10


@pytest.mark.parametrize("wrong", [-1.0, float("nan"), float("inf")])
def test_an_exaggeration_that_cannot_be(review: Review, wrong: float) -> None:
    with pytest.raises(UsageError, match="expected a number of 0 or above"):
        olp.add_layers(Visualizer(), review, exaggeration=wrong)
