"""Every gesture in headless Chromium: two tabs that do not mix, a drag by the mouse, sizes, crop, downloads, errors."""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kpred.studio.gestures import (
    ChooseCategory,
    ChooseDeform,
    ChooseModel,
    ChooseUnit,
    ChooseUp,
    Crop,
    MoveKeypoint,
    PinKeypoint,
    RefitRest,
    SetSize,
    Turn,
)
from kpred.studio.opening import Opened
from kpred.studio.room import RoomSession
from kpred.studio.serve import Studio
from kpred.studio.state import State
from kpred.studio.tabs import room_tabs, scan_tabs

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PICTURES = os.environ.get("KPRED_STUDIO_PICTURES")
"""Folder for pictures of the page, to look at."""

LONG = 180_000

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine (apt-get install chromium)"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    pytest.importorskip("viser", reason="viser is not installed (the extra studio)")
    with api.sync_playwright() as playwright:
        arguments = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def studio(start: State) -> Iterator[Studio]:
    running = Studio(scan_tabs(Opened(start, "chair_scan.ply")), port=0)
    yield running
    running.stop()


@pytest.fixture
def tab(browser: Any, studio: Studio) -> Iterator[Any]:
    context = browser.new_context(viewport={"width": 1200, "height": 820})
    page = context.new_page()
    page.set_default_timeout(LONG)
    page.goto(studio.url)
    page.get_by_text("Scan to result").wait_for()
    yield page
    context.close()


def _page(studio: Studio) -> Any:
    """What the newest tab shows."""
    return studio.tabs[-1].page


def _until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + LONG / 1000
    while not condition():
        assert time.monotonic() < end, "the page did not follow"
        time.sleep(0.05)


def _set(tab: Any, label: str, value: bool, condition: Callable[[], bool]) -> None:
    """Set a checkbox, again where the page was just being written by the server when it was clicked."""
    end = time.monotonic() + LONG / 1000
    while not condition():
        assert time.monotonic() < end, "the page did not follow"
        tab.get_by_label(label).set_checked(not value, force=True)
        tab.get_by_label(label).set_checked(value, force=True)
        time.sleep(1.0)


def _picture(tab: Any, name: str) -> None:
    if PICTURES:
        tab.wait_for_timeout(4000)
        tab.screenshot(path=str(Path(PICTURES) / f"{name}.png"))


def _screen(tab: Any, point: np.ndarray, camera: Any) -> tuple[float, float]:
    """Where a point of the scene is on the screen; viser's camera looks along +z, with x right and y down."""
    w, x, y, z = camera.wxyz
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    right, down, forward = rotation.T @ (point - camera.position)
    box = tab.locator("canvas").last.bounding_box()
    focal = box["height"] / 2 / np.tan(camera.fov / 2)
    return (
        box["x"] + box["width"] / 2 + focal * right / forward,
        box["y"] + box["height"] / 2 + focal * down / forward,
    )


def test_a_keypoint_is_dragged_by_the_mouse_and_undone_in_one_tab_alone(tab: Any, browser: Any, studio: Studio) -> None:
    mine = _page(studio)
    _picture(tab, "start")
    keypoint = int(mine.state.shape.keypoints[:, 1].argmax())
    mine.select(keypoint)
    tab.wait_for_timeout(3000)
    # The arrow upward begins above the keypoint.
    x, y = _screen(tab, mine.state.shape.keypoints[keypoint] + [0.0, 0.2, 0.0], mine.client.camera)
    tab.mouse.move(x, y)
    tab.wait_for_timeout(500)
    tab.mouse.down()
    for step in range(12):
        tab.mouse.move(x, y - 4 * step)
        tab.wait_for_timeout(30)
    tab.mouse.up()
    _until(lambda: any(isinstance(one, MoveKeypoint) for one in mine.session.gestures))
    tab.wait_for_timeout(1500)
    before, after = mine.session.start, mine.state
    assert after.shape.keypoints[keypoint, 1] > before.shape.keypoints[keypoint, 1] + 0.02
    assert keypoint in after.pins
    _picture(tab, "drag")
    other = browser.new_page()
    other.goto(studio.url)
    other.get_by_text("Scan to result").wait_for(timeout=LONG)
    assert other.get_by_text("corrected by hand").count() == 0
    assert [tab.page.session.gestures for tab in studio.tabs if tab.page is not mine] == [()]
    other.close()
    _until(lambda: len(studio.tabs) == 1)
    while mine.session.can_undo:
        count = len(mine.session.gestures)
        tab.get_by_role("button", name="Undo").click()
        _until(lambda count=count: len(mine.session.gestures) < count)
    assert mine.state is before


