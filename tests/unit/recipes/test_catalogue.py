"""Laws by name: every form of `constants`, records and laws by a user's name, and what each wrong one is told."""

import json

import pytest

import profilefit
from mcml_sim import Setting, exact
from profilefit.errors import InputError, RecordError, SettingError, ShippedMap
from profilefit.laws import profile_classes
from profilefit.laws.base import AlbedoLaw, ProfileLaw, Sampler
from profilefit.laws.published import constants as constants_of
from profilefit.recipes import catalogue, record
from profilefit.recipes.catalogue import albedo_laws, find, profile_laws, sampled_laws
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import Records, record_name
from tests.fixtures import refused

FITS = fits_folder()
DIFFUSE, REFRACTED = Setting("diffuse"), Setting(n=1.4)
FOUR = {"s0": 1.0, "s1": 2.0, "s2": 3.0, "s3": 4.0}
MAP = {"p": 5.0, "q": 3.5, "w": 0.8}


def make_record(folder, name, law, values, pipeline="profile", setting=None):
    constants = {key: {"regenerated": value} for key, value in values.items()}
    content = {"law": law, "pipeline": pipeline, "setting": setting or Setting(), "constants": constants}
    return record.write(folder, name, content, {})


def test_names():
    assert {"liang", "burley", "gaussians"} <= set(profilefit.names())
    assert isinstance(profilefit.names(), tuple)
    assert not [name for name in profilefit.names() if ":" in name]
    for name in ("liang", "rational"):
        law = profilefit.albedo_law(name)
        assert isinstance(law, AlbedoLaw)
        # Equation (8) is right to .005 in alpha where A <= .75; the rational one to 1e-5.
        assert law.alpha(exact.reflectance(0.8)) == pytest.approx(0.8, abs=0.02)


LOADED = [name for name, kind in profile_classes().items() if kind.entry.records or not kind.constant_names()]


@pytest.mark.parametrize("name", LOADED)
def test_every_law_loads_as_regenerated_and_is_a_law(name):
    law = profilefit.load(name)
    assert isinstance(law, ProfileLaw)
    assert law.setting == Setting()
    assert 0 < law.profile(1.0, 0.8, 1.0) < 1
    # The map it normalises with is the exact one but for a few parts in a million.
    if law.albedo is not None:  # a diffusion model has a reflectance of its own
        assert float(law.albedo.reflectance(0.8)) == pytest.approx(exact.reflectance(0.8), abs=1e-5)
    assert all(isinstance(sampler, Sampler) and sampler.law == law for sampler in law.samplers.values())


def test_printed_sets_by_name():
    for name in ("published", "published:corrected", "corrected"):
        found = profilefit.load("liang", name).constants()
        assert found == constants_of("liang", name.removeprefix("published:"))
    assert profilefit.albedo_law("liang", "published").constants() == {"p": 5.67, "q": 3.84, "w": 0.84}
    law = profilefit.load("burley", "published:diffuse")
    assert (law.setting, law.albedo.setting) == (DIFFUSE, DIFFUSE)
    assert profilefit.load("burley", "published:diffuse", DIFFUSE) == law
    with pytest.raises(SettingError, match=r"belong to diffuse, n = 1, g = 0, got a request for searchlight"):
        profilefit.load("burley", "published:diffuse", Setting())


def test_a_records_path(tmp_path):
    """A record of the profile alone leaves the inverse as printed."""
    values = {**constants_of("liang", "corrected"), "a1": -0.007}
    path = make_record(tmp_path, "mine", "liang", {"a1": values["a1"], "b0": values["b0"]})
    assert profilefit.load("liang", str(path)).constants() == values
    path = make_record(tmp_path, "map", "liang", MAP, pipeline="albedo")
    assert profilefit.albedo_law("liang", str(path)).constants() == MAP
    with pytest.raises(RecordError, match=r"holds constants of law 'albedo liang', got a request for 'liang'"):
        profilefit.load("liang", str(path))
    path = make_record(tmp_path, "other", "burley", constants_of("burley"), setting=DIFFUSE)
    with pytest.raises(SettingError, match=r"belongs to diffuse, n = 1, g = 0, got a request for searchlight"):
        profilefit.load("burley", str(path), Setting())
    assert profilefit.load("burley", str(path)).setting == DIFFUSE
    with pytest.raises(RecordError, match=r"holds constants of law 'burley', got a request for 'liang'"):
        profilefit.load("liang", str(path))


