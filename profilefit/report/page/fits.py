"""What was fitted from what: all records at a glance, then each with tables, figures and the command that makes it."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from profilefit.report.figures import PAPER, plans, record_plans
from profilefit.report.page.drawings import drawn
from profilefit.report.page.markup import command, details, element, markup
from profilefit.report.page.provenance import again
from profilefit.report.source import Source
from profilefit.report.tables import record_tables, summary


def overview(source: Source) -> str:
    """A line a record."""
    return markup(summary({name: source.content(name) for name in source.paths}))


def whole_figure(source: Source, name: str) -> str:
    """A figure of more than one record: constants, printed against regenerated, or quality by albedo."""
    (plan,) = (one for one in plans(source) if one.name == name)
    return drawn(plan, source)


def paper_figures(source: Source) -> Iterator[str]:
    """The figures of the paper again, as far as there are records for them."""
    for plan in PAPER:
        if all(name in source.paths for name in plan.needs):
            yield drawn(plan, source)


def record_part(source: Source, name: str, figures: bool = True) -> str:
    """Everything of one record, folded; without `figures` only what its .json says."""
    content = source.content(name)
    tables = "\n".join(markup(part) for part in record_tables(content))
    plans_of = record_plans(source, name) if figures else ()
    drawings = "\n".join(drawn(plan, source) for plan in plans_of if not plan.missing)
    command_again = command("\n".join(again({name: content})))
    title = element("b", escape(name)) + " " + element("span", escape(content["title"]), class_="dim")
    return details(title, element("div", tables + drawings + command_again, class_="record"), f"record-{name}")
