"""CPU seconds by file of tests: the dearest are printed; those over `--budget` fail the run.

CPU time, since a busy neighbour takes none of it; of processes that tests start, too, once they have ended.
"""

import os
from collections import Counter
from itertools import chain

import pytest

SHOWN = 12
LONGEST = "test_mutations.py"
_last = 0.0  # when this process last reported


def spent() -> float:
    return sum(os.times()[:4])


def pytest_addoption(parser):
    parser.addoption("--budget", type=float, help="CPU seconds that a file's tests may take which are not slow")


def pytest_collection_modifyitems(items):
    """Begin with the longest file: no core waits for it at the end."""
    items.sort(key=lambda item: item.path.name != LONGEST)


def pytest_runtest_logstart():
    global _last
    _last = spent()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """Of each of a test's three phases; xdist carries the report's attributes to the process that prints."""
    global _last
    report = yield
    report.cpu_seconds, _last = spent() - _last, spent()
    return report


def by_file(config, quick_only=False):
    seconds, reporter = Counter(), config.pluginmanager.get_plugin("terminalreporter")
    for report in chain.from_iterable(reporter.stats.values()):
        if hasattr(report, "cpu_seconds") and not (quick_only and "slow" in report.keywords):
            seconds[report.nodeid.partition("::")[0]] += report.cpu_seconds
    return seconds


def pytest_sessionfinish(session):
    budget = session.config.getoption("budget")
    if budget and any(one > budget for one in by_file(session.config, quick_only=True).values()):
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    seconds, budget = by_file(config), config.getoption("budget")
    terminalreporter.section(f"CPU seconds: {sum(seconds.values()):.0f} in {len(seconds)} files")
    for name, one in seconds.most_common(SHOWN):
        terminalreporter.line(f"{one:7.1f}  {name}")
    for name, one in by_file(config, quick_only=True).items():
        if budget and one > budget:
            terminalreporter.line(f"{name}: {one:.1f} CPU seconds without slow tests, of {budget:g} at most", red=True)
