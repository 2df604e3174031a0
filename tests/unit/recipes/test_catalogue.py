"""Laws by name: every form of `constants`, and what each wrong one is told."""

import json

import pytest

import profilefit
from mcml_sim import Setting, exact
from profilefit.errors import InputError, RecordError, SettingError, ShippedMap
from profilefit.laws import profile_classes
from profilefit.laws.base import AlbedoLaw, ProfileLaw, Sampler
from profilefit.laws.published import SETS
from profilefit.recipes import catalogue, record
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import Records, record_name


def constants_of(law, name):
    return next(dict(s.constants) for s in SETS if (s.law, s.name) == (law, name))


def make_record(folder, name, law, values, pipeline="profile", setting=None, **extra):
    content = {
        "law": law,
        "pipeline": pipeline,
        "setting": setting or Setting(),
        "constants": {key: {"regenerated": value} for key, value in values.items()},
        **extra,
    }
    return record.write(folder, name, content, {})


def test_names():
    assert {"liang", "burley"} <= set(profilefit.names())
    assert isinstance(profilefit.names(), tuple)


@pytest.mark.parametrize(
    "name", [name for name, kind in profile_classes().items() if kind.entry.records or not kind.constant_names()]
)
def test_every_law_loads_as_regenerated_and_is_a_law(name):
    law = profilefit.load(name)
    assert isinstance(law, ProfileLaw)
    assert law.setting == Setting()
    assert 0 < law.profile(1.0, 0.8, 1.0) < 1
    # The map it normalises with is the exact one but for a few parts in a million.
    if law.albedo is not None:  # a diffusion model has a reflectance of its own
        assert float(law.albedo.reflectance(0.8)) == pytest.approx(exact.reflectance(0.8), abs=1e-5)
    assert all(isinstance(sampler, Sampler) and sampler.law == law for sampler in law.samplers.values())


@pytest.mark.parametrize("name", ["liang", "rational"])
def test_every_map_loads_as_regenerated(name):
    law = profilefit.albedo_law(name)
    assert isinstance(law, AlbedoLaw)
    # Equation (8) is right to .005 in alpha where A <= .75; the rational one to 1e-5.
    assert law.alpha(exact.reflectance(0.8)) == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize(
    ("asked", "found"), [("published", "published"), ("published:corrected", "corrected"), ("corrected", "corrected")]
)
def test_printed_sets_by_name(asked, found):
    assert profilefit.load("liang", asked).constants() == constants_of("liang", found)


def test_printed_sets_of_maps():
    assert profilefit.albedo_law("liang", "published").constants() == {"p": 5.67, "q": 3.84, "w": 0.84}


def test_a_records_path(tmp_path):
    """A record of the profile alone leaves the inverse as printed."""
    values = {**constants_of("liang", "corrected"), "a1": -0.007}
    path = make_record(tmp_path, "mine", "liang", {"a1": values["a1"], "b0": values["b0"]})
    assert profilefit.load("liang", str(path)).constants() == values
    path = make_record(tmp_path, "map", "liang", {"p": 5.0, "q": 3.5, "w": 0.8}, pipeline="albedo")
    assert profilefit.albedo_law("liang", str(path)).constants() == {"p": 5.0, "q": 3.5, "w": 0.8}


def test_regenerated_records_of_another_folder_come_first(tmp_path):
    make_record(tmp_path, "burley-whole", "burley", {"s0": 1.0, "s1": 2.0, "s2": 3.0, "s3": 4.0})
    with pytest.warns(ShippedMap, match=r"no record 'albedo-rational' in '.*': the shipped map serves"):
        here, shipped = profilefit.load("burley", folder=tmp_path), profilefit.load("burley")
    assert here.constants() == {"s0": 1.0, "s1": 2.0, "s2": 3.0, "s3": 4.0}
    assert shipped.constants() != here.constants()
    assert here.albedo == shipped.albedo  # not in that folder: the installation's own


