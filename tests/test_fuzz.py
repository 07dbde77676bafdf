"""Laws of every reader: any bytes give a result or one typed error of one line."""

import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from random import Random

import pytest
from commandline import python
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.fuzz.damage import damaged
from benchmarks.fuzz.readers import EXPECTED, READERS

ROOT = Path(__file__).parents[1]
LAWFUL = settings(
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
# Readers whose whole files take seconds to make.
LATE = ("model, small", "resume state", "tune state")


def read(name, path, data):
    """The law: a result, or one error of one line."""
    path.write_bytes(data)
    try:
        READERS[name].read(path)
    except EXPECTED as error:
        assert "\n" not in str(error)  # noqa: PT017


@pytest.fixture
def whole(tmp_path_factory, request):
    """A whole file of a reader."""
    name = request.getfixturevalue("name")
    return READERS[name].make(tmp_path_factory.mktemp("whole"))


def laws(name, whole, examples):
    data = whole.read_bytes()
    READERS[name].read(whole)

    @settings(LAWFUL, max_examples=examples)
    @given(st.one_of(st.binary(max_size=200), st.randoms(use_true_random=False)))
    def holds(given):
        kind = READERS[name].kind
        read(name, whole, damaged(data, kind, given) if isinstance(given, Random) else given)

    holds()


@pytest.mark.parametrize("name", [each for each in READERS if each not in LATE])
def test_any_bytes_give_a_result_or_one_error(name, whole):
    laws(name, whole, examples=4)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_many_bytes_give_a_result_or_one_error(name, whole):
    laws(name, whole, examples=30 * int(os.environ.get("MANY", "1")))


def test_damage_is_of_every_kind_and_reproducible():
    data = b'{"time": 0.25, "velocity": [1.0, 2.0]}\n' * 20
    made = [damaged(data, "text", Random(seed)) for seed in range(60)]
    assert made == [damaged(data, "text", Random(seed)) for seed in range(60)]
    assert len(set(made)) > 50
    assert made.count(data) < 5
    assert any(b"[[[[" in each for each in made)
    assert any(len(each) < len(data) / 2 for each in made)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_commands_handle_malformed_files(tmp_path):
    names = ("labels, NoisyTest", "CSV", "live rows, JSON")
    chosen = [each for name in names for each in ("--only", name)]
    python("-m", "benchmarks.fuzz.malformed", "--count", "1", *chosen, cwd=ROOT, status=0)


@pytest.mark.slow
@pytest.mark.skipif(find_spec("atheris") is None, reason="needs atheris (the extra `fuzz`)")
def test_fuzzing_finds_nothing():
    env = {**os.environ, "PYTHONHASHSEED": "0"}
    command = ("-m", "benchmarks.fuzz.run", "--executions", "2000")
    done = python(*command, cwd=ROOT, env=env, status=0)
    counts = dict(re.findall(r"^(.+): (\d+) executions$", done.stdout, re.M))
    assert set(counts) == set(READERS)
    assert sum(map(int, counts.values())) == 2000
