"""The figures' letters as a font inside the page: texts in an SVG are then as wide as the figure was laid out for."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterable
from html import unescape

from fontTools import subset
from fontTools.ttLib import TTFont
from matplotlib import font_manager

FAMILY = "DejaVu Sans"
NAMES = [0, 1, 2, 13, 14]  # of the font's own table: copyright, name, style, licence


def font_face(svgs: Iterable[str]) -> str:
    """A CSS rule with those letters of DejaVu Sans that the texts of these figures use, as WOFF."""
    texts = (text for svg in svgs for text in re.findall(r">([^<>]+)</(?:text|tspan)>", svg))
    letters = "".join(sorted(set("".join(unescape(text) for text in texts))))
    font = TTFont(font_manager.findfont(FAMILY))
    options = subset.Options(layout_features=[], hinting=False, name_IDs=NAMES)
    options.drop_tables += ["FFTM"]  # when its editor saved it
    cutter = subset.Subsetter(options)
    cutter.populate(text=letters)
    cutter.subset(font)
    font.flavor = "woff"
    file = io.BytesIO()
    font.save(file)
    data = base64.b64encode(file.getvalue()).decode()
    return f"@font-face{{font-family:'{FAMILY}';src:url(data:font/woff;base64,{data}) format('woff')}}"
