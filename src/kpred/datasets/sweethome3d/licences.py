"""The licence of each model of a library, and which licences let it be passed on.

A model's own licence text, where there is one in its folder, counts before that of its library.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from kpred.datasets.sweethome3d.library import Library, LibraryModel

_NAMES = (
    ("CC0-1.0", r"Creative Commons Zero|CC-?0\b|Public domain|publicdomain/zero"),
    ("CC-BY-NC", r"NonCommercial|non-commercial|licenses/by-nc"),
    ("CC-BY-SA", r"Share ?Alike|share-alike|licenses/by-sa"),
    ("CC-BY-ND", r"NoDerivatives|No Derivative|licenses/by-nd"),
    ("CC-BY-3.0-US", r"Attribution 3\.0 United States"),
    ("CC-BY-3.0", r"Creative Commons Attribution 3\.0|licenses/by/3\.0"),
    ("CC-BY-4.0", r"Attribution 4\.0|licenses/by/4\.0"),
)
"""SPDX names with a pattern of their text, the first match counts; restrictions stand before plain CC BY."""

FREE = ("CC0-1.0", "CC-BY-3.0-US", "CC-BY-3.0", "CC-BY-4.0")
"""Licences under which a model may be changed and passed on, with attribution where they ask for it."""

ADDRESS = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    "CC-BY-3.0-US": "https://creativecommons.org/licenses/by/3.0/us/",
    "CC-BY-3.0": "https://creativecommons.org/licenses/by/3.0/",
    "CC-BY-4.0": "https://creativecommons.org/licenses/by/4.0/",
}

_ATTRIBUTION = {
    "Scopia": "Scopia Visual Interfaces Systems, s.l. (http://www.scopia.es) and Emmanuel Puybaret / eTeks",
    "Kator Legaz": "Andrew Kator & Jennifer Legaz",
}
"""How licence texts of whole libraries ask to be named, by the creator that their properties name."""

_SOURCE = re.compile(r"https?://www\.blendswap\.com/blends/view/\d+")
_THANKS = re.compile(r'Thank you for downloading "[^"]*" by (.+)')
_RELEASED = re.compile(r"Released under\s*(?:<a[^>]*>)?\s*([^<\r\n]+)")


@dataclass(frozen=True)
class Licence:
    """What a model may be used for.

    Attributes:
        name: SPDX name, or what the text says where it is none of the known.
        author: whom to name; source: address of the original, else of the library.
    """

    name: str
    author: str
    source: str

    @property
    def is_free(self) -> bool:
        """Whether the model may be changed and passed on."""
        return self.name in FREE


def licence_of(library: Library, model: LibraryModel) -> Licence:
    """Find the licence, author and source of a model in its folder, or in the library's properties."""
    text = _own_text(library, model)
    released, thanks, source = (pattern.search(text) for pattern in (_RELEASED, _THANKS, _SOURCE))
    stated = released[1].strip() if released else library.licence
    author = model.author or (thanks[1].strip() if thanks else "") or library.name
    author = _ATTRIBUTION.get(author, author)
    return Licence(spdx_name(stated), author, source[0] if source else f"Sweet Home 3D, {library.path.name}")


def spdx_name(text: str) -> str:
    """Name the licence that a sentence means; the sentence itself where it is none of the known."""
    for name, pattern in _NAMES:
        if re.search(pattern, text, re.IGNORECASE):
            return name
    return " ".join(text.split())[:80] or "unknown"


def _own_text(library: Library, model: LibraryModel) -> str:
    names = [name for name in library.beside(model) if "license" in name.rpartition("/")[2].lower()]
    return "\n".join(library.read(name).decode("utf-8", "replace") for name in names)
