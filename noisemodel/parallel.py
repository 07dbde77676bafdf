"""One call per item, several at once if requested; results come in order."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(
    function: Callable[[Item], Result], items: Sequence[Item], *, jobs: int = 1
) -> Iterator[Result]:
    """Call a function for each item.

    Args:
        function: What to call; for several jobs it must be importable.
        items: Its arguments.
        jobs: How many to work on at once.

    Yields:
        The results, in the order of the items.
    """
    if jobs == 1 or len(items) < 2:
        yield from map(function, items)
        return
    from joblib import Parallel, delayed

    yield from Parallel(n_jobs=jobs, return_as="generator")(delayed(function)(i) for i in items)
