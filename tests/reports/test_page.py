"""The frame of reports: nothing from elsewhere, only its own scripts run, and names are no markup."""

import base64
import hashlib
import re
from pathlib import Path

import pytest

from kpred.errors import OutputError
from kpred.reports.page import check_report, page, save_report, section, tag, text_of, warning_list

HOSTILE = "\"><script>alert(1)</script>\udce9\x1b[31m'&\u202e"


def test_names_are_no_markup_and_always_unicode() -> None:
    shown = text_of(HOSTILE)
    assert not re.search(r"[<>\"']", shown) and "&lt;script&gt;" in shown
    shown.encode("utf-8")
    assert "\x1b" not in shown and "\u202e" not in shown
    assert HOSTILE not in tag("p", "x", title=HOSTILE)
    assert tag("p", "", data_key=HOSTILE).count('"') == 2


def test_a_page_loads_nothing_and_runs_its_own_scripts_alone() -> None:
    text = page(HOSTILE, [section("A", "<b>1</b>")], ["sort.js", "viewer.js"])
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
    assert policy is not None and "default-src 'none'" in policy[1]
    codes = re.findall(r"<script>(.*?)</script>", text, re.S)
    assert len(codes) == 2
    for code in codes:
        assert base64.b64encode(hashlib.sha256(code.encode()).digest()).decode() in policy[1]
    assert "unsafe-inline" not in policy[1].partition("script-src")[2]
    assert not re.search(r"https?:|@import|url\(", text)
    assert "script-src 'none'" in page("a", [])


def test_empty_sections_and_lists_are_left_out() -> None:
    assert section("A", "", "") == "" and warning_list([]) == ""
    assert warning_list(["a < b"]) == '<ul class="warnings"><li>a &lt; b</li></ul>'


def test_reports_are_html_files_in_folders_that_exist(tmp_path: Path) -> None:
    save_report(tmp_path / "a.HTML", page("a", []))
    assert (tmp_path / "a.HTML").read_text().startswith("<!doctype html>")
    with pytest.raises(OutputError, match=r"reports are \.html files"):
        check_report(tmp_path / "a.pdf")
    with pytest.raises(OutputError, match="does not exist"):
        check_report(tmp_path / "none" / "a.html")
