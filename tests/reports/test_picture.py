"""Pictures of reports are small and in the page itself."""

import base64
import io
import re
from pathlib import Path

import numpy as np
from PIL import Image

from kpred.reports.picture import WIDTH, picture, picture_of_file


def decoded(html: str) -> Image.Image:
    found = re.search(r'src="data:image/(?:png|jpeg);base64,([^"]+)"', html)
    assert found is not None
    return Image.open(io.BytesIO(base64.b64decode(found[1])))


def test_the_smaller_kind_is_taken() -> None:
    flat = np.full((60, 80, 3), 200, np.uint8)
    noise = np.random.default_rng(0).integers(0, 256, (60, 80, 3), dtype=np.uint8)
    assert decoded(picture(flat, "flat")).format == "PNG" and decoded(picture(noise, "noise")).format == "JPEG"
    np.testing.assert_array_equal(np.asarray(decoded(picture(flat, "flat"))), flat)


def test_wide_pictures_are_made_smaller_and_descriptions_are_escaped(tmp_path: Path) -> None:
    Image.new("RGBA", (2 * WIDTH, 40), (1, 2, 3, 255)).save(tmp_path / "a.png")
    html = picture_of_file(tmp_path / "a.png", 'a "<b>"')
    assert decoded(html).size == (WIDTH, 20)
    assert "<b>" not in html and html.count("<img") == 1
