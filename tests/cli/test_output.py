"""What goes to standard output and what does not."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from kpred.cli.output import Output, plain


@dataclass
class Fact:
    name: str
    values: np.ndarray


def test_plain_takes_arrays_tensors_paths_and_dataclasses() -> None:
    value = {"fact": Fact("a", np.arange(3)), 1: torch.ones(2), "path": Path("a/b"), "bad": float("nan")}
    assert plain(value) == {"fact": {"name": "a", "values": [0, 1, 2]}, "1": [1.0, 1.0], "path": "a/b", "bad": None}
    assert plain(np.float32(0.5)) == 0.5
    with pytest.raises(TypeError, match="object"):
        plain(object())


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


@given(json_values)
def test_plain_leaves_json_as_it_is(value: object) -> None:
    assert plain(value) == value
    json.dumps(plain(value), allow_nan=False)


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
