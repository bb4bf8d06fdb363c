"""Weights of a repository on the Hugging Face Hub, fetched only where an address says so: `hf://owner/name@revision`."""

from __future__ import annotations

import re
from pathlib import Path

from kpred.errors import ModelError

SCHEME = "hf://"

_ADDRESS = re.compile(r"hf://(?P<repository>[\w.-]+/[\w.-]+)@(?P<revision>[\w./-]+)")


def is_hub_address(name: str) -> bool:
    """Check whether a name is an address of the Hub, well formed or not."""
    return name.startswith(SCHEME)


def fetch_from_hub(address: str) -> Path:
    """Fetch the weights at an address, `hf://owner/name@revision`, and return their folder.

    The revision is a commit, tag or branch; it is part of the address, so that the same name means the same weights.

    Raises:
        ModelError: the address has another form, or nothing could be fetched.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None or ".." in found["revision"].split("/"):
        raise ModelError(f"{address} is no address of weights on the Hub; write hf://owner/name@revision.")
    try:
        from huggingface_hub import snapshot_download

        folder = snapshot_download(
            found["repository"], revision=found["revision"], allow_patterns=["*.json", "*.safetensors"]
        )
    except Exception as error:  # the hub's own errors have no common base
        raise ModelError(
            f"{address} could not be fetched from the Hugging Face Hub; check owner, name, revision and network."
        ) from error
    return Path(folder)