@pytest.mark.parametrize(
    ("load", "arguments", "words"),
    [
        (profilefit.load, ["lambert"], r"law must be one of liang, burley.*, got 'lambert'"),
        (profilefit.albedo_law, ["burley"], r"albedo law must be one of liang, rational.*, got 'burley'"),
        (profilefit.load, ["liang", "best"], r"constants must be one of regenerated, published, corrected, the path"),
        (profilefit.load, ["burley", "published:corrected"], r"got 'published:corrected'"),
        (profilefit.albedo_law, ["rational", "published"], r"constants must be one of regenerated, the path"),
        (profilefit.load, ["burley", "regenerated", "diffuse"], r"setting must be a mcml_sim\.Setting, got 'diffuse'"),
        (profilefit.load, ["dipole", "old"], r"must be one of regenerated, the path of a record .*, got 'old'"),
        (profilefit.albedo_law, ["chiang"], r"of albedo chiang must be one of published, the path .*'regenerated'"),
        (profilefit.load, ["gaussians:3"], r"of gaussians:3 must be one of the path of a record .*, got 'regenerated'"),
        *(
            (
                profilefit.load,
                [f"gaussians:{n}"],
                r"law must be gaussians:N with N a whole number in 1 \.\.\. 8, got 'gaus",
            )
            for n in ("9", "0", "two", "")
        ),
        *(
            (load, ["liang", which, where], r"belongs? to searchlight, n = 1, g = 0, got a request for")
            for load in (profilefit.load, profilefit.albedo_law)
            for which in ("regenerated", "published")
            for where in (DIFFUSE, REFRACTED)
        ),
    ],
)
def test_what_there_is_not_is_told_with_what_is_accepted(load, arguments, words):
    refused(words, load, *arguments)


DAMAGE = [
    {"constants": {"s9": {"regenerated": 1.0}}},
    {"setting": {"illumination": "searchlight", "colour": "red"}},
]


@pytest.mark.parametrize("damage", DAMAGE, ids=str)
def test_damaged_records_are_told_in_one_line(tmp_path, damage):
    mine = make_record(tmp_path, "mine", "burley", constants_of("burley"))
    mine.write_text(json.dumps({**json.loads(mine.read_text()), **damage}))
    refused(r"mine", profilefit.load, "burley", str(mine), error=RecordError)


BY_NAME = {
    **{"map": Setting(), "map-diffuse": DIFFUSE, "map-n1.4": REFRACTED, "map-diffuse-n1.4": Setting("diffuse", n=1.4)},
    **{"map-n2": Setting(n=2), "map-n1.3333333333333333": Setting(n=1.3333333333333333)},
    "map-n1.4-g-0.5": Setting(n=1.4, g=-0.5),
}


SETTINGS = [Setting(illumination, n) for illumination in ("searchlight", "diffuse") for n in (1.0, 1.4)]


def test_settings_have_records_by_their_names_or_are_told_which_there_are():
    """The map that normalises is there for every setting."""
    for name, setting in BY_NAME.items():
        assert record_name("map", setting) == name
    for setting in SETTINGS:
        law = catalogue.normalisation(setting)
        assert law.setting == setting
        assert law == profilefit.albedo_law("rational", setting=setting)
    assert set(SETTINGS) <= set(Records(FITS).settings("albedo-rational"))
    words = r"albedo-rational belongs to .*diffuse, n in \(1, 1\.6\], g = 0.*, n = 1\.7, g = 0$"
    refused(words, catalogue.normalisation, Setting(n=1.7), error=SettingError)
    with pytest.raises(SettingError, match=r"got a request for searchlight, n = 1, g = 0\.8"):
        profilefit.albedo_law("rational", setting=Setting(g=0.8))


def test_records_of_another_folder_come_first_and_by_their_setting(tmp_path):
    make_record(tmp_path, "burley-whole", "burley", FOUR)
    with pytest.warns(ShippedMap, match=r"no record 'albedo-rational' in '.*': the shipped albedo inversion is used"):
        here, shipped = profilefit.load("burley", folder=tmp_path), profilefit.load("burley")
    assert here.constants() == FOUR != shipped.constants()
    assert here.albedo == shipped.albedo  # not in that folder: the installation's own
    (tmp_path / "burley-whole.json").unlink()
    make_record(tmp_path, "burley-whole-diffuse", "burley", FOUR, setting=DIFFUSE)
    with pytest.warns(ShippedMap, match="albedo-rational-diffuse"):
        law = profilefit.load("burley", setting=DIFFUSE, folder=tmp_path)
    assert (law.constants(), law.setting, law.albedo.setting) == (FOUR, DIFFUSE, DIFFUSE)
    assert Records(tmp_path).settings("burley-whole") == (DIFFUSE,)
    with pytest.raises(RecordError, match=r"hazard\.json: there is no such record; .* hazard --out .* makes it"):
        profilefit.load("hazard", folder=tmp_path)
    with pytest.raises(SettingError, match=r"belongs to diffuse, n = 1, g = 0, got a request"):
        profilefit.load("burley", setting=REFRACTED, folder=tmp_path)
    # A record whose name is of another setting than its own.
    make_record(tmp_path, "burley-whole-diffuse", "burley", FOUR)
    with pytest.raises(SettingError, match=r"belongs to searchlight, n = 1, g = 0, got a request for diffuse"):
        profilefit.load("burley", setting=DIFFUSE, folder=tmp_path)


def test_laws_without_constants_and_with_a_number():
    """A law without constants needs no record, nor a map: n = 1.35 has none."""
    for constants in ("regenerated", "published"):
        law = profilefit.load("dipole", constants, Setting(n=1.35))
        assert (law.constants(), law.setting) == ({}, Setting(n=1.35))
    assert profilefit.load("gaussians") == profilefit.load("gaussians:6")
    assert profilefit.load("gaussians:2").count() == 2
    six = str(FITS / "gaussians-6.json")
    assert [profilefit.load(name, six).count() for name in ("gaussians", "gaussians:6")] == [6, 6]
    with pytest.raises(RecordError, match=r"holds constants of law 'gaussians:6', got a request for 'gaussians:4'"):
        profilefit.load("gaussians:4", six)


