"""docs/laws: a page for each law and map, written from the records each time the pages are built.

A page says what the law is, every set of its constants with errors, and how to make it; made of records, printed sets
and docstrings alone, it changes when they do. Files that are the same stay.
"""

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from sphinx.application import Sphinx

from mcml_sim.media.setting import Setting
from profilefit.fitting.quality import MEASURES, OF_MAP, OF_PROFILE
from profilefit.laws import MAPS, PROFILES, home, published
from profilefit.laws.base import EVERYWHERE, AlbedoLaw, Entry, Text
from profilefit.recipes.catalogue import LoadedLaw, albedo_laws, all_profiles
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import SPANS, Folder, Records, record_name, record_setting
from profilefit.report.figures.canvas import only
from profilefit.report.figures.record_figures import Plan, quality_figure
from profilefit.report.records import (
    SETS,
    TOTAL,
    Content,
    Source,
    at_index,
    by_index,
    converged,
    known_errors,
    largest_error,
    z_score,
)
from profilefit.report.tables.cells import ABSENT, significant, to_error
from profilefit.report.tables.markdown import markdown_table
from profilefit.report.tables.quality_tables import INDEX_MEASURES, ROWS, albedo_number
from profilefit.shader import emit

FIGURES = "figures"
PROFILE_MEASURES = ("rel", "ks", "l1", "inversion_error")
# The measures that the table of all laws shows.
WORST = (*OF_PROFILE, "delta_A")
MAP = "map-"
INDEX = "index"


@dataclass(frozen=True)
class Page:
    """One law or map with all its constants.

    name     of the page's file; title its heading
    members  the law with each set of constants, in the order of the inventory
    """

    name: str
    title: str
    members: tuple[LoadedLaw, ...]

    @property
    def law_classes(self) -> tuple[type, ...]:
        """The classes whose docstrings say what the law is: one, or another one of surfaces that refract."""
        name = self.members[0].name.partition(":")[0]
        whole = home((MAPS if self.members[0].law.entry.is_map else PROFILES)[name])
        spanning = [type(one.law) for one in self.members if _spans(one)]
        return tuple(dict.fromkeys([whole, *spanning]))

    @property
    def records(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for one in self.members for name in one.records))


def law_pages(folder: Folder) -> list[Page]:
    """Return every law and map that loads with the records in `folder`, profile laws first."""
    records = Records.of(folder)
    profiles = sorted(all_profiles(records), key=lambda one: one.setting.n)  # that of n = 1 first
    laws = _grouped(profiles, lambda one: one.name.split(":")[0])
    maps = _grouped(
        sorted(albedo_laws(records, matched=False), key=lambda one: one.setting.n), lambda one: MAP + one.name
    )
    titles = {name: f"{name.removeprefix(MAP)}, map between alpha and A" for name in maps}
    return [Page(name, titles.get(name, name), tuple(members)) for name, members in {**laws, **maps}.items()]


def page_text(page: Page, folder: Folder, figure: str | None = None) -> str:
    """Return one page in MyST Markdown; `figure` the path of a picture of its quality, as seen from the page."""
    parts = [
        f"# {page.title}",
        *(f"```{{eval-rst}}\n.. autoclass:: {_constructor(one)}\n   :no-members:\n```" for one in page.law_classes),
        *dict.fromkeys(_ranges(one.law.entry) for one in page.members),
        _shader(page),
    ]
    if figure:
        caption = "Errors at held-out albedos; dashed: as printed."
        parts.append(f"## Quality by albedo\n\n![Errors of {page.title} by albedo]({figure})\n\n*{caption}*")
    for one in page.members:
        parts.append(f"## {one.label}\n\n{_loading(one)}")
        parts += [text for text in (_printed(one, folder), *(_recorded(name, folder) for name in one.records)) if text]
    return "\n\n".join(parts) + "\n"


