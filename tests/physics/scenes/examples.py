"""Examples of scenes' files, with one thing changed."""

from copy import deepcopy
from typing import Any

import pytest

from profilefit.errors import InputError

Content = dict[str, Any]


def changed(example: Content, place: str = "", value: Any = None) -> Content:
    """A copy, with another value at a dotted place, lists counted from 1; None takes what is there away."""
    found = deepcopy(example)
    if place:
        *above, last = place.split(".")
        part = found
        for name in above:
            part = part[int(name) - 1 if isinstance(part, list) else name]
        if value is None:
            del part[last]
        else:
            part[last] = value
    return found


def mistaken(read, file: str, content: Content, message: str) -> None:
    """Content that is refused in one line, which begins with the file's name."""
    with pytest.raises(InputError, match=message) as caught:
        read(file, content)
    assert str(caught.value).startswith(f"{file}: ")
    assert str(caught.value).isprintable()
