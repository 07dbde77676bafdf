"""Events of a stream are those of all its labels at once."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inspector.live.labels import Findings, News
from noiseclassifier import Labels

NAMES = {".": "ok", "i": "impact", "o": "oscillations", "u": "unknown"}
TEXT = st.text(alphabet="..iIoOu", min_size=1, max_size=40)
SIZES = st.lists(st.integers(1, 5), max_size=40)


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


def streamed(whole, sizes, wait=0.0):
    """Findings of labels that come in pieces, and what is told of them after how many frames."""
    found, told, count = Findings(), [], 0
    news = News(lambda event, over: told.append((count, event, over)), wait)
    for size in [*sizes, len(whole)]:
        part = whole.part(slice(count, count + size))
        count += len(part)
        if len(part):
            found.add(part)
            news.update(found.confirmed, found.decided, float(part.stop[-1]))
    news.update(found.events, inf)
    return found, told


@given(TEXT, SIZES, st.lists(st.integers(0, 40), max_size=3).map(sorted))
def test_events_of_a_stream_are_those_of_all_labels_and_end_each_once(text, sizes, gaps):
    whole = labels(text, gaps)
    found, told = streamed(whole, sizes)
    assert found.events == whole.events()
    news = [(event, over) for _, event, over in told]
    assert len(news) == len({(event.label, event.start, over) for event, over in news})
    ended = [event for event, over in news if over]
    assert sorted(ended, key=lambda event: (event.start, event.stop)) == list(whole.events())
    for place, event in enumerate(ended):
        begun = [each for each, over in news[: news.index((event, True))] if not over]
        assert any(each.label == event.label and each.start >= event.start for each in begun), place


def test_what_is_over_is_forgotten_but_for_its_events():
    found, _ = streamed(labels(100 * "....II....."), 110 * [10])
    assert len(found._open) <= 5


@pytest.mark.parametrize(
    ("text", "wait", "expected"),
    [
        # As soon as it is confirmed, and when it is over.
        ("...III.....", 0.0, [(5, "impact", False), (11, "impact", True)]),
        # When its class is settled.
        ("...IOOOOOO.....", 0.7, [(7, "oscillations", False), (15, "oscillations", True)]),
        # A single frame above the threshold is no news.
        ("....I......", 0.0, []),
    ],
)
def test_a_finding_is_told_of_when_it_is_confirmed_and_settled(text, wait, expected):
    _, told = streamed(labels(text), len(text) * [1], wait)
    assert [(count, event.label, over) for count, event, over in told] == expected
