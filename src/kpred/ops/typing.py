"""Shape annotations from jaxtyping, with a stand-in where only torch and numpy are installed.

Training runs on machines that have nothing but torch, numpy and safetensors; there the annotations are not checked,
so that any subscript of these names may simply be the array type itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int, UInt8
else:
    try:
        from jaxtyping import Bool, Float, Int, UInt8
    except ImportError:

        class _Unchecked:
            """Annotation stand-in: `Float[Tensor, "points 3"]` is then just `Tensor`."""

            def __class_getitem__(cls, item):
                return item[0]

        Bool = Float = Int = UInt8 = _Unchecked

__all__ = ["Bool", "Float", "Int", "UInt8"]