def index_text(pages: Sequence[Page], folder: Folder) -> str:
    """Return the table of all laws with the worst errors that their records state, and the list of the pages."""
    contents = _contents(folder)
    header = ("law", "constants", "light", "n", "number of constants", "R_d", "cdf", "radius", "A")
    rows = [_row(page, one, contents) for page in pages for one in page.members]
    caption = (
        "Every profile model and albedo inversion, with every set of constants of this version. Errors are the largest "
        "over held-out albedos, as the records state them. R_d is the mean relative error over radii, cdf the largest "
        "error of the cumulative energy, radius the error of the inverse cdf, and A the error of the reflectance. "
        "[Which model](../explanation/models.md) also measures sets without a record."
    )
    tree = "```{toctree}\n:hidden:\n\n" + "\n".join(page.name for page in pages) + "\n```"
    return "\n\n".join(["# All laws", caption, markdown_table(header, rows), tree]) + "\n"


def _contents(folder: Folder) -> Mapping[str, Content]:
    return Records.of(folder).contents()


def _grouped(members: Iterable[LoadedLaw], key: Any) -> dict[str, list[LoadedLaw]]:
    groups: dict[str, list[LoadedLaw]] = {}
    for one in members:
        groups.setdefault(key(one), []).append(one)
    return groups


def _spans(named: LoadedLaw) -> bool:
    """Return whether its constants hold for every index of a range."""
    n = named.law.entry.n
    return bool(named.records) and n.low < n.high


def _constructor(kind: type) -> str:
    """Return the class with the names that it is made of; a sum of so many Gaussians is made by the catalogue."""
    names = [field.name for field in fields(kind)]
    return f"{kind.__module__}.{kind.__qualname__}({', '.join(names)})"


def _row(page: Page, named: LoadedLaw, contents: Mapping[str, Content]) -> Sequence[str]:
    worst = _worst(named, contents)
    return (
        f"[{named.name}]({page.name}.md)",
        named.constants or "none",
        named.setting.illumination,
        _surface(named),
        str(len(named.law.constant_names())),
        *(significant(worst.get(key)) for key in WORST),
    )


def _surface(named: LoadedLaw) -> str:
    """Return n, or the indices that its constants span."""
    return str(named.law.entry.n) if _spans(named) else f"{named.setting.n:g}"


def _worst(named: LoadedLaw, contents: Mapping[str, Content]) -> dict[str, float]:
    """Return the largest error of each measure, from its own records or one that measured the printed set."""
    if named.records:
        every = [contents[name] for name in named.records]  # where constants span indices, of every index
        own: list[Content] = [{**content["quality"]["regenerated"], **by_index(content)} for content in every]
    else:
        own = [values for _, values in _measured_sets(named, contents)]
    return {key: MEASURES[key].worst(values[key]) for values in own for key in WORST if values.get(key) is not None}


def _measured_sets(named: LoadedLaw, contents: Mapping[str, Content]) -> Iterator[tuple[Content, Content]]:
    """Yield each record of the same law and light that measured this printed set, and the measures."""
    pipelines = ("albedo",) if isinstance(named.law, AlbedoLaw) else ("profile", "as-published", "inverse")
    which = named.constants if named.constants in SETS else SETS[0]  # records call the printed set of their light so
    for content in contents.values():
        is_own = content["law"] == named.name and content["pipeline"] in pipelines
        if is_own and record_setting(content) == named.setting and which in content["quality"]:
            yield content, content["quality"][which]


def _loading(named: LoadedLaw) -> str:
    """Return the lines by which Python and the shell get this law."""
    call = "albedo_law" if isinstance(named.law, AlbedoLaw) else "load"
    lines = [f"Light: {named.setting.illumination}, n = {named.setting.n:g}, g = {named.setting.g:g}."]
    if _spans(named):
        entry = named.law.entry
        g = f" and g in {entry.g}" if named.setting.g else ""
        choose = "`--n`, `--g`" if g else "`--n`"
        lines[0] += f" The same constants hold for every n in {entry.n}{g}: {choose} and `Setting` choose."
    lines += ["", "```python", f"profilefit.{call}({', '.join(_arguments(named))})", "```"]
    command = _export(named)
    return "\n".join([*lines, "", "```", command, "```"] if command else lines)


