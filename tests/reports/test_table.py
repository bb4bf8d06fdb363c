"""Tables of reports: cells are escaped, and rows are sorted by what they hold, not by how it is written."""

from typing import Any

from kpred.reports.page import page
from kpred.reports.table import Html, facts, meter, sortable


def test_facts_leave_out_what_is_unknown() -> None:
    text = facts([("a", "<b>"), ("none", None), ("empty", ""), ("zero", 0)])
    assert "&lt;b&gt;" in text and "none" not in text and "empty" not in text and ">0<" in text
    assert facts([]) == ""


def test_a_meter_stays_within_its_frame() -> None:
    assert "width:100%" in meter(1.7).content and "width:0%" in meter(-1.0).content
    assert [kind in meter(value).content for value, kind in ((0.9, "good"), (0.6, "fair"), (0.1, "poor"))] == [True] * 3


def test_a_click_sorts_by_size_and_a_third_restores(browser: Any) -> None:
    rows = [["b", 10, Html("<i></i>", 0.5)], ["a", 9, Html("<i></i>", 0.75)], ["c", None, Html("<i></i>", 0.1)]]
    tab = browser.new_page()
    tab.set_content(page("t", [sortable(("name", "size", "mark"), rows)], ["sort.js"]))
    head = {name: tab.locator("th", has_text=name) for name in ("name", "size", "mark")}

    def names() -> list[str]:
        return tab.locator("tbody tr td:first-child").all_inner_texts()

    for name, orders in {"size": ("abc", "bac", "bac"), "name": ("abc", "cba", "bac"), "mark": ("cba", "abc")}.items():
        for order in orders:
            head[name].click()
            assert "".join(names()) == order, name
    tab.close()