def test_models_turns_and_errors(tab: Any, studio: Studio) -> None:
    page = _page(studio)
    tab.get_by_role("button", name="3", exact=True).click()
    _until(lambda: [type(one) for one in page.session.gestures] == [ChooseModel])
    chosen = page.state.candidates[2].model_id
    tab.get_by_text(chosen.split("_")[-1]).first.wait_for()
    tab.get_by_role("button", name="180°").click()
    _until(lambda: isinstance(page.session.gestures[-1], Turn))
    tab.get_by_role("button", name="Undo").click()
    _until(lambda: len(page.session.gestures) == 1)
    # The box is not shown: an error, in one sentence.
    tab.get_by_role("button", name="Crop the scan").click()
    tab.get_by_text("Show the box first").wait_for()
    tab.get_by_label("Box of a crop").check(force=True)
    _until(lambda: page.fit.box is not None)
    _picture(tab, "crop")
    tab.get_by_role("button", name="Crop the scan").click()
    _until(lambda: isinstance(page.session.gestures[-1], Crop))
    # The box holds the whole scan, so that nothing is cut off.
    assert len(page.state.points) == len(page.session.start.points)


def _choose(tab: Any, label: str, option: str) -> None:
    tab.get_by_label(label, exact=True).first.click()
    tab.get_by_role("option", name=option, exact=True).click()


def test_category_up_unit_deform_and_pins_are_chosen(tab: Any, studio: Studio) -> None:
    page = _page(studio)
    for label, option, kind in (
        ("Unit of the scan", "cm", ChooseUnit),
        ("Deform", "scale", ChooseDeform),
        ("Category", "chair", ChooseCategory),
        ("Up axis", "y", ChooseUp),
    ):
        _choose(tab, label, option)
        _until(lambda kind=kind: bool(page.session.gestures) and type(page.session.gestures[-1]) is kind)
    assert (page.state.options.unit, page.state.options.deform, page.state.options.up) == ("cm", "scale", "y")
    assert page.state.context.categories == ("chair",)
    tab.get_by_role("tab", name="Shape").click()
    _choose(tab, "Keypoint", "3")
    _until(lambda: page.keypoint == 3)
    tab.get_by_label("Mirror lock").check(force=True)
    _choose(tab, "Axis lock", "y (height)")
    _until(lambda: page.shape.mirror and page.shape.axis == "y")
    for pinned in (True, False):
        _set(tab, "Pinned", pinned, lambda pinned=pinned: page.session.gestures[-1] == PinKeypoint(3, pinned))
    _picture(tab, "choices")
    while page.session.can_undo:
        count = len(page.session.gestures)
        tab.get_by_role("button", name="Undo").click()
        _until(lambda count=count: len(page.session.gestures) < count)
    tab.get_by_role("button", name="Redo").click()
    _until(lambda: [type(one) for one in page.session.gestures] == [ChooseUnit])


def test_sizes_and_refitting(tab: Any, studio: Studio) -> None:
    page = _page(studio)
    tab.get_by_role("tab", name="Shape").click()
    field = tab.get_by_label("Height, cm")
    field.fill("95")
    field.press("Enter")
    tab.get_by_role("button", name="Set the sizes").click()
    _until(lambda: any(isinstance(one, SetSize) for one in page.session.gestures))
    assert page.state.part_sizes(-1)[1] == pytest.approx(0.95, abs=0.01)
    _picture(tab, "sizes")
    tab.get_by_role("button", name="Refit the rest").click()
    _until(lambda: isinstance(page.session.gestures[-1], RefitRest))
    assert page.state.part_sizes(-1)[1] == pytest.approx(0.95, abs=0.02)


