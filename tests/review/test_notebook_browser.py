"""The pictures of a review in meshcat's own viewer, as its static page and live, in a real browser."""

from __future__ import annotations

import dataclasses
import io
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.fast import left_to_a_campaign
from judge import browser
from judge.machines import Recipe, random_machine
from PIL import Image

import olp
from olp.review.job import Review
from olp.review.notebook.framing import LEGEND, SHIFT
from olp.review.notebook.legend import board

# meshcat brings IPython, which warns of what it uses itself, and its server is left to its own
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]
PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
SMALL = (
    b"G21 G90 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X18\nG2 X20 Y2 I0 J2\nG1 Y8\nG1 X0\nG1 Y0\nM2\n"
)
LARGE = b"G21 G90 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z50\nG1 Z-100 F9000\nG1 X10000\nG1 Y4000\nG1 X0\nG1 Y0\nM2\n"
HALL = Recipe(
    travel=((0.0, 12_000.0), (0.0, 5000.0), (-1500.0, 0.0)),
    work_offsets={"G54": {"X_mm": 500.0, "Y_mm": 300.0, "Z_mm": -900.0, "set_by": "true"}},
)
SIZE = (1280, 720)
NODE = "viewer.scene_tree.find({})"


@pytest.fixture(autouse=True)
def needs_a_browser() -> None:
    browser.require()


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    browser.require()
    with browser.driver() as play, browser.launched(play, *browser.SOFTWARE_GL) as launched:
        yield launched


@pytest.fixture(scope="module")
def server() -> Iterator[Any]:
    """meshcat's own server, in a process of its own."""
    import meshcat

    visualizer = meshcat.Visualizer()
    yield visualizer
    visualizer.window.zmq_socket.close(linger=0)
    process = visualizer.window.server_proc
    process.kill()
    process.communicate()


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Review:
    return olp.view(SMALL, random_machine(tmp_path_factory.mktemp("small") / "m", 3))


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Review:
    return olp.view(LARGE, random_machine(tmp_path_factory.mktemp("large") / "m", 4, HALL), time=False)


@pytest.fixture(scope="module")
def plate() -> Review:
    folder = PROGRAMS / "gantry-plate"
    return olp.view(folder / "plate.ngc", folder / "machine.toml", time=False)


def static(chromium: Any, server: Any, path: Path, size: tuple[int, int] = SIZE) -> Any:
    """The static page of what the visualizer shows, opened with the network off."""
    page = path / "static.html"
    page.write_text(server.static_html(), "utf-8")
    return browser.opened(chromium, page, size=size, ready="canvas")


def settled(page: Any, picture: str) -> None:
    """Waits until the legend is there, as the last thing to come."""
    path = ["meshcat", "olp", picture, "legend", "<object>"]
    browser.until(page, f"{NODE.format(path)}.object.isSprite === true")
    page.evaluate("viewer.render()")
    page.wait_for_timeout(200)


def coloured(picture: np.ndarray, families: str) -> np.ndarray:
    """(h, w) pixels of a saturated colour that is bluish or reddish."""
    red, green, blue = (picture[:, :, i] for i in range(3))
    if families == "blue":
        return np.asarray((blue - red > 70) & (blue >= green))
    return np.asarray((red - blue > 70) & (red > green))


def beside(picture: np.ndarray) -> np.ndarray:
    """What is at the right of the legend."""
    height, width = picture.shape[:2]
    return picture[:, int(width / 2 + LEGEND[1] * height) + 2 :]


@pytest.mark.parametrize("job", left_to_a_campaign(("small", "large", "plate"), ("plate",)))
@pytest.mark.parametrize(("name", "family"), [("corrected", "blue"), ("uncorrected", "red")])
def test_a_job_of_any_size_fills_the_static_page_in_the_colours_of_its_error(
    chromium: Any, server: Any, tmp_path: Path, request: pytest.FixtureRequest, job: str, name: str,
    family: str,
) -> None:  # fmt: skip
    olp.add_layers(server, request.getfixturevalue(job), picture=name)
    with static(chromium, server, tmp_path) as page:
        settled(page, name)
        seen = beside(browser.picture(page, "canvas"))
    mine = coloured(seen, family)
    other = coloured(seen, "red" if family == "blue" else "blue")
    assert mine.sum() > 2000
    assert other.sum() < mine.sum() / 5
    rows, columns = (np.flatnonzero(mine.any(axis=axis)) for axis in (1, 0))
    assert np.ptp(columns) > 0.35 * SIZE[0] or np.ptp(rows) > 0.5 * SIZE[1]
    assert columns.max() < seen.shape[1] - 10 and rows.min() > 10 and rows.max() < SIZE[1] - 10


