"""What goes to standard output and what does not."""

import json

import pytest

from kpred.cli.output import Output


def test_json_on_standard_output_people_on_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output(as_json=True)
    output.note("for [people]")
    output.table("numbers", ["name", "value"], [("a", 0.123456)])
    output.result({"value": 1})
    printed = capsys.readouterr()
    assert json.loads(printed.out) == {"value": 1}
    assert "for [people]" in printed.err
    assert "0.1235" in printed.err


def test_without_json_people_read_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output(as_json=False)
    output.result({"value": 1})
    output.note("for people")
    printed = capsys.readouterr()
    assert printed.out == "for people\n"
    assert printed.err == ""