def test_results_and_records_are_downloads(tab: Any, studio: Studio, tmp_path: Path) -> None:
    tab.get_by_role("tab", name="Save").click()
    for button, name in ((".stl", "chair_scan.stl"), ("Record of the session", "chair_scan.studio.json")):
        with tab.expect_download() as waiting:
            tab.get_by_role("button", name=re.compile(re.escape(button))).first.click()
        assert waiting.value.suggested_filename == name
        waiting.value.save_as(tmp_path / name)
    assert (tmp_path / "chair_scan.stl").stat().st_size > 1000
    assert json.loads((tmp_path / "chair_scan.studio.json").read_text())["studio"] == 1
    _picture(tab, "save")


def test_a_scan_is_sent_from_the_browser(tab: Any, studio: Studio, tmp_path: Path) -> None:
    before = _page(studio)
    rng = np.random.default_rng(0)
    table = np.concatenate(
        [np.column_stack([rng.uniform(-0.6, 0.6, 900), np.full(900, 0.75), rng.uniform(-0.4, 0.4, 900)])]
        + [
            np.column_stack([np.full(100, x), rng.uniform(0, 0.75, 100), np.full(100, z)])
            for x in (-0.55, 0.55)
            for z in (-0.35, 0.35)
        ]
    )
    np.savetxt(tmp_path / "my table.xyz", table)
    (tmp_path / "no scan.pdf").write_bytes(b"%PDF")
    for name in ("no scan.pdf", "my table.xyz"):
        with tab.expect_file_chooser() as waiting:
            tab.get_by_role("button", name="Open another scan").click()
        waiting.value.set_files(tmp_path / name)
        if name == "no scan.pdf":
            tab.get_by_text("cannot be sent").wait_for()
            assert _page(studio) is before
    _until(lambda: _page(studio) is not before)
    tab.get_by_text("Scan to result").wait_for()
    after = _page(studio)
    assert after.name == "my_table.xyz" and len(after.state.points) == len(table)
    assert before.session.gestures == ()
    _picture(tab, "upload")


def test_a_room_is_corrected_object_by_object(browser: Any, room: RoomSession, tmp_path: Path) -> None:
    running = Studio(room_tabs(room), port=0)
    try:
        context = browser.new_context(viewport={"width": 1200, "height": 820})
        tab = context.new_page()
        tab.set_default_timeout(LONG)
        tab.goto(running.url)
        tab.get_by_text("2 objects fitted").wait_for()
        _picture(tab, "room")
        first, second = room.objects
        mine = running.tabs[-1].room
        tab.get_by_role("button", name=re.compile(f"^{re.escape(first)} ")).click()
        tab.get_by_text("Scan to result").wait_for()
        tab.get_by_role("button", name="180°").click()
        _until(lambda: [type(one) for one in mine.session(first).gestures] == [Turn])
        _picture(tab, "room_object")
        tab.get_by_role("button", name="Back to the room").click()
        tab.get_by_text("corrected", exact=False).first.wait_for()
        # The other one is clicked in the picture, and left out.
        view = running.tabs[-1].page._view
        item = mine.items()[1]
        tab.wait_for_timeout(3000)
        camera = running.tabs[-1].client.camera
        faces = view.place(item.fit.mesh.triangles_center)
        # Of the top, a face in front: the name hovers over the middle.
        top = faces[faces[:, 1] > faces[:, 1].max() - 0.02]
        x, y = _screen(tab, top[np.linalg.norm(top - camera.position, axis=1).argmin()], camera)
        tab.mouse.move(x, y)
        tab.wait_for_timeout(500)
        _picture(tab, "room_corrected")
        tab.mouse.click(x, y)
        tab.get_by_label("In the room").uncheck(force=True)
        _until(lambda: mine.left_out == {second})
        tab.get_by_role("button", name="Back to the room").click()
        tab.get_by_text("1 left out").wait_for()
        tab.get_by_role("tab", name="Save").click()
        for button, name in (("The room", "room.glb"), ("Record of the session", "room.studio.json")):
            with tab.expect_download() as waiting:
                tab.get_by_role("button", name=re.compile(re.escape(button))).first.click()
            assert waiting.value.suggested_filename == name
            waiting.value.save_as(tmp_path / name)
        assert json.loads((tmp_path / "room.studio.json").read_text())["left_out"] == [second]
        _picture(tab, "room_save")
        context.close()
        assert not room.left_out, "the tab has a session of its own"
    finally:
        running.stop()
