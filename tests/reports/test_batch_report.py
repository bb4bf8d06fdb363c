"""The report of a batch: failures first, then the least certain; broken lines and missing files do no harm."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

import kpred
from kpred.reports.batch_report import batch_report
from kpred.reports.batch_tile import HEIGHT, draw_result


@pytest.fixture
def folder(fit: kpred.Fit, tmp_path: Path) -> Path:
    """The output folder of a batch of the same scan, and a folder of scans beside it."""
    out, scans = tmp_path / "out", tmp_path / "scans"
    out.mkdir()
    scans.mkdir()
    trimesh.PointCloud(fit.points).export(scans / "<late>.ply")
    rows = []
    for name, suffix, confidence in (("sure", ".glb", 0.9), ("doubtful", ".ply", 0.2), ("bare", "", 0.5)):
        row = {"name": name, "model_id": "<b>", "category": "chair", "step": "none", "confidence": confidence}
        row |= {"error": 0.01, "warnings": 1, "record": f"{name}.json", "mesh": f"{name}{suffix}" if suffix else None}
        rows.append(row)
        if suffix:
            fit.save(out / f"{name}{suffix}")
        (out / f"{name}.json").write_text(json.dumps({**fit.record(), "scan": str(kpred.sample_scan())}))
    lines = "".join(json.dumps(row) + "\n" for row in rows)
    (out / "results.jsonl").write_text(lines + '[]\n{"name": "gone", "record": "../../x.json"}\n{"name": "ha')
    (out / "failures.jsonl").write_text(json.dumps({"name": "<late>.ply", "problem": "<late>.ply: too slow."}) + "\n")
    return out


def test_failures_and_doubtful_results_come_first(folder: Path) -> None:
    text = batch_report(folder, folder.parent / "scans")
    assert re.findall(r'<tr[^>]*><td data-key="([^"]+)"', text) == [
        "&lt;late&gt;.ply",
        "gone",
        "doubtful",
        "bare",
        "sure",
    ]
    assert "4 scans have a CAD model, 1 failed." in text
    assert "<late>" not in text and "<b>&lt;late&gt;" in text
    assert text.count("<img") == 4  # of all but the one whose record is gone


def test_a_glb_is_drawn_where_the_scan_is(folder: Path) -> None:
    rows = {row["name"]: row for row in map(json.loads, (folder / "results.jsonl").read_text().splitlines()[:3])}
    glb, ply, bare = (draw_result(rows[name], folder) for name in ("sure", "doubtful", "bare"))
    assert glb.shape == (HEIGHT, 3 * HEIGHT, 3) and bare.shape == (HEIGHT, HEIGHT, 3)
    assert (np.abs(glb.astype(int) - ply) > 40).mean() < 0.001


def test_large_batches_are_cut(folder: Path) -> None:
    steps: list[tuple[int, int]] = []
    seen = lambda done, total: steps.append((done, total))  # noqa: E731
    text = batch_report(folder, progress=seen, max_rows=2, max_pictures=2)
    assert text.count("<tr") == 3 and "The table lists 2 of them" in text and steps == [(0, 2), (1, 2)]
