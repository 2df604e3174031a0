"""The path of an SVG in as few letters as no reader sees any difference of."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
WORD = re.compile(r"[A-Za-z]|[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
COUNTS = {"M": 2, "L": 2, "Q": 4, "C": 6, "z": 0}  # numbers that follow; matplotlib knows these
FARTHEST = 1e9  # that a place may be [pt]: no figure's is
NEAR = 0.3  # of a straight line, in units of the last digit: with the rounding less than one


def shortened(d: str, digits: int = 1, place: tuple[float, float] = (0.0, 0.0)) -> str:
    """A path moved to `place`, each point after its predecessor, without those on a straight line.

    digits  after the point that are kept: of a point of 1/72 inch, a tenth is less than a screen shows
    """
    commands = list(_commands(WORD.findall(d)))
    if any(COUNTS.get(letter) != len(numbers) for letter, numbers in commands):
        return d
    if any(abs(one) > FARTHEST for _, numbers in commands for one in (*numbers, *place)):
        return d
    pen = _Pen(digits)
    lines = groupby(commands, key=lambda one: one[0])
    for letter, run in lines:
        points = [(np.reshape(numbers, (-1, 2)) + place) * 10**digits for _, numbers in run]
        pen.draw(letter, points)
    return pen.path()


def _commands(words: Iterable[str]) -> Iterator[tuple[str, list[float]]]:
    letter = ""
    numbers: list[float] = []
    for word in words:
        if word.isalpha():
            if letter:
                yield letter, numbers
            letter, numbers = word, []
        else:
            numbers.append(float(word))
    if letter:
        yield letter, numbers


class _Pen:
    """Writes a path in whole units of 10^-digits, from point to point."""

    def __init__(self, digits: int) -> None:
        self.digits = digits
        self.words: list[str] = []
        self.here: Floats = np.zeros(2)
        self.exact: Floats = self.here
        self.start: Floats = self.here

    def draw(self, letter: str, points: list[Floats]) -> None:
        """Commands of one letter, each with its points (n, 2)."""
        if letter == "z":
            self.words.append("z")
            self.here = self.exact = self.start
        elif letter == "L":
            line = np.concatenate([self.exact[None], *points])
            self._lines(np.rint(line[1:][_bends(line, NEAR)[1:]]))
        else:
            for one in points:
                whole = np.rint(one)
                self._say(letter if letter == "M" else letter.lower(), whole if letter == "M" else whole - self.here)
                self.here = whole[-1]
        if points and len(points[-1]):
            self.exact = points[-1][-1]
        if letter == "M":
            self.start = self.exact

    def _lines(self, points: Floats) -> None:
        steps = np.diff(points, axis=0, prepend=self.here[None])
        moving = steps[np.any(steps != 0, axis=1)]
        for dx, dy in moving if len(moving) else np.zeros((1, 2)):
            if dy == 0:
                self._say("h", np.array([dx]))
            elif dx == 0:
                self._say("v", np.array([dy]))
            else:
                self._say("l", np.array([dx, dy]))
        self.here = points[-1]

    def _say(self, letter: str, numbers: Floats) -> None:
        self.words += [letter, *(number(int(one), self.digits) for one in numbers.ravel())]

    def path(self) -> str:
        """A letter is said once for all that follow, and a space only where two numbers would be read as one."""
        text: list[str] = []
        letter = before = ""
        for word in self.words:
            if word.isalpha():
                if word != letter or word == "M":
                    text.append(word)
                    before = word
                letter = word
            else:
                apart = before.isalpha() or word[0] == "-" or (word[0] == "." and "." in before)
                text.append(word if apart else f" {word}")
                before = word
        return "".join(text)


def number(units: int, digits: int) -> str:
    """`units` of 10^-digits, in as few letters as possible."""
    text = f"{units / 10**digits:.{digits}f}".rstrip("0").rstrip(".")
    return re.sub(r"^(-?)0\.", r"\1.", text)


def _bends(line: Floats, near: float) -> NDArray[np.bool_]:
    """Which points of a line (n, 2) to keep, so that none of the others is farther than `near` from it.

    Douglas and Peucker, Cartographica 10 (1973), 112.
    """
    keep = np.zeros(len(line), bool)
    keep[[0, -1]] = True
    spans = [(0, len(line) - 1)]
    while spans:
        low, high = spans.pop()
        if high - low < 2:
            continue
        between, chord = line[low + 1 : high] - line[low], line[high] - line[low]
        length = np.hypot(*chord)
        along = np.clip(between @ chord / max(length**2, 1e-300), 0.0, 1.0)
        far = np.hypot(*(between - along[:, None] * chord).T)
        if far.max() > near:
            middle = low + 1 + int(far.argmax())
            keep[middle] = True
            spans += [(low, middle), (middle, high)]
    return keep
