"""Models and databases named by a path are kept in memory, as long as the same files are there."""

import gc
import os
import shutil
import weakref
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from kpred.database import Database, build_database
from kpred.errors import DatabaseError, ModelError
from kpred.fitting.defaults import LOADED, bundled_database_path, resolve_database, resolve_model, shared_categories
from kpred.fitting.file_cache import FileCache
from kpred.nn import KPRed, Model, ModelConfig, Recognizer, RecognizerConfig, load_model, save_network
from kpred.nn.config import SHARED
from kpred.synthetic.generator import generate


def network(seed: int) -> KPRed:
    torch.manual_seed(seed)
    return KPRed(ModelConfig(width=16, token_size=8, region_points=16))


def test_the_same_files_are_loaded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_network(network(0), tmp_path / "model")
    Database.create(tmp_path / "one.kpred").close()
    monkeypatch.chdir(tmp_path)
    assert resolve_model("model") is resolve_model("model")
    assert resolve_database("one.kpred") is resolve_database(tmp_path / "one.kpred")
    assert resolve_model(None) is resolve_model(None) and resolve_database(None) is resolve_database(None)
    given = load_model("model")
    assert resolve_model(given) is given


def test_retrained_weights_are_noticed(tmp_path: Path) -> None:
    folder = tmp_path / "model"
    save_network(network(0), folder)
    before = resolve_model(folder)
    save_network(network(1), folder)
    after = resolve_model(folder)
    assert after["chair"].fingerprint() != before["chair"].fingerprint()
    assert resolve_model(folder) is after
    (folder / "calibration.json").write_text("{")
    with pytest.raises(ModelError, match=r"calibration\.json is damaged"):
        resolve_model(folder)


def test_the_same_name_in_another_folder_is_another_thing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for number in (0, 1):
        place = tmp_path / str(number)
        save_network(network(number), place / "model")
        Database.create(place / "one.kpred").close()
        monkeypatch.chdir(place)
        found.append((resolve_model("model"), resolve_database("one.kpred")))
    assert found[0][0]["chair"].fingerprint() != found[1][0]["chair"].fingerprint()
    assert found[0][1] is not found[1][1]


def test_a_database_that_took_the_place_of_another_is_noticed(tmp_path: Path) -> None:
    file = tmp_path / "one.kpred"
    Database.create(file).close()
    assert resolve_database(file).categories() == ()
    shutil.copy(bundled_database_path(), tmp_path / "other.kpred")
    os.replace(tmp_path / "other.kpred", file)
    assert resolve_database(file).categories() == ("cabinet", "chair", "table")
    file.unlink()
    with pytest.raises(DatabaseError, match="does not exist"):
        resolve_database(file)


def test_weights_that_were_checked_are_not_kept_alive(tmp_path: Path) -> None:
    model, database = load_model(), Database.open(bundled_database_path(), read_only=True)
    shared_categories(model, database, None)
    gone = weakref.ref(model), weakref.ref(database)
    del model, database
    gc.collect()
    assert gone[0]() is None and gone[1]() is None


def test_few_models_are_kept() -> None:
    cache: FileCache[object] = FileCache(LOADED)
    first = cache.get("first", 0, object)
    for number in range(LOADED - 1):
        cache.get(number, 0, object)
    assert cache.get("first", 0, object) is first
    cache.get("one more", 0, object)
    assert len(cache) == LOADED
    assert cache.get("first", 0, object) is first
    assert cache.get("first", 1, object) is not first


def test_categories_that_a_recognizer_distinguishes_are_searched_and_others_when_they_are_named(
    untrained: Model, tmp_path: Path
) -> None:
    torch.manual_seed(0)
    anything = KPRed(ModelConfig(category=SHARED, width=16, token_size=8, region_points=16, stages=1)).eval()
    model = replace(untrained, networks={**untrained.networks, SHARED: anything})
    wide = replace(model, shared_recognizer=Recognizer(RecognizerConfig(("chair", "lamp", "table"), width=8)))
    file = tmp_path / "many.kpred"
    shapes = [(f"{name}_{i}", name, "", generate("lamp", 1, i)[0]) for name in ("chair", "lamp", "orb") for i in (0, 1)]
    build_database(file, shapes, model)
    with Database.open(file) as many:
        assert shared_categories(wide, many, None) == ["chair", "lamp"]
        assert shared_categories(wide, many, "orb") == ["orb"]
        assert shared_categories(model, many, None) == ["chair"], "nothing distinguishes the others"
        many.remove([name for name in many.model_ids() if "orb" not in name])
        assert shared_categories(wide, many, None) == shared_categories(model, many, None) == ["orb"]