# By the name that a user has for it


WHOLE = ("liang-whole", "liang-inverse-whole")
FOUND = {
    "hazard-diffuse-refracting": ("hazard", Setting("diffuse", n=1.4), ("hazard-diffuse-refracting",)),
    "liang-whole": ("liang", Setting(), WHOLE),
    "liang-as-published": ("liang", Setting(), ("liang-as-published",)),
    "albedo-rational-refracting": ("rational", REFRACTED, ("albedo-rational-refracting",)),
    "liang": ("liang", Setting(), WHOLE),
    "gaussians": ("gaussians:6", Setting(), ("gaussians-6",)),
    "burley, published:diffuse": ("burley", DIFFUSE, ()),
    "dipole": ("dipole", Setting(), ()),
    "burley_diffuse_mfp": ("burley_diffuse_mfp", Setting(), ()),
    "rational": ("rational", Setting(), ("albedo-rational",)),
    "albedo liang": ("liang", Setting(), ("albedo-liang",)),
    "van_de_hulst": ("van_de_hulst", DIFFUSE, ()),
    "chiang, published": ("chiang", DIFFUSE, ()),
}


@pytest.mark.parametrize("words", FOUND)
def test_a_record_or_a_law_by_its_name(words):
    name, _, constants = words.partition(", ")
    found = find(name, FITS, constants or None)
    assert (found.name, found.setting, found.records) == FOUND[words]
    assert found.constants == "published" or name not in ("burley_diffuse_mfp", "van_de_hulst")  # the only printed ones


@pytest.mark.slow
def test_every_record_of_a_fit_is_found_and_is_what_it_says():
    for one in [*profile_laws(FITS, matched=False), *sampled_laws(FITS), *albedo_laws(FITS, matched=False)]:
        for name in one.records:
            again = find(name, FITS)
            assert isinstance(again.law, AlbedoLaw) == isinstance(one.law, AlbedoLaw)
            assert again.setting == one.setting


SPANNED = [
    ("hazard-diffuse", 1.0, None, "hazard-diffuse"),
    *(("hazard-diffuse", n, None, "hazard-diffuse-refracting") for n in (1.001, 1.37)),
    ("hazard", 1.4, 0.0, "hazard-refracting"),
    *(("hazard", 1.4, g, "hazard-forward") for g in (0.3, 0.95)),
]


@pytest.mark.parametrize(("name", "n", "g", "record"), SPANNED)
def test_a_law_that_spans_indices_and_g_is_found_at_each(name, n, g, record):
    found = find(name, FITS, n=n, g=g)
    light = "diffuse" if "diffuse" in name else "searchlight"
    assert (found.setting, found.records) == (Setting(light, n=n, g=g or 0.0), (record,))


def test_refracting_surfaces_are_left_out_where_laws_are_compared():
    assert {one.setting for one in profile_laws(FITS)} == {Setting(), DIFFUSE}
    assert REFRACTED in {one.setting for one in profile_laws(FITS, matched=False)}


@pytest.mark.parametrize(
    ("name", "options", "error", "words"),
    [
        ("hazard-diffuse", {"n": 1.61}, SettingError, r"n in \(1, 1.6\].* request for diffuse, n = 1.61, g = 0"),
        ("burley", {"constants": "published", "n": 1.4}, SettingError, "constants of burley belong to searchlight, n"),
        ("hazard", {"n": 1.4, "g": 0.97}, SettingError, r"g in \(0, 0.95\].* for searchlight, n = 1.4, g = 0.97"),
        ("burley", {"constants": "published", "g": 0.5}, SettingError, "burley"),
        ("hazzard-diffuse", {}, InputError, r"'hazzard-diffuse'; did you mean hazard-diffuse, .*\? `profilefit"),
        ("Chiang", {}, InputError, r"got 'Chiang'; did you mean chiang, "),
        ("zzz", {}, InputError, r"map or record, got 'zzz'; laws: liang, .* `profilefit report` lists"),
        ("reproduction", {}, RecordError, r"'reproduction' holds no law"),
        ("liang", {"constants": "mine"}, InputError, r"constants must be one of regenerated, published, .* got 'mine'"),
        ("hazard-refracting", {"constants": "published"}, InputError, r"of a record are its own: .*hazard-refracting"),
        ("gaussians:3", {}, InputError, r"^constants must be the path of a record .*gaussians:3 was not regenerated"),
        ("burley_diffuse_mfp", {"constants": "regenerated"}, RecordError, r"none were regenerated, got 'regenerated'"),
        *((name, {}, InputError, f"got '{name}'") for name in ("gaussians:99", "")),
    ],
)
def test_what_is_not_there_is_named_in_one_short_line(name, options, error, words):
    said = refused(words, find, name, FITS, **options, error=error)
    assert error is SettingError or len(said) < 200
