"""Building on a Ray cluster of this machine: the same database, whoever dies on the way."""

import os
import signal

import pytest
import torch

from kpred.database import Database, build_database
from kpred.errors import ConfigError
from kpred.nn import KPRed, Model, ModelConfig, save_network
from kpred.synthetic.generator import generate

pytest.importorskip("ray", reason="Ray is not installed: pip install 'kpred[ray]'")


@pytest.fixture(scope="module")
def model():
    torch.manual_seed(0)
    config = ModelConfig("table", token_size=8, width=16, stages=1, region_points=8)
    return Model("small", {"table": KPRed(config).eval().requires_grad_(False)})


@pytest.fixture(scope="module")
def shapes():
    pack = generate("table", 5, seed=1, splits=False)
    return [(str(pack.model_id[i]), "table", "source", pack[i]) for i in range(5)]


@pytest.mark.slow
def test_the_same_database_although_a_worker_is_killed(tmp_path, model, shapes, assert_same):
    from kpred.batch.ray_encoder import RayEncoder

    build_database(tmp_path / "here.kpred", shapes, model, batch=2)
    # Begun here, gone on with there.
    build_database(tmp_path / "there.kpred", shapes[:2], model, batch=2)
    encoder = RayEncoder(model, "local", 1)
    killed = []

    def kill_once(handled):
        if handled >= 2 and not killed:
            killed.extend(encoder.workers())
            os.kill(killed[0], signal.SIGKILL)

    try:
        report = build_database(tmp_path / "there.kpred", shapes, model, batch=2, progress=kill_once, encoder=encoder)
    finally:
        encoder.close()
    assert killed
    assert (report.added, report.skipped_present, report.failed) == (3, 2, [])
    with Database.open(tmp_path / "here.kpred") as a, Database.open(tmp_path / "there.kpred") as b:
        assert a.model_ids() == b.model_ids()
        for name in a.model_ids():
            assert_same(a.entry(name), b.entry(name))


def test_what_kills_its_worker_every_time_is_listed_and_the_rest_is_built(tmp_path, model, shapes):
    """The cluster is a stand-in: what counts is who is tried how often."""
    from kpred.batch.ray_encoder import ATTEMPTS, RayEncoder
    from kpred.database.encode import encode_prepared

    class Dead(Exception):
        pass

    class Errors:
        RayError = Dead

        class RayTaskError(Dead):
            pass

    tried: list[list[str]] = []

    class Cluster:
        exceptions = Errors

        @staticmethod
        def get(batch):
            names = [item.model_id for item, _ in batch]
            tried.append(names)
            if shapes[1][0] in names:
                raise Dead
            return encode_prepared([item for item, _ in batch], model["table"], [meta for _, meta in batch])

    encoder = RayEncoder.__new__(RayEncoder)
    encoder._cluster = type("C", (), {"ray": Cluster})()
    encoder._submit = encoder._resubmit = lambda category, batch: batch
    encoder.max_pending = 2
    report = build_database(tmp_path / "a.kpred", shapes[:4], model, batch=2, encoder=encoder)
    assert report.added == 3
    assert report.failed == [(shapes[1][0], "the process that encoded it died")]
    assert tried.count([shapes[1][0]]) == ATTEMPTS
    assert max(map(len, tried)) == 2


def test_shares_of_gpus_that_cannot_be_given_are_refused(model):
    from kpred.batch.ray_cluster import RayCluster, _holders, check_gpus

    for share in (-1.0, 1.5, float("nan")):
        with pytest.raises(ConfigError, match="fraction of one GPU"):
            check_gpus(share)
    assert [_holders(2.0, share) for share in (0.25, 0.4, 0.1, 1.0, 2.0, 3.0)] == [8, 4, 20, 2, 1, 0]
    with pytest.raises(ConfigError, match="No Ray cluster"):
        RayCluster("auto", 1)


@pytest.mark.slow
def test_a_cluster_without_gpus_is_told(model):
    from kpred.batch.ray_encoder import RayEncoder

    if torch.cuda.is_available():
        pytest.skip("this machine has a GPU")
    with pytest.raises(ConfigError, match="too few for 1 workers of 0.25"):
        RayEncoder(model, "local", 1, gpus=0.25)


def test_the_command_asks_for_what_belongs_together(tmp_path, model, capsys):
    from kpred.cli.main import USAGE, main

    save_network(model["table"], tmp_path / "model")
    generate("table", 2, seed=1, splits=False).save(tmp_path / "table.npz")
    line = ["database", "build", str(tmp_path / "table.npz"), "-o", str(tmp_path / "a.kpred")]
    assert main([*line, "--gpus-per-worker", "0.5"]) == USAGE
    assert "--ray" in capsys.readouterr().err
    assert main([*line, "--ray", "local", "--workers", "0"]) == USAGE
    assert not (tmp_path / "a.kpred").exists()
