"""The page of a fit: complete in itself, and safe whatever models and files are called."""

import re
import webbrowser
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import kpred
from kpred.errors import OutputError
from kpred.fitting.object_fit import ObjectFit
from kpred.scenes.objects import SceneObject
from kpred.scenes.scene import Scene


@pytest.fixture(scope="module")
def fit() -> kpred.Fit:
    return kpred.fit(kpred.sample_scan(), category="chair", up="y", top_k=2, deform="none")


def test_notebooks_show_picture_numbers_and_warnings(fit: kpred.Fit) -> None:
    text = replace(fit, warnings=("Look <here> & there.",))._repr_html_()
    assert "data:image/png;base64," in text
    assert fit.source.model_id in text and "Look &lt;here&gt; &amp; there." in text
    assert not re.search(r"(src|href)=\"(?!data:)", text)


def test_names_of_models_are_no_html(fit: kpred.Fit) -> None:
    source = replace(fit.source, model_id="<script>alert(1)</script>")
    text = replace(fit, source=source, candidates=(source,))._repr_html_()
    assert "<script" not in text and "&lt;script&gt;" in text


def test_show_writes_a_page_and_opens_it(fit: kpred.Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda place: opened.append(place) or True)
    file = fit.show(tmp_path / "a.html")
    assert file == tmp_path / "a.html" and file.read_text().startswith("<!doctype html>")
    temporary = fit.show()
    assert opened == [file.as_uri(), temporary.as_uri()]
    temporary.unlink()
    with pytest.raises(OutputError, match=r"pages are \.html files"):
        fit.show(tmp_path / "a.png")


def test_every_candidate_has_its_mesh(fit: kpred.Fit) -> None:
    assert len(fit.candidates) == 2
    np.testing.assert_array_equal(fit.candidates[0].mesh.vertices, fit.mesh.vertices)
    assert not np.array_equal(fit.candidates[1].mesh.vertices, fit.mesh.vertices)
    np.testing.assert_array_equal(fit.candidate(1).vertices, fit.candidates[1].mesh.vertices)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    rotated = fit.rotated(turn)
    np.testing.assert_allclose(rotated.candidates[1].mesh.vertices, fit.candidates[1].mesh.vertices @ turn.T)
    np.testing.assert_allclose(rotated.points, fit.points @ turn.T)


def test_rooms_are_shown_like_fits(fit: kpred.Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scan = SceneObject("<b>chair</b>", "chair", fit.points, np.arange(len(fit.points)), "y")
    missing = SceneObject("table_1", "table", fit.points, np.arange(len(fit.points)), "y")
    room = kpred.SceneFit(Scene(fit.points, up="y"), (ObjectFit(scan, fit), ObjectFit(missing, error="table_1: no.")))
    text = room._repr_html_()
    assert "data:image/png;base64," in text and fit.source.model_id in text
    assert "&lt;b&gt;chair" in text and "<b>" not in text and "table_1: no." in text
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda place: opened.append(place) or True)
    file = room.show(tmp_path / "room.html")
    assert opened == [file.as_uri()] and fit.source.model_id in file.read_text()
    with pytest.raises(OutputError):
        room.show(tmp_path / "room.pdf")
