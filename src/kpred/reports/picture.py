"""Pictures inside a report: small JPEG and PNG files as data URIs."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np
from PIL import Image

from kpred.ops.typing import UInt8
from kpred.reports.page import tag

QUALITY = 82
"""Of JPEG files."""

WIDTH = 1600
"""Pixels; wider pictures are made smaller."""


def picture(image: UInt8[np.ndarray, "height width 3"], description: str, class_: str = "") -> str:
    """Return an image as HTML: a data URI of the smaller of PNG and JPEG."""
    drawn = Image.fromarray(image)
    if drawn.width > WIDTH:
        drawn = drawn.resize((WIDTH, round(drawn.height * WIDTH / drawn.width)), Image.Resampling.LANCZOS)
    kinds = {"jpeg": _encoded(drawn, "JPEG"), "png": _encoded(drawn, "PNG")}
    kind = min(kinds, key=lambda name: len(kinds[name]))
    source = f"data:image/{kind};base64,{base64.b64encode(kinds[kind]).decode()}"
    html = tag("img", alt=description, class_=class_, width=drawn.width, height=drawn.height, loading="lazy")
    return html.replace("></img>", f' src="{source}">')


def picture_of_file(file: Path, description: str) -> str:
    """Return the picture in a file as HTML."""
    with Image.open(file) as opened:
        return picture(np.asarray(opened.convert("RGB")), description, "whole")


def _encoded(drawn: Image.Image, kind: str) -> bytes:
    buffer = io.BytesIO()
    drawn.save(buffer, kind, quality=QUALITY, optimize=True)
    return buffer.getvalue()
