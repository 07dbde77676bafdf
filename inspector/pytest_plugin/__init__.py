"""The plugin of pytest: its options, and the fixture `noise`, which `noisecheck` has.

Every run of pytest imports this module: it imports nothing that takes long.
"""

import os
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from inspector.pytest_plugin.noisecheck import Noise


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("noise", "noise of robots (noise-inspector)")
    group.addoption(
        "--noise-accept",
        metavar="REASON",
        help="accept the runs of noise.check into the reference, and compare nothing",
    )
    group.addoption(
        "--noise-model",
        metavar="FILE",
        action="append",
        help="classify by this model only: a file, or the name of a shipped one; repeatable",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Refuse to accept runs without a reason, or where no person does."""
    reason = config.getoption("--noise-accept")
    if reason is not None and not reason.strip():
        raise pytest.UsageError("--noise-accept: say why the runs are accepted")
    if reason and os.environ.get("CI", "").lower() in ("true", "1"):
        raise pytest.UsageError("CI=true: a person accepts runs, after review (CI= overrides)")


@pytest.fixture
def noise(request: pytest.FixtureRequest) -> "Noise":
    """An assertion on the noise of runs: `check`."""
    from inspector.pytest_plugin.noisecheck import Noise

    return Noise(request)
