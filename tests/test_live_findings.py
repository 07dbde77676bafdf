"""Events of a stream are those of all its labels at once."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from inspector.live.labels import Findings, News
from noiseclassifier import Labels

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
    assert found.events == whole.events()


def test_what_is_over_is_forgotten_but_for_its_events():
    whole, found = labels(100 * "....II....."), Findings()
    for first in range(0, len(whole), 10):
        found.add(whole.part(slice(first, first + 10)))
    assert len(found._open) <= 5


@given(
    st.text(alphabet="..iIoOu", min_size=1, max_size=40),
    st.lists(st.integers(1, 5), max_size=40),
    st.lists(st.integers(0, 40), max_size=3).map(sorted),
)
def test_the_news_of_a_stream_end_with_its_events_each_once(text, sizes, gaps):
    whole, found, first, told = labels(text, gaps), Findings(), 0, []
    news = News(lambda event, over: told.append((event, over)))
    for size in [*sizes, len(text)]:
        found.add(whole.part(slice(first, first + size)))
        news.update(found.confirmed, found.decided)
        first += size
    news.update(found.events, float("inf"))
    ended = [event for event, over in told if over]
    assert sorted(ended, key=lambda event: (event.start, event.stop)) == list(whole.events())
    for place, event in enumerate(ended):
        begun = [each for each, over in told[: told.index((event, True))] if not over]
        assert any(each.label == event.label and each.start >= event.start for each in begun), place


@given(
    st.text(alphabet=".IO", min_size=1, max_size=40),
    st.lists(st.integers(1, 5), max_size=40),
)
def test_no_event_is_told_of_twice(text, sizes):
    whole, found, first, told = labels(text), Findings(), 0, []
    news = News(lambda event, over: told.append((event.label, event.start, over)))
    for size in [*sizes, len(text)]:
        found.add(whole.part(slice(first, first + size)))
        news.update(found.confirmed, found.decided)
        first += size
    assert len(told) == len(set(told))


def test_an_event_is_told_of_when_its_class_is_settled():
    whole, found, told = labels("...IOOOOOO....."), Findings(), []
    news = News(lambda event, over: told.append((place, event.label, over)), 0.7)
    for place in range(len(whole.start)):
        part = whole.part(slice(place, place + 1))
        found.add(part)
        news.update(found.confirmed, found.decided, float(part.stop[-1]))
    assert told == [(6, "oscillations", False), (14, "oscillations", True)]


def test_a_single_frame_above_the_threshold_is_no_news():
    whole, found, told = labels("....I......"), Findings(), []
    news = News(lambda event, over: told.append(event))
    for place in range(len(whole.start)):
        found.add(whole.part(slice(place, place + 1)))
        news.update(found.confirmed, found.decided)
    news.update(found.events, float("inf"))
    assert told == []


def test_a_finding_is_told_of_as_soon_as_it_is_confirmed_and_when_it_is_over():
    whole, found, told = labels("...III....."), Findings(), []
    news = News(lambda event, over: told.append((place, event.label, over)))
    for place in range(len(whole.start)):
        found.add(whole.part(slice(place, place + 1)))
        news.update(found.confirmed, found.decided)
    assert told == [(4, "impact", False), (10, "impact", True)]
