"""A scan that may be whole or not, read both ways: the reading whose models explain it better is deformed further."""

from __future__ import annotations

from typing import Any

from kpred.fitting.candidates import Candidates
from kpred.fitting.deform import Deform, deform_candidates
from kpred.fitting.explanation import Deformed
from kpred.fitting.visibility import Visibility, all_seen

WHOLE_GAIN = 1.0
"""Fall of the log error that the reading of a scan as whole must bring, where the networks expect it to lack parts.

Chosen on whole shapes, slices and single views of sa_partnet's split `train` (docs/notes/deformation_trials.md).
"""


def deform_readings(
    candidates: Candidates, whole: Candidates | None, visibility: Visibility, deform: Deform, **settings: Any
) -> Deformed:
    """Deform the candidates of a scan, and, if there are any, those retrieved for it as a whole one; keep the better.

    Args:
        candidates: retrieved by the networks for what the scan is expected to be; whole: by those for whole scans,
            where the scan may be one all the same; visibility: of places in the unit box; of a whole scan all is seen.
        settings: of `deform_candidates`.
    """
    found = deform_candidates(candidates, visibility, deform, **settings)
    if whole is None:
        return found
    other = deform_candidates(whole, all_seen(), deform, **settings)
    return other if _lowest(other) < _lowest(found) - WHOLE_GAIN else found


def _lowest(deformed: Deformed) -> float:
    return min(one.score for one in deformed.explanations if one.final)
