"""The 3D view: what is stored is where it was, pages stay small, and the browser draws it."""

import base64
import json
import re
from typing import Any

import numpy as np
import trimesh

from kpred.reports.page import page
from kpred.reports.viewer import MAX_POINTS, Shape, color, viewer

BOX = trimesh.creation.box((2.0, 1.0, 0.5))


def content(html: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data-scene">(.*?)</script>', html, re.S)
    assert found is not None
    return json.loads(found[1])


def test_places_are_kept_to_a_step_of_the_grid() -> None:
    points = np.random.default_rng(0).normal(size=(500, 3)) * [3, 1, 0.2] + 100
    (item,) = content(viewer([Shape.of_points("a", points, color(1, 2, 3))]))["items"]
    steps = np.frombuffer(base64.b64decode(item["vertices"]), "<u2").reshape(-1, 3) / 65535
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    np.testing.assert_allclose(low + steps * extent, points, atol=extent.max() / 65535)


def test_points_are_thinned_with_their_colors_and_strays_left_out() -> None:
    points = np.tile(np.arange(3.0 * MAX_POINTS)[:, None], (1, 3))
    points[::7] = np.nan
    colors = (np.arange(len(points))[:, None] % 251).astype(np.uint8).repeat(3, axis=1)
    shape = Shape.of_points("a", points, colors)
    assert len(shape.vertices) <= MAX_POINTS and np.isfinite(shape.vertices).all()
    np.testing.assert_array_equal(shape.colors[:, 0], shape.vertices[:, 0] % 251)


def test_meshes_beyond_the_budget_are_left_out_and_keep_their_numbers() -> None:
    each = [Shape("m", BOX.vertices + at, BOX.faces, color(1, 1, 1)) for at in range(3)]
    html = viewer(each, max_triangles=13)
    assert [bool(item.get("faces")) for item in content(html)["items"]] == [True, False, False]
    assert "2 meshes" in html
    assert viewer([]) == "" and viewer([Shape.of_points("a", np.zeros((0, 3)), color(1, 1, 1))]) == ""


def test_names_of_layers_end_no_script() -> None:
    html = viewer([Shape("</script><script>alert(1)</script>", BOX.vertices, BOX.faces, color(1, 1, 1))])
    assert html.count("<script") == 1
    assert content(html)["items"][0]["layer"].startswith("</script>")


def test_the_browser_draws_turns_and_hides(browser: Any) -> None:
    problems: list[str] = []
    tab = browser.new_page()
    tab.on("pageerror", lambda error: problems.append(str(error)))
    tab.on("console", lambda line: problems.append(line.text) if line.type == "error" else None)
    shapes = [
        Shape("box", BOX.vertices, BOX.faces, color(200, 30, 30)),
        Shape.of_points("p", BOX.vertices, color(0, 0, 9)),
    ]
    tab.set_content(page("t", [viewer(shapes)], ["viewer.js"]))
    canvas = tab.locator("canvas")

    def red() -> np.ndarray:
        import io

        from PIL import Image

        tab.wait_for_timeout(150)
        seen = np.asarray(Image.open(io.BytesIO(canvas.screenshot())).convert("RGB")).astype(int)
        return seen[..., 0] - seen[..., 1] > 60

    first = red()
    assert 0.02 < first.mean() < 0.8
    box = canvas.bounding_box()
    tab.mouse.move(box["x"] + 200, box["y"] + 200)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 330, box["y"] + 210)
    tab.mouse.up()
    assert (red() != first).mean() > 0.01
    canvas.dblclick()
    assert (red() != first).mean() < 0.002
    tab.get_by_label("box").uncheck()
    assert not red().any()
    assert not problems
    tab.close()
