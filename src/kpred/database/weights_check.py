"""Which weights made a database, held against those of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from kpred.errors import DatabaseError
from kpred.nn import KPRed
from kpred.nn.model import network_of


def check_weights(rows: Sequence[Any], model: Mapping[str, KPRed] | KPRed, where: str) -> None:
    """Raise DatabaseError when other weights made the categories in `rows` (of the table `category`) than `model`'s.

    Categories that only one of the two has are no error, as long as there is one that both have.
    """
    networks = {model.config.category: model} if isinstance(model, KPRed) else model
    used = {row.name: network_of(networks, row.name) for row in rows}
    for row in rows:
        network = used[row.name]
        loaded = row.fingerprint if network is None else network.fingerprint()
        if loaded != row.fingerprint:
            raise DatabaseError(
                f"Database {where} was made by other weights: its {row.name} tokens by {row.fingerprint} "
                f"({row.model_name or 'unnamed'}), the model loaded is {loaded}; load that model, or build the "
                "database again with this one."
            )
    if rows and all(network is None for network in used.values()):
        raise DatabaseError(
            f"Database {where} holds {', '.join(row.name for row in rows)}, the model knows "
            f"{', '.join(networks) or 'nothing'}; load another model or another database."
        )
