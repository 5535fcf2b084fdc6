"""Settings every test shares: the seed, the size, and an account of what was skipped.

A skipped test proves nothing, so each reason must be on the list expected_skips.txt; others fail the run.
"""

import os
import re
import resource
from collections import Counter
from pathlib import Path

import numpy
import pytest
from statistics_checks import FAMILY_WISE, SIGNIFICANCE, Comparisons

EXPECTED = [
    re.compile(line)
    for line in (Path(__file__).parent / "expected_skips.txt").read_text().splitlines()
    if line and not line.startswith("#")
]
_reasons = pytest.StashKey[Counter]()
_figures = pytest.StashKey[list]()


@pytest.fixture
def seed():
    """The random seed of a statistical test: fixed, but `./dev stats` draws a fresh one."""
    return int(os.environ.get("GPIS_TEST_SEED", "1"))


@pytest.fixture(scope="session")
def full_size():
    """True under `./dev stats`: tests that have a small and a full size take the full one."""
    return bool(os.environ.get("GPIS_TEST_FULL"))


@pytest.fixture
def figure(request):
    """figure(text): what a test measured, for `./dev stats` to show at its end."""
    return request.config.stash[_figures].append


class SkipAccount:
    def __init__(self, config):
        self.reasons = config.stash[_reasons]

    def pytest_runtest_logreport(self, report):
        if report.skipped:
            self.add(report)

    def pytest_collectreport(self, report):
        if report.skipped:
            self.add(report)

    def add(self, report):
        if hasattr(report, "wasxfail"):
            reason = f"expected failure: {report.wasxfail}"
        elif isinstance(report.longrepr, tuple):
            reason = report.longrepr[2].removeprefix("Skipped: ")
        else:
            reason = str(report.longrepr)
        self.reasons[reason] += 1


def pytest_report_header():
    return f"numpy {numpy.__version__}"


def _unexpected(config):
    return [r for r in config.stash[_reasons] if not any(e.search(r) for e in EXPECTED)]


# What the whole suite takes, several times over. A test that runs away meets it and fails by name, MemoryError, where the
# system would end pytest without a word. Every core's threads have arenas of their own, which are only reserved.
ADDRESS_SPACE = (12 + (os.cpu_count() or 1)) << 30


def _limit_memory():
    """Not under sanitizers, whose shadow of the address space is larger than any limit."""
    if os.environ.get("GPIS_SANITIZE"):
        return
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    if most == resource.RLIM_INFINITY or most > ADDRESS_SPACE:
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, most))


def pytest_configure(config):
    _limit_memory()
    config.stash[_reasons] = Counter()
    config.stash[_figures] = []
    config.pluginmanager.register(SkipAccount(config))


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session):
    too_many = Comparisons.count * SIGNIFICANCE > FAMILY_WISE
    if (too_many or _unexpected(session.config)) and session.exitstatus == 0:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    if os.environ.get("GPIS_TEST_FULL"):
        for text in config.stash[_figures]:
            terminalreporter.write_line(text)
    family_wise = Comparisons.count * SIGNIFICANCE
    verdict = "" if family_wise <= FAMILY_WISE else f", more than {FAMILY_WISE:g}: too many for the significance of one"
    terminalreporter.write_line(f"{Comparisons.count} comparisons at a significance of {family_wise:.1e} together{verdict}")
    reasons, unexpected = config.stash[_reasons], _unexpected(config)
    terminalreporter.write_line(f"{sum(reasons.values())} skipped")
    for reason, count in sorted(reasons.items()):
        verdict = "NOT on the list of expected skips" if reason in unexpected else "expected"
        terminalreporter.write_line(f"  {count} x {reason} ({verdict})")
    _leave_result(terminalreporter, unexpected)


def _leave_result(terminalreporter, unexpected):
    """One line for `./dev test`, which shows those of all its pytest runs at the end."""
    path, label = os.environ.get("GPIS_TEST_RESULTS"), os.environ.get("GPIS_TEST_LABEL")
    if not path or not label:
        return
    line, _ = terminalreporter.build_summary_stats_line()
    counts = ", ".join(text for text, _ in line) or "no tests"
    if unexpected:
        counts += f", {len(unexpected)} reasons to skip that are not expected"
    with open(path, "a") as file:
        file.write(f"{label}, numpy {numpy.__version__}: {counts}\n")
