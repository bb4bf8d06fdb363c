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


def test_options_that_make_no_sense(tmp_path, capsys):
    for words in (["--only", "nothing"], ["--sizes", "0"], ["--threads", "0"], ["--plot", str(tmp_path / "a.txt")]):
        assert main(["bench", *words]) == USAGE
        assert "Traceback" not in capsys.readouterr().err
