"""Stacks: what is recorded holds, and constants of other layers are seen."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.recipes.folder import fits_folder
from profilefit.studies.stability import stacks
from profilefit.studies.stability.cells import EXTENDED, Verdict, regions_of
from profilefit.studies.stability.stacks import CDF, FLOAT64, MODEL, ONCE, PDF, PROFILE, SAMPLE, TEXT32, TOTAL

ENDS = {(row[0], row[1]): stacks.end(*row) for row in stacks.ENDS}


def reds(*cells):
    return [region for each in cells for region in regions_of(each) if region.verdict.is_red]


def wrong(regions):
    """Those of ours that break their promise."""
    return [(one.subject, one.quantity, one.where) for one in regions if one.is_failure]


@pytest.mark.slow
def test_recorded_stacks_hold_in_float32():
    recorded = list(stacks.recorded_stacks(fits_folder()))
    assert {one.label for one in recorded} >= {"skin, red", "heart, blue", "skimmilk-on-potato, green"}
    cells = [each for one in recorded for each in (stacks.energies(one), *stacks.of_law(one, TEXT32))]
    found = reds(*cells, *stacks.stated(recorded, promised=True))
    assert wrong(found) == []
    assert {one.advice for one in found} == {stacks.OF_LAWS}
    assert {one.quantity for one in found} == {PROFILE}  # beyond 99.5 % of the light
    for one in cells:
        if one.quantity in (CDF, TOTAL, SAMPLE):
            assert one.verdicts == {Verdict.RIGHT}, one.subject


@pytest.mark.slow
def test_laws_at_the_ends_of_albedos_fail_outside_their_promise_alone():
    cells = [each for one in ENDS.values() for each in (stacks.energies(one), *stacks.of_law(one, TEXT32))]
    found = reds(*cells, *stacks.stated(list(ENDS.values()), promised=False))
    assert wrong(found) == []
    assert {one.arithmetic for one in found} >= {MODEL, TEXT32}
    stated = [one for one in found if one.arithmetic == MODEL]
    assert any("on 0" in one.where for one in stated)  # black below
    assert any("0.05 on" in one.where for one in stated)  # an absorbing first layer


@pytest.mark.slow
@pytest.mark.parametrize(("albedos", "is_negative"), [((0.3, 0.9), False), ((0.9, 0.0), True)])
def test_laws_in_python(albedos, is_negative):
    """One that `stack_law` fits is right everywhere; one that it does not is negative somewhere."""
    one = ENDS[albedos]
    found = reds(*stacks.of_law(one, FLOAT64, stacks.UNDRAWN))
    assert wrong(found) == []
    assert one.holds != is_negative
    profiles = {each.verdict for each in found if each.quantity == PROFILE}
    assert profiles == ({Verdict.NEGATIVE} if is_negative else set())


def test_constants_of_other_layers_are_a_failure():
    """Negative control: a law whose R_d is below 0 is red, because its constants are foreign."""
    one = stacks.borrower()
    owned = replace(one, own=True, errors=stacks.ORDINARY)
    # Without a first layer R_d is a difference of equals, whose rounding far out may have either sign: not promised.
    found = [each for each in reds(*stacks.of_law(owned, FLOAT64, (PROFILE,))) if each.inside]
    assert {(each.verdict, each.is_failure) for each in found} == {(Verdict.NEGATIVE, True)}
    told = reds(*stacks.of_law(one, FLOAT64, (PROFILE, CDF)))
    assert {each.advice for each in told} == {stacks.OF_BORROWER}
    assert {each.verdict for each in told} == {Verdict.NEGATIVE, Verdict.NOT_MONOTONE}


@pytest.mark.parametrize(("quantity", "constant"), [(PROFILE, "g1"), (TOTAL, "u"), (SAMPLE, "b2"), (PDF, "g2")])
def test_a_constant_that_float32_has_wrong_is_found(monkeypatch, quantity, constant):
    """Negative control: the text of a law whose constant is off by a hundredth."""
    one = replace(ENDS[0.3, 0.9])  # which has not read its text yet
    off = replace(one, law=replace(one.law, **{constant: 1.01 * getattr(one.law, constant)}))
    monkeypatch.setattr(stacks.StackCase, "reference", off.text(EXTENDED))
    (cells,) = stacks.of_law(one, TEXT32, (quantity,))
    assert any(each.is_failure for each in reds(cells))


@pytest.mark.parametrize("n", stacks.INDICES)
def test_light_scattered_once(monkeypatch, n):
    exactly, single = stacks.once(n, FLOAT64), stacks.once(n, TEXT32)
    assert exactly.verdicts == {Verdict.RIGHT}
    found = reds(single)
    assert wrong(found) == []
    assert {(one.quantity, one.advice) for one in found} == {(ONCE, stacks.OF_ONCE)}
    assert all("g -0.95" in one.where for one in found)
    assert np.mean(single.inside) > 0.8
    scatter = stacks.single_scattering  # negative control: a direction that is off in the ninth digit
    monkeypatch.setattr(stacks, "single_scattering", lambda of, i, o, turned: scatter(of, i, o * (1 - 1e-8), turned))
    assert Verdict.INACCURATE in stacks.once(n, FLOAT64).verdicts
