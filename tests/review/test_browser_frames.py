"""How often the page draws, and that what moves is drawn anew, whole, once it rests."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judge import browser

pytestmark = pytest.mark.slow

#: Counts what is asked of the graphics: each frame begins with a `clear`.
COUNT = """(() => {
  const asked = (window.asked = {frames: 0, waits: 0, bytes: 0, draws: []});
  const own = WebGL2RenderingContext.prototype;
  const count = (name, call) => {
    const real = own[name];
    own[name] = function (...words) { call(words); return real.apply(this, words); };
  };
  count("clear", () => { asked.frames++; asked.draws = []; });
  count("readPixels", () => asked.waits++);
  count("drawElements", ([, corners]) => asked.draws.push(corners));
  for (const name of ["bufferData", "bufferSubData"]) count(name, words => {
    asked.bytes += words.find(word => word?.byteLength)?.byteLength ?? 0;
  });
})()"""
#: Keeps every ratio of pixels that is set.
RATIOS = """() => {
  const renderer = olp.app.scene.viewer.renderer, set = renderer.setPixelRatio.bind(renderer);
  window.ratios = [];
  renderer.setPixelRatio = (ratio) => { ratios.push(ratio); set(ratio); };
}"""
#: The picture, pixel by pixel.
PIXELS = """() => {
  const {viewer} = olp.app.scene, gl = viewer.renderer.getContext();
  viewer.render();
  const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight], pixels = new Uint8Array(4 * w * h);
  gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let text = "";
  const step = 32768;
  for (let k = 0; k < pixels.length; k += step) text += String.fromCharCode(...pixels.subarray(k, k + step));
  return [w, h, btoa(text)];
}"""


def pixels(page: Any) -> np.ndarray:
    wide, high, values = page.evaluate(PIXELS)
    return np.frombuffer(base64.b64decode(values), np.uint8).reshape(high, wide, 4)


def rest(page: Any) -> None:
    """Waits until the picture is whole again."""
    browser.until(page, "olp.app.scene.viewer.renderer.getPixelRatio() === devicePixelRatio")
    page.wait_for_timeout(300)


@pytest.mark.parametrize("size", [(1440, 900), (1024, 640), (390, 844)])
def test_one_frame_is_drawn_before_the_page_is_ready_and_none_while_it_rests(
    chromium: Any, file: Path, size: tuple[int, int]
) -> None:
    with browser.opened(chromium, file, size=size, before=COUNT) as page:
        # the wait sees the page at once or later: a second frame would count
        assert page.evaluate("[asked.frames, asked.waits]") == [1, 1]
        sent = page.evaluate("asked.bytes")
        page.wait_for_timeout(1500)
        assert page.evaluate("[asked.frames, asked.waits, asked.bytes]") == [1, 1, sent]


def test_each_path_is_drawn_once_a_frame_and_sent_when_the_view_changes(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file, before=COUNT) as page:
        drawn = page.evaluate("olp.drawn")
        paths = sorted(6 * count for count in drawn.values() if count)
        draws = page.evaluate("asked.draws")
        assert len(paths) == 2
        assert [draws.count(corners) for corners in paths] == [1, 1]
        sent = page.evaluate("asked.bytes")
        for _ in range(3):
            page.evaluate("olp.frame_ms()")
        assert page.evaluate("asked.bytes") == sent
        page.evaluate("olp.set_exaggeration(3)")
        browser.until(page, f"asked.bytes > {sent}")


#: The canvas has as many pixels as the pane that it fills.
SAME_SIZE = """
(({width, height}, {clientWidth, clientHeight}) => width === clientWidth && height === clientHeight)(
    olp.app.scene.viewer.renderer.domElement, olp.app.scene.pane
)
"""


def test_a_pane_of_another_size_is_drawn_at_that_size(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file, before=COUNT) as page:
        page.set_viewport_size({"width": 900, "height": 700})
        rest(page)
        browser.until(page, SAME_SIZE)
        rest(page)
        wide, high = page.evaluate("[olp.app.scene.pane.clientWidth, olp.app.scene.pane.clientHeight]")
        assert pixels(page).shape == (high, wide, 4)
        assert page.evaluate("asked.frames") > 1


def test_where_frames_are_slow_a_moving_view_has_fewer_pixels_and_at_rest_it_is_whole(
    chromium: Any, file: Path
) -> None:
    with browser.opened(chromium, file) as page:
        whole = pixels(page)
        page.evaluate("olp.app.scene.ms = 1000")  # as a long program in software graphics
        # kept, because a slow machine does not look while the view moves
        page.evaluate(RATIOS)
        box = page.evaluate("(({left, top}) => [left, top])(olp.app.scene.pane.getBoundingClientRect())")
        page.mouse.move(box[0] + 150, box[1] + 200)
        page.mouse.down()
        page.mouse.move(box[0] + 190, box[1] + 215, steps=3)
        browser.until(page, "ratios.includes(devicePixelRatio / 2)")
        rest(page)
        page.mouse.up()
        rest(page)
        turned, camera = pixels(page), page.evaluate("olp.app.camera.save()")
    assert turned.shape == whole.shape
    assert (turned != whole).any(axis=2).sum() > 1000
    # a page that never moved shows the same from there
    with browser.opened(chromium, file) as page:
        page.evaluate("camera => olp.app.camera.restore(camera)", camera)
        assert np.array_equal(pixels(page), turned)


def test_where_frames_are_fast_a_moving_view_keeps_its_pixels(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file) as page:
        page.evaluate("olp.app.scene.ms = 5")
        page.evaluate("olp.app.scene.moved()")
        assert page.evaluate("olp.app.scene.viewer.renderer.getPixelRatio() === devicePixelRatio")


def test_a_picture_saved_while_the_view_moves_is_whole(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file) as page:
        page.evaluate("olp.app.scene.ms = 1000")
        wide = page.evaluate("() => { olp.app.scene.moved(); return olp.app.scene.still().width; }")
        assert wide == page.evaluate("olp.app.scene.pane.clientWidth * devicePixelRatio")
