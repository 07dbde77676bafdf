"""What several test modules need: a cache of their own, and the reference data if at hand."""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import hypothesis
import numpy as np
import pytest

# `accept` writes nothing where CI is set; the tests of that set it themselves.
os.environ.pop("CI", None)
hypothesis.settings.register_profile("untimed", deadline=None)  # machines differ in speed
hypothesis.settings.load_profile("untimed")
SHARED = Path(__file__).parents[2] / "shared"


@pytest.fixture(autouse=True, scope="session")
def cache(tmp_path_factory):
    """A cache folder of the tests' own: nothing is read from the user's, nothing is left there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def simulate():
    """The robot of `examples/accept`."""
    folder = str(Path(__file__).parents[1] / "examples" / "accept")
    sys.path.insert(0, folder)
    try:
        import simulate

        yield simulate
    finally:
        sys.path.remove(folder)


@pytest.fixture(scope="session")
def lola():
    """A folder of synthetic logs in NoisyTest's form, made once and kept for the next time."""
    script = SHARED / "tools" / "standin_lola.py"
    if not script.exists():
        pytest.skip("needs shared/tools/standin_lola.py, the generator of the stand-in data")
    key = hashlib.sha256(script.read_bytes()).hexdigest()[:12]
    folder = Path(tempfile.gettempdir()) / f"noise-inspector-lola-{key}"
    if not folder.exists():
        with tempfile.TemporaryDirectory(dir=folder.parent) as fresh:
            subprocess.run([sys.executable, script, f"{fresh}/lola"], check=True)
            try:
                Path(fresh, "lola").rename(folder)
            except OSError:  # another test process was faster
                assert folder.exists()
    return folder


@pytest.fixture(scope="session")
def golden():
    """What NoisyTest 0.0.1 itself computes on the stand-in: arrays, and results by kernel."""
    folder = SHARED / "golden" / "noisytest"
    if not folder.exists():
        pytest.skip("needs shared/golden/noisytest, the outputs of NoisyTest")
    with np.load(folder / "golden.npz", allow_pickle=False) as arrays:
        return dict(arrays), json.loads((folder / "golden.json").read_text())["results"]


@pytest.fixture
def apart(monkeypatch):
    """Compile MJCF in a process of its own, which has a second of processor time and takes 0.3."""
    whole = subprocess.run

    def run(command, **options):
        code = command[-1].replace("mjcf.", "mjcf.SECONDS = 1; mjcf.", 1)
        return whole([*command[:-1], code], **options)

    monkeypatch.setattr(subprocess, "run", run)
