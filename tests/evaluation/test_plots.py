"""Figures: maps keep neighbours, pictures show what they should, files are written whole and refused early."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from kpred.database import Database
from kpred.errors import ConfigError, DatabaseError, OutputError
from kpred.evaluation.database_source import database_source
from kpred.evaluation.metrics.metric import Metric
from kpred.evaluation.plots.catalogue import COLUMNS, LINE, LINES, THUMBNAIL, catalogue_figure, catalogue_sheet
from kpred.evaluation.plots.figure import check_figure, save_figure
from kpred.evaluation.plots.grid import GridConfig, grid_figure
from kpred.evaluation.plots.keypoints import chosen_entries, influence_figure, keypoints_figure
from kpred.evaluation.plots.occlusion import occlusion_figure
from kpred.evaluation.plots.tokens import spread, token_distances, tokens_figure
from kpred.evaluation.plots.tsne import joint_probabilities, tsne
from kpred.evaluation.plots.views import blank, keypoint_colors, mesh_picture, with_lines, with_points
from kpred.evaluation.tables.table import Series, Subject, Table
from kpred.nn import Model


@pytest.fixture(scope="module")
def database(packs: dict[str, Path], model: Model) -> Iterator[Database]:
    with database_source([packs["chair"]], model, None, 0, None, pytest.fail) as store:
        yield store


def _partial(shift: float = 0.0) -> Table:
    table = Table({"seed": 0})
    rng = np.random.default_rng(0)
    for occlusion in (0.0, 0.5):
        for model, method, surface in (
            ("", "no_learning", "seen"),
            ("m", "refined", "seen"),
            ("m", "refined", "whole"),
        ):
            series = Series(model, method, "partial", occlusion, Metric("ucd", surface, top_k=10))
            for number in range(8):
                category = "chair" if number % 2 else "table"
                table.add(series, Subject("d", category, f"s{number}"), float(rng.random()) + shift + occlusion)
    return table


def test_clusters_stay_together_in_the_map(rng: np.random.Generator) -> None:
    points = np.concatenate([rng.normal(size=(20, 8)) * 0.1 + 5 * np.eye(8)[k] for k in range(3)])
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1)
    places = tsne(distances, perplexity=10.0)
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    np.fill_diagonal(apart, np.inf)
    assert (apart.argmin(axis=1) // 20 == np.arange(60) // 20).all()


def test_probabilities_have_the_perplexity_that_was_asked_for(rng: np.random.Generator) -> None:
    points = rng.normal(size=(40, 3))
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1)
    found = joint_probabilities(distances, 7.0)
    np.testing.assert_allclose(found, found.T)
    assert found.sum() == pytest.approx(1, rel=1e-6)
    np.testing.assert_allclose(joint_probabilities(distances * 1000, 7.0), found, rtol=1e-6)
    # Equal distances: every neighbour counts the same.
    even = joint_probabilities(1 - np.eye(12), 5.0)
    np.testing.assert_allclose(even[~np.eye(12, dtype=bool)], 1 / (12 * 11), rtol=1e-6)


def test_few_points_have_a_map_too() -> None:
    for count in (1, 2, 3, 5):
        assert np.isfinite(tsne(1.0 - np.eye(count), steps=20)).all()


def test_token_distances_are_what_retrieval_goes_by(database: Database) -> None:
    ids = database.model_ids("chair")
    tokens = np.stack([database.entry(name).tokens for name in ids])
    found = database.search("chair", tokens[0], top_k=len(ids))
    mine = dict(zip(ids, token_distances(tokens)[0], strict=True))
    np.testing.assert_allclose([mine[name] for name in found.model_ids], found.distances, rtol=1e-4, atol=1e-5)


def test_pictures_are_spread_over_the_map(rng: np.random.Generator) -> None:
    places = rng.random((200, 2))
    rows = spread(places, 12, 0.1)
    chosen = places[rows]
    gaps = np.linalg.norm(chosen[:, None] - chosen[None], axis=-1) + np.eye(len(rows))
    assert len(set(rows)) == len(rows) <= 12
    assert gaps.min() >= 0.1
    assert spread(places, 0, 0.1) == []
    assert len(spread(np.zeros((5, 2)), 4, 0.1)) == 1


def test_nearer_points_hide_farther_ones_and_nothing_leaves_the_picture() -> None:
    near, far = np.array([0.31, 0.24, 0.5]), np.array([-0.31, -0.24, -0.5])  # along the line of sight
    colors = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for order in ([0, 1], [1, 0]):
        picture = with_points(blank(101), np.stack([near, far])[order], colors[order], 2.0)
        assert picture[50, 50].tolist() == [255, 0, 0]
    outside = with_points(blank(50), np.array([[9.0, 0.0, 0.0]]), np.zeros(3), 3.0)
    assert (outside == 255).all()
    assert (with_lines(blank(50), np.stack([near, -near * 9]), [(0, 1)], np.zeros(3)) < 255).any()
    assert len(np.unique(keypoint_colors(12), axis=0)) == 12


def test_the_unit_box_fits_into_the_picture() -> None:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    faces = np.array([[a, b, c] for a in range(8) for b in range(a) for c in range(b)])
    picture = mesh_picture(corners, faces, 120)
    for edge in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
        assert (edge == 255).all()
    assert (picture < 255).any()


@pytest.mark.parametrize("name", ["figure.png", "figure.pdf"])
def test_every_figure_becomes_the_same_file_again(
    name: str, database: Database, packs: dict[str, Path], model: Model, tmp_path: Path
) -> None:
    drawings = {
        "tokens": lambda: tokens_figure(database, "chair", pictures=3, perplexity=3.0),
        "keypoints": lambda: keypoints_figure(database, "chair", count=3, columns=2),
        "influence": lambda: influence_figure(database, model["chair"], (0, 5), count=1),
        "occlusion": lambda: occlusion_figure([_partial()], ["no_learning", "refined"], whole=False),
    }
    if name.endswith("png"):
        config = GridConfig(count=1, occlusion=0.5, top_k=2)
        drawings["grid"] = lambda: grid_figure([packs["chair"]], {"a": model, "b": model}, config)
    for kind, draw in drawings.items():
        files = [tmp_path / f"{kind}_{number}_{name}" for number in range(1 if kind == "grid" else 2)]
        for file in files:
            check_figure(file)
            save_figure(draw(), file)
        assert len({file.read_bytes() for file in files}) == 1
        if name.endswith("png"):
            picture = np.asarray(Image.open(files[0]).convert("L"))
            assert min(picture.shape) > 200
            assert (picture < 200).mean() > 0.003
        else:
            assert files[0].read_bytes().startswith(b"%PDF")


def test_models_are_chosen_by_seed(database: Database) -> None:
    one, same, other = ([e.model_id for e in chosen_entries(database, "chair", 3, seed)] for seed in (0, 0, 1))
    assert one == same != other
    assert len(chosen_entries(database, "chair", 99, 0)) == 9


def test_curves_pass_through_the_means_of_their_tables() -> None:
    table = _partial()
    figure = occlusion_figure([table], ["refined"], whole=False)
    axes = {ax.get_title(): ax for ax in figure.axes}
    assert set(axes) == {"chair", "table", "all"}
    (line,) = axes["all"].get_lines()
    series = [one for one in table.values if (one.method, one.metric.surface) == ("refined", "seen")]
    wanted = [np.mean(list(table.values[one].values())) for one in series]
    np.testing.assert_allclose(line.get_xydata(), np.column_stack([[0, 50], wanted]))
    whole = occlusion_figure([table], ["refined"], whole=True)
    assert "whole surface" in whole.axes[0].get_ylabel()


def test_refusals(database: Database, model: Model, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"\.png or \.pdf"):
        check_figure(tmp_path / "figure.jpg")
    with pytest.raises(OutputError, match="does not exist"):
        check_figure(tmp_path / "none" / "figure.png")
    with pytest.raises(ConfigError, match="no curves of nothing"):
        occlusion_figure([_partial()], ["nothing"], whole=False)
    with pytest.raises(ConfigError, match="numbered 0 to 11"):
        influence_figure(database, model["chair"], (12,))
    with pytest.raises(ConfigError, match="At least one model"):
        keypoints_figure(database, "chair", count=0)
    with pytest.raises(DatabaseError, match="no models of category 'sofa'"):
        tokens_figure(database, "sofa")


def test_a_catalogue_sheet_has_a_picture_for_each_model_and_its_labels(tmp_path: Path, database: Database) -> None:
    ids = database.model_ids("chair")
    entries = [database.entry(name) for name in ids]
    sheet = np.asarray(catalogue_sheet(entries))
    columns = min(COLUMNS, len(ids))
    assert sheet.shape == (-(-len(ids) // columns) * (THUMBNAIL + LINES * LINE), columns * THUMBNAIL, 3)
    for number in range(len(ids)):
        left, top = number % columns * THUMBNAIL, number // columns * (THUMBNAIL + LINES * LINE)
        for part in (slice(top, top + THUMBNAIL), slice(top + THUMBNAIL, top + THUMBNAIL + LINE)):
            assert (sheet[part, left : left + THUMBNAIL] < 128).any()
    save_figure(catalogue_figure(database, "chair", max_models=2), tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as picture:
        assert picture.size == (2 * THUMBNAIL, THUMBNAIL + LINES * LINE)
    with pytest.raises(DatabaseError, match="sofa"):
        catalogue_figure(database, "sofa")
