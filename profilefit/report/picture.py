"""Pictures of pixels as part of a page: the address that holds one, as short as it can be with every pixel in it."""

from __future__ import annotations

import base64
import io

from PIL import Image


def address(png: bytes) -> str:
    """`data:image/webp;base64,...` of a PNG file; OSError, ValueError on what is none.

    Without loss: in a map of errors the noise is what is shown, and the sign is a colour.
    """
    file = io.BytesIO()
    try:
        with Image.open(io.BytesIO(png), formats=["png"]) as picture:
            picture.save(file, "webp", lossless=True)
    except (SyntaxError, Image.DecompressionBombError) as error:  # Pillow's words for a damaged one, and for a bomb
        raise ValueError(f"a picture that cannot be read: {error}") from None
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode('ascii')}"
