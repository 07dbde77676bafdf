"""The grid: the values of some settings of a profile, in all combinations.

A grid is written as texts, one for each setting: ``stride=224:1024:100`` counts from a first value
to a last one, both included, ``C=0.1:1000:x10`` multiplies, ``bands=comb,adjacent`` lists. The word
``paper`` stands for the grid that the paper searched.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import chain, product
from math import floor, isfinite, log, prod
from typing import Any, Self, TypeAlias

from noiseclassifier.errors import ModelsError
from noiseclassifier.profile import Kernel, Profile

Value: TypeAlias = int | float | str
Point: TypeAlias = Mapping[str, Value]

FEATURE_SETTINGS = ("window", "stride", "bands", "floor", "least_deviation")
"""Settings of the features that can be tuned."""
OWN = {
    "networks": ("networks", "units", "epochs", "decay", "alarm"),
    "trees": ("rounds", "leaves", "learning_rate", "penalty", "alarm"),
    "detector": ("rounds", "leaves", "learning_rate", "penalty", "alarm"),
    "support vector machines": ("multiclass", "gamma", "regularization"),
}
ESTIMATOR_SETTINGS = tuple(dict.fromkeys(chain.from_iterable(OWN.values())))
"""Settings of the estimators; points that differ in these alone share their features."""
SETTINGS = FEATURE_SETTINGS + ESTIMATOR_SETTINGS
"""Settings that can be tuned: all that come after framing; the last varies fastest."""
OTHER_NAMES = {"C": "regularization"}
MOST = 1_000_000
"""Points that a grid may have."""


class GridError(ModelsError):
    """A grid that cannot be searched."""


@dataclass(frozen=True)
class Grid:
    """Settings of a profile, and the values of each.

    Attributes:
        axes: Values by name of the setting, sorted as ``SETTINGS`` are.

    Raises:
        GridError: If a setting cannot be tuned, has no values or one of them twice, or the points
            are too many.
    """

    axes: Mapping[str, tuple[Value, ...]]

    def __post_init__(self) -> None:
        """Check the axes, and sort them."""
        for name, values in self.axes.items():
            if name not in SETTINGS:
                raise GridError(f"no setting {name!r} to tune; there are {', '.join(SETTINGS)}")
            if not values or len(set(values)) < len(values):
                state = "a value twice" if values else "no value"
                raise GridError(f"grid has {state} for {name}, expected one or more, each once")
        if not self.axes or len(self) > MOST:
            raise GridError(f"grid of {len(self) * bool(self.axes)} points, expected 1 to {MOST}")
        object.__setattr__(
            self, "axes", {name: self.axes[name] for name in SETTINGS if name in self.axes}
        )

    @classmethod
    def paper(cls, kernel: Kernel = "rbf") -> Self:
        """The grid that the paper searched, 24,300 points for the RBF kernel, 1,620 for the linear.

        Its values are NoisyTest's to the bit: it adds a step to a float, so that errors add up
        (C is 1.0999999999999999 where 1.1 is meant) and the last C and gamma just fall out.

        Args:
            kernel: Kernel of the profile that is tuned.
        """
        axes: dict[str, tuple[Value, ...]] = {
            "stride": tuple(range(224, 1026, 10)),
            "regularization": tuple(_added_up(0.5, 2.5, 0.1)),
        }
        if kernel == "rbf":
            axes["gamma"] = tuple(_added_up(4.5e-4, 6.0e-4, 1.0e-5))
        return cls(axes)

    @classmethod
    def of(cls, texts: Iterable[str], kernel: Kernel = "rbf") -> Self:
        """Read a grid.

        Args:
            texts: ``paper``, or a setting and its values; a later text replaces the values that
                an earlier one gave the same setting.
            kernel: Kernel of the profile that is tuned.

        Raises:
            GridError: If a text cannot be understood, or the grid cannot be searched.
        """
        axes: dict[str, tuple[Value, ...]] = {}
        for text in texts:
            if text == "paper":
                axes |= cls.paper(kernel).axes
                continue
            name, equals, values = text.partition("=")
            if not equals:
                raise GridError(f"grid {text!r}, expected paper or NAME=VALUES, say C=0.1,1,10")
            name = OTHER_NAMES.get(name, name)
            axes[name] = _values(name, values)
        return cls(axes)

    def points(self) -> Iterator[Point]:
        """Yield a value for each setting, every combination once."""
        for values in product(*self.axes.values()):
            yield dict(zip(self.axes, values, strict=True))

    def profiles(self, base: Profile) -> list[Profile]:
        """Profile of each point.

        Args:
            base: Where all other settings are from.

        Raises:
            GridError: If a setting makes no sense with this profile.
            ProfileError: If a value is out of its range, or two do not fit together.
        """
        for name, why in _idle(base):
            if name in self.axes:
                raise GridError(f"{name} does nothing with {why}; leave it out of the grid")
        for stride in self.axes.get("stride", ()):
            if isinstance(stride, int) and stride > base.length:
                raise GridError(
                    f"stride of {stride} samples is longer than a frame of {base.length}"
                )
        changes: Iterator[dict[str, Any]] = (dict(point) for point in self.points())
        return [replace(base, **each) for each in changes]

    def __len__(self) -> int:
        return prod(len(values) for values in self.axes.values())


def _idle(base: Profile) -> Iterator[tuple[str, str]]:
    """Settings that change nothing, and why."""
    estimator = base.estimator if base.estimator in OWN else "support vector machines"
    for name in ESTIMATOR_SETTINGS:
        if name not in OWN[estimator]:
            yield name, estimator
    if base.kernel == "linear":
        yield "gamma", "the linear kernel"


def _added_up(first: float, last: float, step: float) -> Iterator[float]:
    value = first
    while value <= last:
        yield value
        value += step


def _values(name: str, text: str) -> tuple[Value, ...]:
    """Read the values of a setting: words, a list of numbers, or a range of them."""
    kinds = {field.name: field.type for field in fields(Profile)}
    if kinds.get(name) not in (int, float):
        return tuple(filter(None, text.split(",")))
    parts = text.split(":")
    if len(parts) == 1:
        numbers: Sequence[float] = [_number(name, each) for each in text.split(",") if each.strip()]
    elif len(parts) == 3:
        numbers = _range(name, *parts)
    else:
        raise GridError(f"{name} is {text!r}, expected first:last:step or values with commas")
    if kinds[name] is float:
        return tuple(numbers)
    if odd := next((each for each in numbers if each != int(each)), None):
        raise GridError(f"{name} is {odd:g}, expected whole samples")
    return tuple(map(int, numbers))


def _range(name: str, first: str, last: str, step: str) -> list[float]:
    start, stop = _number(name, first), _number(name, last)
    by = _number(name, step.removeprefix("x"))
    times = step.startswith("x")
    if not (by > 1 and start > 0 if times else by > 0):
        raise GridError(
            f"{name} is {first}:{last}:{step}, expected a step above 0,"
            " or from a value above 0 by a factor above 1"
        )
    if stop < start:
        return []
    steps = log(stop / start) / log(by) if times else (stop - start) / by
    count = floor(steps + 1e-9) + 1
    if count > MOST:
        raise GridError(f"grid of {count} values of {name}, expected 1 to {MOST}")
    exact = (start * by**i if times else start + i * by for i in range(count))
    return [float(f"{each:.12g}") for each in exact]  # 0.7, and not 0.7000000000000001


def _number(name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not isfinite(number):
        raise GridError(f"{name} is {text!r}, expected a finite number")
    return number
