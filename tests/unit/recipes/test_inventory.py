"""A law by the name that a user has for it."""

import pytest

from mcml_sim import Setting
from profilefit.errors import InputError, RecordError, SettingError
from profilefit.laws.base import AlbedoLaw
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import albedo_laws, find, profile_laws, sampled_laws

FITS = catalogue.fits_folder()


@pytest.mark.parametrize(
    ("name", "constants", "law", "setting", "records"),
    [
        ("hazard-diffuse-refracting", None, "hazard", Setting("diffuse", n=1.4), ("hazard-diffuse-refracting",)),
        ("liang-whole", None, "liang", Setting(), ("liang-whole", "liang-inverse-whole")),
        ("liang-as-published", None, "liang", Setting(), ("liang-as-published",)),
        ("albedo-rational-refracting", None, "rational", Setting(n=1.4), ("albedo-rational-refracting",)),
        ("liang", None, "liang", Setting(), ("liang-whole", "liang-inverse-whole")),
        ("gaussians", None, "gaussians:6", Setting(), ("gaussians-6",)),
        ("burley", "published:diffuse", "burley", Setting("diffuse"), ()),
        ("dipole", None, "dipole", Setting(), ()),
        ("burley_diffuse_mfp", None, "burley_diffuse_mfp", Setting(), ()),
        ("rational", None, "rational", Setting(), ("albedo-rational",)),
        ("albedo liang", None, "liang", Setting(), ("albedo-liang",)),
        ("van_de_hulst", None, "van_de_hulst", Setting("diffuse"), ()),
        ("chiang", "published", "chiang", Setting("diffuse"), ()),
    ],
)
def test_a_record_or_a_law_by_its_name(name, constants, law, setting, records):
    found = find(name, FITS, constants)
    assert (found.name, found.setting, found.records) == (law, setting, records)


@pytest.mark.slow
def test_every_record_of_a_fit_is_found_and_is_what_it_says():
    for one in [*profile_laws(FITS, matched=False), *sampled_laws(FITS), *albedo_laws(FITS, matched=False)]:
        for name in one.records:
            again = find(name, FITS)
            assert isinstance(again.law, AlbedoLaw) == isinstance(one.law, AlbedoLaw)
            assert again.setting == one.setting


def test_a_law_that_spans_indices_is_found_at_each():
    for n in (1.0, 1.001, 1.37):
        found = find("hazard-diffuse", FITS, n=n)
        assert found.setting == Setting("diffuse", n=n)
        assert found.records == ("hazard-diffuse" if n == 1.0 else "hazard-diffuse-refracting",)
    with pytest.raises(SettingError, match=r"n in \(1, 1.6\].* got a request for diffuse, n = 1.61, g = 0"):
        find("hazard-diffuse", FITS, n=1.61)
    with pytest.raises(SettingError, match=r"published constants of burley belong to searchlight, n = 1"):
        find("burley", FITS, "published", n=1.4)


def test_a_law_with_g_is_found_at_each():
    for g, record in ((0.0, "hazard-refracting"), (0.3, "hazard-forward"), (0.95, "hazard-forward")):
        found = find("hazard", FITS, n=1.4, g=g)
        assert (found.setting, found.records) == (Setting(n=1.4, g=g), (record,))
    with pytest.raises(SettingError, match=r"g in \(0, 0.95\].* got a request for searchlight, n = 1.4, g = 0.97"):
        find("hazard", FITS, n=1.4, g=0.97)
    with pytest.raises(SettingError, match="burley"):
        find("burley", FITS, "published", g=0.5)


def test_refracting_surfaces_are_left_out_where_laws_are_compared():
    settings = {one.setting for one in profile_laws(FITS)}
    assert settings == {Setting(), Setting("diffuse")}
    assert Setting(n=1.4) in {one.setting for one in profile_laws(FITS, matched=False)}


def test_what_is_not_there_is_named(tmp_path):
    with pytest.raises(
        InputError, match=r"'hazzard-diffuse'; did you mean hazard-diffuse, .*\? `profilefit report` lists"
    ):
        find("hazzard-diffuse", FITS)
    with pytest.raises(InputError, match=r"got 'Chiang'; did you mean chiang, "):
        find("Chiang", FITS)
    with pytest.raises(InputError, match=r"map or record, got 'zzz'; laws: liang, .* `profilefit report` lists"):
        find("zzz", FITS)
    with pytest.raises(RecordError, match=r"'reproduction' holds no law"):
        find("reproduction", FITS)
    with pytest.raises(InputError, match=r"constants must be one of regenerated, published, .* got 'mine'"):
        find("liang", FITS, "mine")
    with pytest.raises(InputError, match=r"constants of a record are its own: .* published, got 'hazard-refracting'"):
        find("hazard-refracting", FITS, "published")


def test_what_was_not_regenerated_has_its_only_printed_constants_unless_others_are_asked_for():
    assert find("burley_diffuse_mfp", FITS).constants == find("van_de_hulst", FITS).constants == "published"
    with pytest.raises(InputError, match=r"^constants must be the path of a record .*gaussians:3 was not regenerated"):
        find("gaussians:3", FITS)
    with pytest.raises(RecordError, match=r"none were regenerated, got 'regenerated'"):
        find("burley_diffuse_mfp", FITS, "regenerated")


@pytest.mark.parametrize("name", ["hazzard", "burleyy", "gaussians:99", "albedo-rational-difuse-n1.35", "zzz", ""])
def test_a_name_that_is_not_there_is_told_in_one_short_line(name):
    with pytest.raises(InputError) as told:
        find(name, FITS)
    assert len(str(told.value)) < 200
    assert "\n" not in str(told.value)
