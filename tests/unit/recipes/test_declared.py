"""Declared files: what each kind of key accepts in words, and one line that names file, table and key."""

from __future__ import annotations

import math
import re
from typing import Annotated

import pytest
from pydantic import Field, model_validator

from profilefit.errors import InputError, RecipeError, SettingError
from profilefit.recipes.declared import LISTED, Declared, NumberRange, OneOf, Refused, Shares, Text, at, words


class Lamp(Declared):
    colour: Shares = (1.0, 1.0, 1.0)
    kind: Annotated[str, OneOf("spot", "sun")] = "sun"
    reach: Annotated[float, Field(gt=0.0, allow_inf_nan=True)] = math.inf
    size: Annotated[tuple[float, float], NumberRange(0.5, 4.0)] = (1.0, 1.0)


class Shelf(Declared):
    height: float
    marks: Annotated[tuple[int, ...], LISTED, words("whole numbers")] = ()


class House(Declared):
    name: Text = ""
    lamp: Lamp = Lamp()
    shelves: Annotated[tuple[Shelf, ...], LISTED] = ()
    floors: Annotated[int, Field(ge=1, le=9)]

    @model_validator(mode="after")
    def _stands(self):
        for number, shelf in enumerate(self.shelves):
            if shelf.height > self.floors:
                raise Refused("at most the floors", shelf.height, "shelves", number, "height")
        if self.name == "dark":
            with at("lamp"):
                raise SettingError("a dark house has no lamp")
        return self


WORDS = "a number > 0 and >= 0.5 and <= 4, or two of them, the smaller first"
MISTAKES = [
    ({"floors": ...}, "floors must be a whole number in 1 ... 9, got nothing"),
    ({"floors": True}, "floors must be a whole number in 1 ... 9, got True"),
    ({"floors": 2.0}, "floors must be a whole number in 1 ... 9, got 2.0"),
    ({"floors": 0, "cellar": 1}, "keys must be of name, lamp, shelves, floors, got 'cellar'"),
    ({"name": "a\nb"}, "name must be a text of 60 characters at most, got 'a\\nb'"),
    ({"lamp": 3}, "lamp must be a table [lamp], got 3"),
    *(
        ({"lamp": lamp}, f"[lamp] {said}")
        for lamp, said in (
            ({"watts": 3}, "keys must be of colour, kind, reach, size, got 'watts'"),
            ({"colour": [1, 2, 0]}, "colour must be three numbers in 0 ... 1, got [1, 2, 0]"),
            ({"kind": "moon"}, "kind must be one of spot, sun, got 'moon'"),
            ({"reach": math.nan}, "reach must be a number > 0, got nan"),
            ({"size": [2, 1]}, f"size must be {WORDS}, got [2, 1]"),
        )
    ),
    ({"shelves": {"height": 1}}, "shelves must be tables [[shelves]], got {'height': 1}"),
    ({"shelves": [{}]}, "[shelves 1] height must be a finite number, got nothing"),
    ({"shelves": [{"height": math.inf}]}, "[shelves 1] height must be a finite number, got inf"),
    ({"shelves": [{"height": 1.0, "marks": [1, "a"]}]}, "[shelves 1] marks must be whole numbers, got [1, 'a']"),
    ({"shelves": [{"height": 1}, {"height": 2}]}, "[shelves 2] height must be at most the floors, got 2.0"),
    ({"name": "dark"}, "[lamp] a dark house has no lamp"),
]


@pytest.mark.parametrize(("content", "said"), MISTAKES, ids=[said[:40] for _, said in MISTAKES])
def test_a_mistake_is_one_line_that_names_its_place(content, said):
    """Of a house with one floor, but where floors are given, or left out."""
    content = {key: value for key, value in {"floors": 1, **content}.items() if value is not ...}
    with pytest.raises(InputError, match=f"^{re.escape(f'house.toml: {said}')}$") as caught:
        House.of("house.toml", content)
    assert type(caught.value) is (SettingError if "dark" in said else InputError)
    with pytest.raises(RecipeError):
        House.of("house.toml", content, RecipeError)


def test_what_is_right_is_read():
    content = {"floors": 2, "lamp": {"reach": math.inf, "size": 2, "colour": [0, 1, 0.5]}}
    house = House.of("house.toml", {**content, "shelves": [{"height": 1}]})
    assert (house.file, house.floors, house.lamp.size, house.lamp.colour) == ("house.toml", 2, (2.0, 2.0), (0, 1, 0.5))
    other = house.changed("other.toml", lamp={"kind": "spot"}, floors=3)
    assert (other.file, other.floors, other.lamp.kind, other.lamp.size) == ("other.toml", 3, "spot", (2.0, 2.0))
    assert house.lamp.kind == "sun"