def _arguments(named: LoadedLaw) -> list[str]:
    """Return the arguments of `load` or `albedo_law`: name, and constants, record's path or setting."""
    name = f'"{named.name}"'
    if not named.records:
        return [name, f'constants="{named.constants}"'] if named.constants else [name]
    if named.records != tuple(record_name(base, named.setting) for base in named.law.entry.records):
        return [name, f'constants="fits/{named.records[0]}.json"']
    return [name] if named.setting == Setting() else [name, f"setting={_setting(named.setting)}"]


def _setting(setting: Setting) -> str:
    parts = [f'"{setting.illumination}"'] if setting.illumination != Setting().illumination else []
    parts += [f"n={setting.n:g}"] if setting.n != 1.0 else []
    parts += [f"g={setting.g:g}"] if setting.g != 0.0 else []
    return f"Setting({', '.join(parts)})"


def _export(named: LoadedLaw) -> str:
    """Return the command that writes this law's shader source; none where it has none."""
    if not named.law.entry.has_text:
        return ""
    if named.records:
        return f"profilefit export {named.records[0]} --lang glsl"
    name = f'"{named.law.entry.key}"' if named.law.entry.is_map and named.name in PROFILES else named.name
    return f"profilefit export {name}{f' --constants {named.constants}' if named.constants else ''} --lang glsl"


def _ranges(entry: Entry) -> str:
    """Return where the law says that it holds."""
    n = f"n = {entry.n.low:g}" if entry.n.low == entry.n.high else f"n in {entry.n}"
    profile = f", R_d in {entry.profile}" if entry.profile != entry.alpha and entry.profile != EVERYWHERE else ""
    return f"Holds for alpha in {entry.alpha}{profile}; made for a surface of {n}."


def _shader(page: Page) -> str:
    text = page.members[0].law.entry.text
    if not isinstance(text, Text):
        return f"In a shader: no source; {text}."
    prefixes = dict.fromkeys(f"`{emit.prefix(one.law)}_…`" for one in page.members)
    files = dict.fromkeys(f"`profilefit/shader/glsl/{one.law.entry.text.file}.glsl`" for one in page.members)
    return f"In a shader: {', '.join(files)}; names begin with {', '.join(prefixes)}."


def _printed(named: LoadedLaw, folder: Folder) -> str:
    """Return a printed set: its source, its constants and the errors that a record found for it."""
    own = named.law.entry.printed, named.constants
    printed = next((s for s in published.SETS if not named.records and (s.law, s.name) == own), None)
    if printed is None:
        return "" if named.records else "It has no constants: everything follows from alpha and the surface."
    table = markdown_table(("constant", "value"), [(name, f"{value:g}") for name, value in printed.constants.items()])
    contents = _contents(folder)
    measured = next(_measured_sets(named, contents), None)
    parts = [f"Source: {printed.source}.", table]
    return "\n\n".join(parts if measured is None else [*parts, _quality(measured[0], measured[1])])


def _recorded(name: str, folder: Folder) -> str:
    """Return a record: what was fitted to what, constants, quality, digests, and the command that makes it again."""
    records = Records.of(folder)
    path, content = records.paths[name], records.content(name, whole=True)
    facts = [
        f"**Record `{name}`**: {content['title']}. Equations: `{content['equations']}`",
        _fitted(content),
        _constants(content),
        _by_index(content),
        _quality(content, content["quality"]["regenerated"]),
        _digests(content, path),
        f"```\nprofilefit regenerate {name}\n```",
    ]
    return "\n\n".join(fact for fact in facts if fact)


def _fitted(content: Content) -> str:
    albedos, truth = content["protocol"]["albedos"], content["truth"]
    light = "the exact half space" if truth["kind"] == "exact" else f"{truth['photons']:,} photons"
    objective = content["protocol"]["weighting"]["objective"]
    span = f"alpha from {albedos['low']:g} to {albedos['high']:g}, {albedos['count']} even in `{albedos['spacing']}`"
    summary = f"Fitted to {light}: {span}; objective `{objective}`; the fit {content['fit']['result']}."
    return f"{summary} {content.get('note', '')}".strip()


