"""The report of a fit: complete in itself, safe whatever things are called, with every number of the record."""

import re
from dataclasses import replace

import kpred
from kpred.reports.fit_report import fit_report
from kpred.shapes import read_scan

HOSTILE = "<script>alert(1)</script>"


def test_it_shows_numbers_warnings_and_every_candidate(fit: kpred.Fit) -> None:
    scan = read_scan(kpred.sample_scan())
    text = fit_report(replace(fit, warnings=("Look <here>.",)), scan, "a.ply")
    assert "Look &lt;here&gt;." in text and f"{fit.confidence:.2f}" in text
    assert all(text.count(one.model_id) >= 1 for one in fit.candidates)
    assert text.count("<img") == 1 + len(fit.candidates) and text.count("<canvas") == 1
    assert fit.record()["mesh_sha256"] in text
    assert not re.search(r"(src|href)=\"(?!data:)", text)
    assert len(text) < 1_000_000


def test_names_are_no_html(fit: kpred.Fit) -> None:
    source = replace(fit.source, model_id=HOSTILE)
    text = fit_report(replace(fit, source=source, candidates=(source,)), fit.points, HOSTILE)
    assert HOSTILE not in text and "&lt;script&gt;alert(1)" in text
