"""What stands for a character that a screen's encoding has not: one for one, so that columns stay in place."""

from __future__ import annotations

import codecs

NAME = "spelled"  # of the way to handle an encoding's errors
STANDS_FOR = {
    **dict(zip("▁▂▃▄▅▆▇█", "_.,-~=*#", strict=True)),
    **dict(zip("─│╭╮╰╯━┃", "-|++++-|", strict=True)),
    **dict(zip("αβγδκλμξπρστχω", "abgdklmxprstco", strict=True)),
    **dict(zip("±×−–—→…·²³√∂∞≤≥≈µ’", "+x--->..23Vdi<>~u'", strict=True)),
}
UNKNOWN = "?"


def spelled(error: UnicodeError) -> tuple[str, int]:
    """The characters that could not be encoded, each as another, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    return "".join(STANDS_FOR.get(letter, UNKNOWN) for letter in lost), error.end


codecs.register_error(NAME, spelled)