def test_shipped_records_belong_to_the_installation():
    assert (fits_folder() / "albedo-rational.json").is_file()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: profilefit.load("lambert"), r"law must be one of liang, burley.*, got 'lambert'"),
        (lambda: profilefit.albedo_law("burley"), r"albedo law must be one of liang, rational.*, got 'burley'"),
        (
            lambda: profilefit.load("liang", "best"),
            r"constants must be one of regenerated, published, corrected, the path",
        ),
        (lambda: profilefit.load("burley", "published:corrected"), r"got 'published:corrected'"),
        (lambda: profilefit.albedo_law("rational", "published"), r"constants must be one of regenerated, the path"),
        (lambda: profilefit.load("liang", "/nowhere/x.json"), r"/nowhere/x\.json: there is no such record"),
    ],
)
def test_unknown_names_are_told_what_is_accepted(call, words):
    with pytest.raises(InputError, match=words):
        call()


@pytest.mark.parametrize("constants", ["regenerated", "published"])
@pytest.mark.parametrize("setting", [Setting("diffuse"), Setting(n=1.4)])
def test_constants_of_another_setting_are_refused(constants, setting):
    for call in (profilefit.load, profilefit.albedo_law):
        with pytest.raises(SettingError, match=r"belongs? to searchlight, n = 1, g = 0, got a request for"):
            call("liang", constants, setting)


def test_a_record_of_another_setting_is_refused(tmp_path):
    path = make_record(tmp_path, "mine", "burley", constants_of("burley", "published"), setting=Setting("diffuse"))
    with pytest.raises(SettingError, match=r"belongs to diffuse, n = 1, g = 0, got a request for searchlight"):
        profilefit.load("burley", str(path), Setting())
    assert profilefit.load("burley", str(path)).setting == Setting("diffuse")


def test_a_record_of_another_law_is_refused(tmp_path):
    path = make_record(tmp_path, "mine", "burley", constants_of("burley", "published"))
    with pytest.raises(RecordError, match=r"holds constants of law 'burley', got a request for 'liang'"):
        profilefit.load("liang", str(path))
    path = make_record(tmp_path, "map", "liang", {"p": 5.0, "q": 3.5, "w": 0.8}, pipeline="albedo")
    with pytest.raises(RecordError, match=r"holds constants of law 'albedo liang', got a request for 'liang'"):
        profilefit.load("liang", str(path))


@pytest.mark.parametrize(
    "damage",
    [
        {"constants": {"s0": {"published": 1.0}}},
        {"constants": {"s0": {"regenerated": None}}},
        {"constants": {"s0": {"regenerated": "much"}}},
        {"constants": None},
        {"constants": {"s9": {"regenerated": 1.0}}},
        {"setting": None},
        {"setting": {"illumination": "searchlight", "colour": "red"}},
        {"law": None},
    ],
    ids=str,
)
def test_damaged_records_are_told_in_one_line(tmp_path, damage):
    path = make_record(tmp_path, "mine", "burley", constants_of("burley", "published"))
    path.write_text(json.dumps({**json.loads(path.read_text()), **damage}))
    with pytest.raises(RecordError, match=r"mine"):
        profilefit.load("burley", str(path))


@pytest.mark.parametrize("key", ["law", "setting", "constants"])
def test_records_that_lack_a_part_are_told_in_one_line(tmp_path, key):
    path = make_record(tmp_path, "mine", "burley", constants_of("burley", "published"))
    content = json.loads(path.read_text())
    del content[key]
    path.write_text(json.dumps(content))
    with pytest.raises(RecordError, match=r"mine"):
        profilefit.load("burley", str(path))


DIFFUSE, REFRACTED = Setting("diffuse"), Setting(n=1.4)


@pytest.mark.parametrize(
    ("setting", "name"),
    [
        (Setting(), "map"),
        (DIFFUSE, "map-diffuse"),
        (REFRACTED, "map-n1.4"),
        (Setting("diffuse", n=1.4), "map-diffuse-n1.4"),
        (Setting(n=2), "map-n2"),
        (Setting(n=1.3333333333333333), "map-n1.3333333333333333"),
        (Setting(n=1.4, g=-0.5), "map-n1.4-g-0.5"),
    ],
    ids=str,
)
def test_the_record_of_a_setting_has_its_name(setting, name):
    assert record_name("map", setting) == name


SETTINGS = [Setting(illumination, n) for illumination in ("searchlight", "diffuse") for n in (1.0, 1.4)]


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_the_map_that_normalises_is_there_for_every_setting(setting):
    law = catalogue.normalisation(setting)
    assert law.setting == setting
    assert law == profilefit.albedo_law("rational", setting=setting)
    assert profilefit.load("burley", str(fits_folder() / "burley-whole.json")).albedo == catalogue.normalisation(
        Setting()
    )