def _constants(content: Content) -> str:
    if not converged(content):
        return f"No constants: {content['fit']['result']}."
    errors = known_errors(content["constants"].values())
    has_printed = any(value.get("published") is not None for value in content["constants"].values())
    header = ["constant", "regenerated", *(f"± {word}" for word in errors.values())]
    rows = [[name, *_with_errors(value, list(errors))] for name, value in content["constants"].items()]
    if has_printed:
        header[1:1], header[len(header) :] = ["published"], ["z"]
        for row in rows:
            one = content["constants"][row[0]]
            row[1:1], row[len(row) :] = [_plain(one.get("published"), "g")], [_plain(z_score(one), "+.1f")]
    note = f"z: (published - regenerated) over {TOTAL}, together." if has_printed else ""
    return f"{markdown_table(header, rows)}\n\n{note}".rstrip()


def _with_errors(value: Content, kinds: Sequence[str]) -> list[str]:
    """Return a constant, to the digits of its largest error, and its errors."""
    errors = [significant(value.get(key)) for key in kinds]
    held = ["held", *[ABSENT] * (len(kinds) - 1)]
    return [to_error(value["regenerated"], largest_error(value)), *(errors if value.get("free", True) else held)]


def _plain(value: float | None, form: str) -> str:
    return ABSENT if value is None else format(value, form)


def _quality(content: Content, values: Content) -> str:
    if "delta_A" in values:
        numbers = [(MEASURES[key].formula.replace("|", "\\|"), albedo_number(key, values[key])) for key in OF_MAP]
        return markdown_table(("measure", "value"), numbers)
    alpha = content["quality"]["alpha"]
    shown = np.unique(np.linspace(0, len(alpha) - 1, ROWS).round().astype(int))
    measures = [key for key in PROFILE_MEASURES if values.get(key) is not None]
    rows: list[Sequence[str]] = [(f"{alpha[i]:.3f}", *(significant(values[key][i]) for key in measures)) for i in shown]
    rows.append(("worst", *(significant(MEASURES[key].worst(values[key])) for key in measures)))
    meaning = "; ".join(f"`{key}`: {MEASURES[key].formula}" for key in measures)
    return f"{markdown_table(('alpha', *measures), rows)}\n\n{meaning}."


def _by_index(content: Content) -> str:
    """Return the worst measures at each index that a record was judged at; what follows is at that of its setting."""
    worst = by_index(content)
    if not worst:
        return ""
    keys = [key for key in INDEX_MEASURES if key in worst]
    places = [name for name in SPANS if name in worst]
    rows = [
        (*(f"{worst[name][i]:g}" for name in places), *(significant(worst[key][i]) for key in keys))
        for i in range(len(worst["n"]))
    ]
    meaning = "; ".join(f"`{key}`: {MEASURES[key].formula}" for key in keys)
    table, by = markdown_table((*places, *keys), rows), "refractive index" + (" and g" if "g" in worst else "")
    return f"By {by}, the worst albedo:\n\n{table}\n\n{meaning}.\n\nAt{at_index(content).removeprefix(',')}:"


def _digests(content: Content, path: Path) -> str:
    data = content.get("data_digest")
    lines = [f"sha256 of the data   {data}"] if data else []
    lines.append(f"sha256 of the record {hashlib.sha256(path.read_bytes()).hexdigest()}")
    return "```\n" + "\n".join(lines) + "\n```"


def write_pages(app: Sphinx) -> None:
    """All pages, and for each law with records a figure of its errors; what is left of other laws goes."""
    records, out = fits_folder(), Path(app.srcdir) / "laws"
    out.mkdir(exist_ok=True)
    pages = law_pages(records)
    texts = {page.name: page_text(page, records, drawn(page, records, out)) for page in pages}
    texts[INDEX] = index_text(pages, records)
    for stale in {path.stem for path in out.glob("*.md")} - set(texts):
        (out / f"{stale}.md").unlink()
    for name, text in texts.items():
        path = out / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def drawn(page: Page, records: Path, out: Path) -> str | None:
    """The figure of a page's errors by albedo, as seen from the page; none where no record measured profiles."""
    source = Source(records, page.records)
    if not any("rel" in source.content(name)["quality"]["regenerated"] for name in page.records):
        return None
    with only("svg"):
        (file,) = Plan(f"quality-{page.name}", (), (), quality_figure).drawn(source, out / FIGURES)
    return f"{FIGURES}/{file.name}"


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
