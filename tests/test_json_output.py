"""Plain values and the JSON files of them."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from kpred.errors import OutputError
from kpred.json_output import json_text, plain, write_json


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


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"value": float("inf"), "array": np.zeros(2)})
    assert json.loads((tmp_path / "a.json").read_text()) == {"value": None, "array": [0.0, 0.0]}
    with pytest.raises(TypeError):
        write_json(tmp_path / "a.json", {"value": object()})
    assert (tmp_path / "a.json").read_text() == json_text({"value": None, "array": [0.0, 0.0]})
    with pytest.raises(OutputError, match="missing"):
        write_json(tmp_path / "missing" / "a.json", {})