def test_settings_without_a_record_are_told_which_there_are(tmp_path):
    assert set(SETTINGS) <= set(Records(fits_folder()).settings("albedo-rational"))
    with pytest.raises(
        SettingError, match=r"albedo-rational belongs to .*diffuse, n in \(1, 1\.6\], g = 0.*, n = 1\.7, g = 0$"
    ):
        catalogue.normalisation(Setting(n=1.7))
    with pytest.raises(SettingError, match=r"got a request for searchlight, n = 1, g = 0\.8"):
        profilefit.albedo_law("rational", setting=Setting(g=0.8))
    with pytest.raises(InputError, match=r"setting must be a mcml_sim\.Setting, got 'diffuse'"):
        profilefit.load("burley", setting="diffuse")


def test_a_law_is_found_by_its_setting(tmp_path):
    values = {"s0": 1.0, "s1": 2.0, "s2": 3.0, "s3": 4.0}
    make_record(tmp_path, "burley-whole-diffuse", "burley", values, setting=DIFFUSE)
    with pytest.warns(ShippedMap, match="albedo-rational-diffuse"):
        law = profilefit.load("burley", setting=DIFFUSE, folder=tmp_path)
    assert (law.constants(), law.setting, law.albedo.setting) == (values, DIFFUSE, DIFFUSE)
    assert Records(tmp_path).settings("burley-whole") == (DIFFUSE,)
    with pytest.raises(RecordError, match=r"hazard\.json: there is no such record; .* hazard --out .* makes it"):
        profilefit.load("hazard", folder=tmp_path)
    with pytest.raises(SettingError, match=r"belongs to diffuse, n = 1, g = 0, got a request"):
        profilefit.load("burley", setting=REFRACTED, folder=tmp_path)


def test_a_record_whose_name_is_of_another_setting_is_refused(tmp_path):
    make_record(tmp_path, "burley-whole-diffuse", "burley", constants_of("burley", "published"))
    with pytest.raises(SettingError, match=r"belongs to searchlight, n = 1, g = 0, got a request for diffuse"):
        profilefit.load("burley", setting=DIFFUSE, folder=tmp_path)


def test_a_printed_set_brings_its_own_setting():
    law = profilefit.load("burley", "published:diffuse")
    assert (law.setting, law.albedo.setting) == (DIFFUSE, DIFFUSE)
    assert profilefit.load("burley", "published:diffuse", DIFFUSE) == law
    with pytest.raises(SettingError, match=r"belong to diffuse, n = 1, g = 0, got a request for searchlight"):
        profilefit.load("burley", "published:diffuse", Setting())


def test_a_law_without_constants_needs_no_record():
    """Nor a map: n = 1.35 has none."""
    for constants in ("regenerated", "published"):
        law = profilefit.load("dipole", constants, Setting(n=1.35))
        assert law.constants() == {}
        assert law.setting == Setting(n=1.35)
    with pytest.raises(InputError, match=r"constants must be one of regenerated, the path of a record .*, got 'old'"):
        profilefit.load("dipole", "old")


def test_a_law_that_was_never_regenerated_says_what_there_is():
    with pytest.raises(RecordError, match=r"of albedo chiang must be one of published, the path .*, got 'regenerated'"):
        profilefit.albedo_law("chiang")


def test_a_number_of_gaussians():
    assert "gaussians" in profilefit.names()
    assert not [name for name in profilefit.names() if ":" in name]
    assert profilefit.load("gaussians") == profilefit.load("gaussians:6")
    assert profilefit.load("gaussians:2").count() == 2
    for name in ("gaussians", "gaussians:6"):
        assert profilefit.load(name, str(fits_folder() / "gaussians-6.json")).count() == 6
    for name in ("gaussians:0", "gaussians:9", "gaussians:two", "gaussians:"):
        with pytest.raises(
            InputError, match=rf"law must be gaussians:N with N a whole number in 1 \.\.\. 8, got '{name}'"
        ):
            profilefit.load(name)
    with pytest.raises(RecordError, match=r"of gaussians:3 must be one of the path of a record .*, got 'regenerated'"):
        profilefit.load("gaussians:3")
    with pytest.raises(RecordError, match=r"holds constants of law 'gaussians:6', got a request for 'gaussians:4'"):
        profilefit.load("gaussians:4", str(fits_folder() / "gaussians-6.json"))