@pytest.mark.parametrize("size", [(1280, 720), (900, 400), (1024, 768)])
def test_the_legend_is_readable_at_its_place_also_when_the_scene_is_turned_and_zoomed(
    chromium: Any, server: Any, tmp_path: Path, small: Review, size: tuple[int, int]
) -> None:
    layers = olp.add_layers(server, small)
    drawn = board(layers.legends["corrected"], *(edge - SHIFT for edge in LEGEND))
    width, height = (round(v * size[1]) for v in (drawn.width, drawn.height))
    image = Image.open(io.BytesIO(drawn.png)).resize((width, height), Image.Resampling.LANCZOS)
    inner = image.crop((4, 4, round((LEGEND[1] - LEGEND[0]) * size[1]) - 4, height - 4))
    wanted = np.asarray(
        Image.alpha_composite(Image.new("RGBA", inner.size, "white"), inner).convert("L"), float
    )
    left = round(size[0] / 2 + LEGEND[0] * size[1]) + 4
    top = round((size[1] - height) / 2) + 4

    def unlike(page: Any) -> float:
        seen = browser.picture(page, "canvas").mean(axis=2)
        shifts = itertools.product((-1, 0, 1), repeat=2)
        return min(
            float(np.abs(seen[top + y : top + y + wanted.shape[0], left + x : left + x + wanted.shape[1]]
                         - wanted).mean())
            for y, x in shifts
        )  # fmt: skip

    with static(chromium, server, tmp_path, size) as page:
        settled(page, "corrected")
        assert unlike(page) < 12.0
        assert wanted.std() > 25.0
        page.mouse.move(size[0] * 0.7, size[1] * 0.5)
        page.mouse.down()
        page.mouse.move(size[0] * 0.8, size[1] * 0.6, steps=5)
        page.mouse.up()
        page.mouse.wheel(0, -300)
        page.wait_for_timeout(300)
        assert unlike(page) < 12.0


def test_the_motion_plays_in_real_time_and_is_where_the_tip_is(
    chromium: Any, server: Any, tmp_path: Path, small: Review
) -> None:
    olp.add_layers(server, small)
    scene = small.scene
    order = scene.nodes[-1].path[1:]
    tool = NODE.format(["meshcat", "olp", "tool"])
    ends = NODE.format(["meshcat", "olp", "machine", *order])

    def now(page: Any) -> tuple[float, np.ndarray, float]:
        """Time of the motion in s, place of the tool in mm, and the clock in s, all of one moment."""
        state = f"[viewer.animator.time, {tool}.object.position.toArray(), performance.now()]"
        time, place, clock = page.evaluate(state)
        return time, np.array(place), clock / 1000.0

    def tip(time: float) -> np.ndarray:
        return np.array([np.interp(time, scene.time_s, scene.position_mm[:, i]) for i in range(3)])

    with static(chromium, server, tmp_path) as page:
        settled(page, "corrected")
        np.testing.assert_allclose(now(page)[1], scene.position_mm[0], atol=1e-3)
        begin = page.evaluate("[performance.now(), viewer.animator.play()][0]") / 1000.0
        page.wait_for_timeout(1500)
        time, place, end = now(page)
        assert 0.0 < time <= end - begin + 0.1
        np.testing.assert_allclose(place, tip(time), atol=0.05)
        page.evaluate("viewer.animator.pause()")
        # the slider of meshcat's controls, once it has played
        for share in (0.3, 0.6, 0.9):
            wanted = share * scene.time_s[-1]
            page.evaluate(f"viewer.animator.seek({wanted})")
            np.testing.assert_allclose(now(page)[1], tip(wanted), atol=0.05)
            moved = page.evaluate(f"{ends}.object.position.toArray()")
            i = "XYZ".index(order[-1])
            axis = scene.samples.axis_mm[:, i] - scene.samples.axis_mm[0, i]
            assert moved[i] == pytest.approx(np.interp(wanted, scene.time_s, axis), abs=0.05)


def test_a_live_page_takes_one_review_after_another(chromium: Any, server: Any, small: Review) -> None:
    """Also the view is set anew, and nothing fails in the browser."""
    trouble: list[str] = []
    page = chromium.new_context(viewport={"width": SIZE[0], "height": SIZE[1]}).new_page()
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.goto(server.url())
    # asked here: meshcat's own wait() may leave its server deaf
    browser.until(page, "viewer.connection.readyState === 1")
    camera = "viewer.camera.position.toArray()"
    layers = olp.add_layers(server, small)
    settled(page, "corrected")
    first = page.evaluate(camera)
    page.mouse.move(900, 300)
    page.mouse.down()
    page.mouse.move(1000, 400, steps=5)
    page.mouse.up()
    assert np.linalg.norm(np.subtract(page.evaluate(camera), first)) > 0.1
    layers.show("uncorrected")
    page.wait_for_timeout(300)
    assert coloured(beside(browser.picture(page, "canvas")), "red").sum() > 1000
    scene = dataclasses.replace(small.scene, bodies=())
    olp.add_layers(server, Review(scene), picture="corrected", play=True)
    settled(page, "corrected")
    np.testing.assert_allclose(page.evaluate(camera), first, atol=1e-9)
    assert coloured(beside(browser.picture(page, "canvas")), "blue").sum() > 1000
    machine = page.evaluate(f"{NODE.format(['meshcat', 'olp', 'machine'])}.object.children.map(c => c.name)")
    assert [name for name in machine if name != scene.nodes[0].path[-1]] == []
    browser.until(page, "viewer.animator.time > 0.3")
    page.context.close()
    assert trouble == []
