"""A page with the explorer in it, made once for all its tests."""

import pytest

from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import profile_laws
from profilefit.report.explorer import explorer_section
from profilefit.report.explorer.offered import address

PAGE = (
    '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">{}'
)


@pytest.fixture(scope="session")
def fits():
    return catalogue.fits_folder()


@pytest.fixture(scope="session")
def fragment(fits):
    return explorer_section(fits)


@pytest.fixture(scope="session")
def file(fragment, tmp_path_factory):
    """A page with nothing but the explorer: its own colours, its own font size."""
    path = tmp_path_factory.mktemp("explorer") / "page.html"
    path.write_text(PAGE.format(fragment))
    return path


@pytest.fixture(scope="session")
def laws(fits):
    return {address(named): named.law for named in profile_laws(fits)}
