import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def bench():
    """Imports a module of the benchmarks by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        patch.setenv("OMP_NUM_THREADS", "1")
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        yield lambda name: importlib.import_module(f"benchmarks.{name}")


def test_a_row_has_both_medians_and_the_ratio_of_the_other_to_ours(bench):
    row = bench("table").Row("labels", 0.05, "real time", 10.0, wanted=100.0)
    assert str(row) == "| labels | real time | 50 ms | 10 s | 200 | ≥ 100 |"


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ({"other": 10.0, "wanted": 4.0}, "| 10 s | 5 | ≥ 4 |"),
        ({"other": 10.0, "wanted": 6.0}, "| 10 s | 5 | ≥ 6 (missed) |"),
        ({"most": 2.0}, "| – | – | ≤ 2 s |"),  # noqa: RUF001
        ({"most": 0.5}, "| – | – | ≤ 500 ms (missed) |"),  # noqa: RUF001
        ({"wanted": 6.0}, "| – | – | ≥ 6 |"),  # noqa: RUF001
    ],
)
def test_a_row_says_what_was_wanted_and_whether_it_was_missed(bench, limits, text):
    assert str(bench("table").Row("labels", 2.0, **limits)).endswith(f"2 s {text}")


def test_sides_take_turns_and_the_median_counts(bench):
    calls, times = [], {"ours": iter([9.0, 1.0, 5.0, 3.0]), "other": iter([9.0, 2.0, 2.0, 8.0])}

    def side(name):
        return lambda: calls.append(name) or next(times[name])

    found = bench("table").in_turns({name: side(name) for name in times}, 3, warm=1)
    assert calls == ["ours", "other"] * 4
    assert found == {"ours": 3.0, "other": 2.0}


def test_mutants_are_of_what_fast_tests_measure(bench):
    mutation = bench("mutation")
    files = {
        path.relative_to(ROOT).as_posix()
        for place in mutation.MEASURED
        for path in mutation.modules(ROOT / place)
    }
    assert all(any(place in file for file in files) for place in mutation.MEASURED)
    assert not any("scenarios" in file for file in files)
