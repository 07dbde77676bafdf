"""What comparisons of noise models say, as CSV for programs."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from inspector.comparison.compared import BANDS, Compared, labels_of
from noisemodel.atomic import replacing
from noisemodel.comparison import TERMS

Row = dict[str, str | int]


def write_csv(found: Sequence[Compared], path: Path, *, overwrite: bool = False) -> None:
    """Write a row for each robot and kind.

    Args:
        found: One comparison or more.
        path: The file to write.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
    """
    labels = labels_of(found)
    rows = [row for one in found for row in _rows(one, labels)]
    with (
        replacing(path, overwrite=overwrite) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _rows(one: Compared, labels: Sequence[str]) -> Iterator[Row]:
    found, held = one.found, one.reference
    for index, kind in enumerate(one.kinds):
        distances = zip(BANDS, one.by_band(index), strict=True)
        contrasts = zip(labels, one.by_label(index, labels), strict=True)
        loudest = found.shares[index].argmax()
        numbers = {
            "correlation": found.correlation[index, held],
            "distance_db": found.distance[index, held],
            **{f"distance_{_band(*band)}_db": distance for band, distance in distances},
            **{f"contrast_{label}_db": contrast for label, contrast in contrasts},
            "loudest_share": found.shares[index, loudest],
        }
        yield {
            **_facts(one),
            "kind": kind,
            "reference": one.kinds[held],
            **{name: f"{number:.4f}" for name, number in numbers.items()},
            "loudest_link": found.names[loudest],
        }


def _facts(one: Compared) -> Row:
    """Say what does not depend on the kind."""
    shares = zip(TERMS, one.found.terms.sum(axis=0), strict=True)
    return {
        "name": one.name,
        "floating_base": int(one.floating_base),
        "joints": one.joints,
        "links": len(one.found.names),
        "links_with_surface": one.with_surface,
        "rate_hz": f"{one.rate:g}",
        **{f"share_{term}": f"{share:.4f}" for term, share in shares},
    }


def _band(low: float, high: float) -> str:
    return f"{low:.0f}_up" if np.isinf(high) else f"{low:.0f}_{high:.0f}"
