"""Tables: the values are those of `evaluate`, they survive the file, and all models have the same targets."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ConfigError, OutputError, PackError
from kpred.evaluation.database_source import content_hash, database_source
from kpred.evaluation.methods.kp_red import KpRedMethod
from kpred.evaluation.methods.method import FEED_FORWARD, Query
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.methods.whole_fit import WholeFitMethod
from kpred.evaluation.metrics.metric import CD
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.tables.compare import compare
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import make_table
from kpred.evaluation.tables.scorer import measure
from kpred.evaluation.tables.table import ALL, Series, Subject, Table, merged, read_table, write_table
from kpred.evaluation.tables.target_lists import read_target_list
from kpred.evaluation.tables.targets import read_targets
from kpred.fitting import RefineConfig, fit
from kpred.nn import Model
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.training.run import new_network

CONFIG = TableConfig("full", top_k=(4,))


@pytest.fixture(scope="module")
def other(model: Model) -> Model:
    """The same architecture with other weights."""
    networks = {name: new_network(network.config, seed=1).eval() for name, network in model.items()}
    return Model("other", networks)


@pytest.fixture(scope="module")
def table(packs: dict[str, Path], model: Model, other: Model, tmp_path_factory: pytest.TempPathFactory) -> Table:
    cache = tmp_path_factory.mktemp("cache")
    return make_table(list(packs.values()), {"one": model, "two": other}, CONFIG, cache=cache)


def _series(table: Table, model: str, method: str) -> Series:
    return next(one for one in table.values if (one.model, one.method, one.metric.name) == (model, method, CD))


def test_a_cell_is_the_mean_of_its_targets_in_its_interval(table: Table) -> None:
    for series in table.values:
        values = [value for subject, value in table.values[series].items() if subject.category == "chair"]
        cell = table.cell(series, "generated", "chair")
        assert cell is not None
        assert (cell.value, cell.n) == (pytest.approx(np.mean(values)), len(values))
        assert cell.percentile_95 == pytest.approx(np.percentile(values, 95))
        if cell.low is not None and cell.high is not None:
            assert cell.low <= cell.value <= cell.high


def test_both_models_have_the_targets_of_the_baselines(table: Table) -> None:
    targets = set(table.subjects())
    assert len(targets) == 6
    assert all(set(values) == targets for one, values in table.values.items() if one.metric.name != "mirror")
    assert {one.model for one in table.values} == {"", "one", "two"}
    assert {one.method for one in table.values if one.model == "one"} == {
        one.method for one in table.values if one.model == "two"
    }


def test_a_table_survives_its_file(table: Table, tmp_path: Path) -> None:
    files = write_table(table, tmp_path / "full.json")
    again = read_table(files[0])
    assert again.values == table.values
    assert again.header == json.loads(json.dumps(table.header))
    assert again.to_json() == table.to_json()
    with open(files[2], newline="") as stream:
        lines = list(csv.DictReader(stream))
    assert len(lines) == sum(map(len, table.values.values()))
    first = lines[0]
    subject = Subject(first["dataset"], first["category"], first["model_id"])
    series = next(one for one in table.values if one.method == first["method"])
    assert float(first["value"]) == table.values[series][subject]
    with open(files[1], newline="") as stream:
        assert len(list(csv.DictReader(stream))) == len(list(table.cells()))


def test_the_header_says_how_to_make_it_again(table: Table, packs: dict[str, Path], model: Model) -> None:
    header = table.header
    assert header["protocol"]["top_k"] == [4]
    assert header["data"][0]["sha256"] == content_hash(packs["chair"])
    assert header["models"]["one"]["fingerprints"] == {name: net.fingerprint() for name, net in model.items()}
    assert header["models"]["one"]["settings"]["chair"]["width"] == 16
    assert "torch" in header["versions"]


def test_a_kept_database_gives_the_same_values_and_is_not_built_again(
    packs: dict[str, Path], model: Model, tmp_path: Path
) -> None:
    config = replace(CONFIG, limit=1)
    first = make_table([packs["chair"]], {"m": model}, config, cache=tmp_path)
    (file,) = tmp_path.iterdir()
    written = file.stat().st_mtime_ns
    assert make_table([packs["chair"]], {"m": model}, config, cache=tmp_path).values == first.values
    assert file.stat().st_mtime_ns == written
    make_table([packs["chair"]], {"m": model}, replace(config, seed=1), cache=tmp_path)
    assert len(list(tmp_path.iterdir())) == 2


def test_fits_are_measured_on_their_meshes_in_the_true_box(packs: dict[str, Path], model: Model) -> None:
    target = read_targets(MeshPack.load(packs["chair"]), "p", "val", 1, 0, pytest.fail)[0]
    cloud = target.visible(0.5)
    query = Query(target.model_id, cloud, True, (4,))
    with database_source([packs["chair"]], model, None, 0, None, pytest.fail) as store:
        method = WholeFitMethod("m", model, 0, RefineConfig(), StructureConfig(), pytest.fail)
        searcher = method.over(Sources.of_databases("chair", {"m": model}, {"m": store}))
        found = fit(cloud.numpy(), model, store, "chair", 4, "known", partial=True, clean=False)
        values = {
            (prediction.method, metric.surface): value
            for prediction in searcher.predict(query)
            for metric, value in measure(prediction, query, target)
        }
    assert set(values) == {(f"fit_{frame}_frame", end) for frame in ("known", "unknown") for end in ("seen", "whole")}
    surface = Surface(found.mesh)
    seen, whole = (float((surface.distances(points.numpy()) ** 2).mean()) for points in (cloud, target.points))
    # 2048 points stand for the surface, so that the distance is a little larger.
    assert seen < values["fit_known_frame", "seen"] < seen + 0.005
    assert whole < values["fit_known_frame", "whole"] < whole + 0.005
    # In the wrong frame it would be metres away.
    assert values["fit_unknown_frame", "seen"] < 0.5


def test_all_means_every_category(table: Table) -> None:
    series = _series(table, "", "sampling_floor")
    values = list(table.values[series].values())
    cell = table.cell(series, "generated", ALL)
    assert cell is not None
    assert cell.value == pytest.approx(np.mean(values))
    lacking = Table(table.header, {**table.values})
    only_chairs = {subject: value for subject, value in table.values[series].items() if subject.category == "chair"}
    lacking.values[series] = only_chairs
    assert lacking.cell(series, "generated", ALL) is None
    assert merged([lacking], {}).values == lacking.values


@pytest.mark.parametrize("text", ["", "{", "[]", '{"version": 1}', '{"version": 9}', '{"header": {}, "rows": []}'])
def test_what_is_no_table_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "rows.json"
    file.write_text(text)
    with pytest.raises(PackError, match="rows.json"):
        read_table(file)


def test_impossible_arguments(packs: dict[str, Path], model: Model, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="at least one model"):
        make_table([packs["chair"]], {}, CONFIG)
    with pytest.raises(OutputError, match="tables are .json"):
        write_table(Table({}), tmp_path / "table.txt")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="Cannot make the folder"):
        make_table([packs["chair"]], {"m": model}, CONFIG, cache=tmp_path / "file" / "cache")


def test_targets_can_be_named_and_names_that_are_not_there_are_counted(
    packs: dict[str, Path], model: Model, table: Table, tmp_path: Path
) -> None:
    chosen = [subject for subject in table.subjects() if subject.category == "chair"][:2]
    lines = ["synsetId,modelId,split", *(f"1,{one.model_id},val" for one in chosen), "1,gone,val", "1,other,train"]
    (tmp_path / "split.csv").write_text("\n".join(lines))
    only = read_target_list(tmp_path / "split.csv", "val")
    assert only == {*(one.model_id for one in chosen), "gone"}
    told: list[str] = []
    config = replace(CONFIG, only=only)
    # No table is named: its pack is left out.
    found = make_table(list(packs.values()), {"one": model}, config, report=told.append)
    assert told == ["1 of 3 named targets are in no pack's 'val': gone."]
    assert found.subjects() == chosen
    for series in found.values:
        assert found.values[series] == pytest.approx(
            {one: table.values[series][one] for one in chosen}, rel=1e-6, abs=1e-9
        )
    (file, *_) = write_table(found, tmp_path / "table.json")
    assert read_target_list(file, "val") == {one.model_id for one in chosen}
    (tmp_path / "ids.txt").write_text(f"# two\n{chosen[0].model_id}\n\n{chosen[1].model_id}\n")
    assert read_target_list(tmp_path / "ids.txt", "val") == {one.model_id for one in chosen}
    with pytest.raises(PackError, match="None of the 1 named targets"):
        make_table([packs["chair"]], {"one": model}, replace(CONFIG, only=frozenset({"gone"})), report=told.append)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "synset,model\n1,2\n", "no column modelId; its columns are synset, model"),
        ("a.csv", "modelId,split\n1,train\n", "names no target of the split 'val'"),
        ("a.txt", "\n# nothing\n", "names no target"),
        ("a.json", "{}", "not a table"),
    ],
)
def test_lists_that_name_no_targets(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(PackError, match=words):
        read_target_list(tmp_path / name, "val")
    with pytest.raises(PackError, match="cannot be read"):
        read_target_list(tmp_path / f"none_{name}", "val")


def test_corrupt_meshes_are_left_out_counted_and_told_once(
    packs: dict[str, Path], model: Model, table: Table, tmp_path: Path
) -> None:
    pack = MeshPack.load(packs["chair"])
    flat = Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32), "flat")
    meshes, splits = [*pack, flat, flat], [*pack.split.tolist(), "source", "val"]
    ids = [*pack.model_id.tolist(), "flat_source", "flat_val"]
    MeshPack.from_meshes(meshes, ids, splits, "chair").save(tmp_path / "chair.npz")
    told: list[str] = []
    found = make_table([tmp_path / "chair.npz"], {"a": model, "b": model}, CONFIG, report=told.append)
    assert sorted("flat_source" in sentence for sentence in told) == [False, True]
    assert found.header["remarks"] == told
    assert len(found.subjects()) == 3
    chairs = {one.model_id: value for one, value in table.values[_series(table, "one", "refined")].items()}
    for subject, value in found.values[_series(found, "a", "refined")].items():
        assert value == pytest.approx(chairs[subject.model_id], rel=1e-6)


def test_other_methods_stand_in_the_table_on_its_targets(packs: dict[str, Path], model: Model, table: Table) -> None:
    only = frozenset(subject.model_id for subject in table.subjects()[:2])
    config = replace(CONFIG, only=only)
    # It is the same network, as another method, over a database of its own.
    mine = make_table([packs["chair"]], {"one": model}, config, methods=[KpRedMethod("peer", model)])
    peer = _series(mine, "peer", FEED_FORWARD)
    assert mine.values[peer] == pytest.approx(mine.values[replace(peer, model="one")], rel=1e-5)
    assert set(mine.subjects()) == set(mine.values[peer])
    assert set(mine.header["models"]) == {"one", "peer"}
    assert mine.header["database_models"] == {"generated/chair": 9}
    (row, *_) = compare(mine, mine, "one", "peer")
    assert row.ratio == pytest.approx(1, rel=1e-5)
    with pytest.raises(ConfigError, match="named one; name them apart"):
        make_table([packs["chair"]], {"one": model}, config, methods=[KpRedMethod("one", model)])


def test_a_table_of_version_1_is_read(tmp_path: Path) -> None:
    common = {"model": "m", "protocol": "partial", "occlusion": 0.5, "top_k": 10, "values": [0.25]}
    cd, ucd = "chamfer_distance", "unilateral_chamfer_distance"
    series = [
        {**common, "method": "refined", "distance": ucd, "unit": "unit box squared"},
        {**common, "method": "refined_whole", "distance": f"{ucd}_of_whole_surface", "unit": "unit box squared"},
        {**common, "method": "refined", "distance": "squareness", "unit": "degrees"},
        {**common, "method": "true_best_in_top_by_tokens", "distance": cd, "unit": "share"},
    ]
    target = {"dataset": "d", "category": "chair", "model_id": "s"}
    content = {"version": 1, "header": {"seed": 0}, "rows": [], "targets": [target], "series": series}
    (tmp_path / "old.json").write_text(json.dumps(content))
    found = read_table(tmp_path / "old.json")
    assert [(one.method, one.metric.name, one.metric.surface, one.metric.unit) for one in found.values] == [
        ("refined", ucd, "seen", "unit box squared"),
        ("refined", ucd, "whole", "unit box squared"),
        ("refined", "squareness", "mesh", "degrees"),
        ("tokens", "true_best_in_top", "seen", "fraction"),
    ]
    assert all(values == {Subject("d", "chair", "s"): 0.25} for values in found.values.values())
