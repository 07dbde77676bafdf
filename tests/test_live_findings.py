"""Events of a stream are those of all its labels at once."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from inspector.live.findings import Findings
from models import Labels

NAMES = {".": "ok", "i": "impact", "o": "oscillations", "u": "unknown"}


def labels(text, gaps=()):
    start = 0.1 * np.arange(len(text)) + 5.0 * np.searchsorted(gaps, np.arange(len(text)), "right")
    generator = np.random.default_rng(len(text))
    return Labels(
        start,
        start + 0.4,
        np.array([NAMES[letter.lower()] for letter in text], dtype=str),
        generator.random((len(text), 3)),
        ("ok", "impact", "oscillations"),
        np.array([letter.isupper() for letter in text], dtype=bool),
        np.array([letter in "uI" for letter in text], dtype=bool),
    )


@given(
    st.text(alphabet="..iIoOu", min_size=1, max_size=40),
    st.lists(st.integers(1, 5), max_size=40),
    st.lists(st.integers(0, 40), max_size=3).map(sorted),
)
def test_events_of_a_stream_are_those_of_all_labels(text, sizes, gaps):
    whole, found, first = labels(text, gaps), Findings(), 0
    for size in [*sizes, len(text)]:
        found.add(whole.part(slice(first, first + size)))
        first += size
    assert found.frames == len(text)
    assert found.events == whole.events()


def test_labels_come_back_when_their_parts_are_joined():
    whole = labels("..IIu.ooO.")
    parts = [whole.part(slice(0, 3)), whole.part(slice(3, None))]
    joined = Labels.concatenated(parts)
    assert joined.events() == whole.events()
    assert joined.novel.tolist() == whole.novel.tolist()


def test_what_is_over_is_forgotten_but_for_its_events():
    found = Findings()
    for _ in range(100):
        found.add(labels("...II..."))
    assert len(found._open) == 1
