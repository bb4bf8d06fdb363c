"""The chosen model is put back where the scan is."""

import numpy as np
import pytest

import kpred
from kpred.errors import DatabaseError
from kpred.fitting import placed
from kpred.fitting.defaults import sample_scan


def test_a_mesh_that_is_not_finite_once_deformed_is_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    right = placed.place_points

    def broken(*arguments: object) -> tuple[np.ndarray, np.ndarray]:
        vertices, keypoints = right(*arguments)  # type: ignore[arg-type]
        vertices[3, 1] = np.nan
        return vertices, keypoints

    monkeypatch.setattr(placed, "place_points", broken)
    with pytest.raises(DatabaseError, match="is damaged .its deformed mesh is not finite.; add it again"):
        kpred.fit(sample_scan(), up="y")
