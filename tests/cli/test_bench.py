"""`kpred bench`: every figure with its baseline, its machine and its load; nothing is left behind."""

import json

import pytest

from kpred.cli.main import USAGE, main


def test_figures_are_printed_and_written(tmp_path, run_json):
    out, plot, work = tmp_path / "bench.json", tmp_path / "scaling.png", tmp_path / "work"
    options = ("--only", "start", "search", "--sizes", 300, 150, "--threads", 1, "--work", work)
    record = run_json("bench", *options, "-o", out, "--plot", plot)
    assert json.loads(out.read_text()) == record
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert [point["models"] for point in record["scaling"]] == [150, 300]
    for figure in record["figures"]:
        assert figure["value"] > 0
        assert figure["best"] <= figure["value"]
        assert figure["baseline_value"] > 0
        assert figure["gain"] == pytest.approx(figure["baseline_value"] / figure["value"])
        assert figure["met"] is (None if figure["limit"] is None else figure["value"] <= figure["limit"])
    assert {"processor", "cores", "threads", "load_before", "load_after", "torch"} <= set(record["machine"])
    assert list(work.iterdir()) == []


def test_figures_of_a_device_stand_for_themselves(run_json, monkeypatch):
    from kpred.bench import device
    from kpred.bench.traffic import Cost, Peaks

    def figures(where, sizes, tell):
        assert (where.type, sizes.batch, sizes.models) == ("cpu", 4, 9)
        tell("one")
        return Peaks(1.0, 1.0, 1.0), [device.Rate("fit", 10.0, 0.4, 0.3, "fits", Cost(1.0, 2.0, 3.0, 4), 0.5, 0.25)]

    monkeypatch.setattr(device, "device_figures", figures)
    words = ("--only", "device", "--device", "cpu", "--batch", 4, "--models", 9)
    record = run_json("bench", *words)
    assert record["figures"] == []
    (figure,) = record["device"]["figures"]
    assert (figure["rate"], figure["cost"]["operations"], figure["memory"]) == (10.0, 4, 0.25)
    assert record["device"]["device"] == "cpu"


def test_options_that_make_no_sense(tmp_path, capsys):
    for words in (["--only", "nothing"], ["--sizes", "0"], ["--batch", "0"], ["--plot", str(tmp_path / "a.txt")]):
        assert main(["bench", *words]) == USAGE
        assert "Traceback" not in capsys.readouterr().err
