"""A fit of a stack of layers as tables, as sentences, and as JSON content."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from rich.console import RenderableType

from profilefit.fitting.misfit import DETECTED
from profilefit.measured.identifiability import LOOSE
from profilefit.measured.layers import LayersFit
from profilefit.recipes import record
from profilefit.report.tables.cells import ABSENT, column_table, interval, significant, to_error
from profilefit.report.tables.fit_tables import p_value

UNKNOWN = "not identified"
MOST = 9.0  # relative error, as a logarithm, beyond which a product is not known at all


def layers_tables(fit: LayersFit, title: str) -> list[RenderableType]:
    """Return what is free, with errors and correlations; and the products of powers that the data know, best first."""
    free = {
        "": fit.names,
        "value": [to_error(value, value * error) for value, error in zip(fit.values, fit.errors, strict=True)],
        "±": [significant(value * error) for value, error in zip(fit.values, fit.errors, strict=True)],
        "95 %": [
            UNKNOWN if name in fit.loose else interval(ends)
            for name, ends in zip(fit.names, fit.intervals.tolist(), strict=True)
        ],
        "unit": [_unit(name, fit.data.unit) for name in fit.names],
    }
    for at, name in enumerate(fit.names[:-1]):
        free[name] = [f"{fit.correlation[row, at]:.2f}" if row > at else "" for row in range(len(fit.names))]
    caption = "±: from the errors of the data, wider where they do not explain the residuals; right: correlations"
    products = {
        "product": [fit.product(at) for at in range(len(fit.products))],
        "known to": [f"{100 * error:.2g} %" if error < MOST else ABSENT for _, error in fit.products],
    }
    parts = [column_table(title, free, caption, left=("", "unit"))]
    if len(fit.names) > 1:
        parts.append(column_table("What the data know, best first", products, left=("product",)))
    return list(parts)


def layers_lines(fit: LayersFit) -> Iterator[str]:
    """Yield a sentence each on what was held, the goodness of fit, and what is not identified."""
    if fit.result != "converged":
        yield f"the fit failed: {fit.result}"
    for number, layer in enumerate(fit.medium.layers, start=1):
        thick = "endless" if math.isinf(layer.thickness) else f"d {layer.thickness:.4g}"
        yield f"layer {number}: n {layer.n:g}, mu_a {layer.mu_a:.4g}, mu_s {layer.mu_s:.4g}, {thick}"
    yield (
        f"chi-square {fit.chi2:.1f} for {fit.freedom} degrees of freedom"
        f"{' (at most: the errors are bounds)' if fit.data.bounded else ''}, p-value {p_value(fit.chance)}: "
        + ("THESE LAYERS DO NOT EXPLAIN THE DATA" if fit.chance < DETECTED else "no misfit is detected")
    )
    for name in fit.loose:
        yield f"{name} IS NOT IDENTIFIED: its error is more than {100 * LOOSE:.0f} %; hold it, or measure elsewhere"


def layers_content(fit: LayersFit) -> dict[str, Any]:
    """Return all results as JSON content."""
    data = fit.data
    plain: dict[str, Any] = record.plain(
        {
            "data": {"file": data.source, "sha256": data.digest, "unit": data.unit, "inner": data.inner,
                     "outer": data.outer, "value": data.value, "sigma": data.sigma, "notes": data.notes},
            "light": fit.light,
            "setting": fit.premises.setting,
            "beam": None if fit.premises.instrument.beam is None else fit.premises.instrument.beam.words,
            "start": fit.start,
            "medium": fit.medium,
            "free": fit.names,
            "values": fit.values,
            "relative_errors": fit.errors,
            "intervals_95": fit.intervals,
            "correlation": fit.correlation,
            "products": [{"exponents": powers, "relative_error": error} for powers, error in fit.products],
            "chi2": fit.chi2,
            "freedom": fit.freedom,
            "p_value": fit.chance,
            "not_identified": fit.loose,
            "result": fit.result,
            "versions": record.versions(),
        }
    )  # fmt: skip
    return plain


def _unit(name: str, unit: str) -> str:
    if name == "scale":
        return ""
    return (unit or "unit of r") if name[0] == "d" else f"1/{unit or 'unit of r'}"
