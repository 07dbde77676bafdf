"""A finding takes two frames of evidence; failure frames beside them belong to it."""

from dataclasses import replace
from itertools import groupby, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from noiseclassifier import UNKNOWN, Event, Labels

CLASSES = ("ok", "impact", "oscillations")
HOP, LENGTH = 0.1, 0.4


def labels(text, *, above_threshold=None):
    """Frames of classes by their first letters, `ok` as a dot; upper case above the threshold."""
    names = {".": "ok", **{name[0]: name for name in (*CLASSES[1:], UNKNOWN)}}
    start = HOP * np.arange(len(text))
    labels = np.array([names[letter.lower()] for letter in text], dtype=str)
    certain = (
        np.array([letter.isupper() for letter in text], dtype=bool)
        if above_threshold is None
        else above_threshold
    )
    scores = np.zeros((len(text), len(CLASSES)))
    return Labels(start, start + LENGTH, labels, scores, CLASSES, certain)


def debounced(text):
    return "".join("." if name == "ok" else name[0] for name in labels(text).debounced.tolist())


@pytest.mark.parametrize(
    ("alone", "together"),
    [
        (".iIIi.", ".iiii."),
        (".IiiiI", ".iiiii"),
        ("II.ii.", "ii...."),
        ("i.OOOi", "..oooo"),
        (".IOo..", ".ooo.."),
        ("uIIu..", "iiii.."),
        (".IuuI.", ".iiii."),
        (".Iu...", ".ii..."),
        (".iu...", "..u..."),
        (".u....", ".u...."),
        ("..uu..", "..uu.."),
        (".IuuuO", ".iiiii"),
        (".Iu.uu", ".ii.ii"),
    ],
)
def test_a_stretch_takes_two_frames_of_evidence(alone, together):
    assert debounced(alone) == together


def test_a_stretch_of_several_classes_is_one_event_of_the_class_of_most_of_its_time():
    assert [event.label for event in labels(".IOOOI.").events()] == ["oscillations"]
    assert [event.label for event in labels(".OO...IIII").events()] == ["impact"]
    assert [event.label for event in labels(".OO.....IIII").events()] == ["oscillations", "impact"]
    assert labels(".Io..").events() == ()


def test_without_an_alarm_threshold_each_failure_frame_is_flagged():
    plain = replace(labels("i.iOi"), above_threshold=None)
    assert plain.debounced is plain.label
    assert plain.raw is plain.label
    assert [event.label for event in plain.events()] == ["impact"]
    assert "".join(name[0] for name in labels(".iIIiu.").raw) == "ooiiouo"  # o: ok


def test_stretches_with_two_frames_of_evidence_are_flagged_and_lone_frames_count_twice():
    generator = np.random.default_rng(3)
    for size in [0, 1, 2, 3] * 5 + [40] * 50:
        text = "".join(generator.choice(list(".iIuoO"), size))
        apart = generator.random(max(size - 1, 0)) < 0.1
        start = np.cumsum(np.append(0.0, np.where(apart, 1.0, HOP)))[:size]
        expected = []
        for part in np.split(np.arange(size), np.flatnonzero(apart) + 1):
            for suspect, frames in groupby(part.tolist(), key=lambda frame: text[frame] != "."):
                stretch = list(frames)
                evidence = [frame for frame in stretch if text[frame] not in "io"]
                weight = sum(2 if frame in (part[0], part[-1]) else 1 for frame in evidence)
                expected += [suspect and weight >= 2] * len(stretch)
        found = replace(labels(text), start=start, stop=start + LENGTH)
        assert found.flagged.tolist() == expected


@pytest.mark.parametrize(
    ("text", "events"),
    [
        ("..uu....", ["unknown"]),
        ("..u..u..", []),
        ("u.......", ["unknown"]),
        ("..Iu....", ["impact"]),
        ("..iuui..", ["impact"]),
        ("..I.uu..", ["unknown"]),
    ],
)
def test_two_frames_out_of_distribution_in_a_row_are_a_finding(text, events):
    found = labels(text)
    assert [event.label for event in found.events()] == events
    quiet = replace(found, unknown_is_finding=False)
    assert quiet.events() == ()
    assert quiet.label is found.label
    assert len(replace(labels("..IIu..."), unknown_is_finding=False).events()) == 1


def test_an_event_states_whether_it_is_out_of_distribution():
    found = labels(".II...II.....uu.")
    novel = np.zeros(16, dtype=bool)
    novel[[7, 13, 14]] = True
    events = replace(found, novel=novel).events()
    assert [(event.label, event.novel) for event in events] == [("impact", True), ("unknown", True)]
    late = replace(found, novel=np.arange(16) == 13).events()
    assert [event.novel for event in late] == [False, True]
    assert str(events[1]).endswith("(score 1.00, out of distribution)")
    plain = Event("impact", 1.0, 1.5, 0.9)
    assert plain == Event("impact", 1.0, 1.5, 0.9, novel=False)
    assert str(plain) == "impact from 1.00 s to 1.50 s (score 0.90)"


def test_the_score_of_an_event_is_that_of_its_class_and_of_an_unknown_one_of_any_failure():
    scores = np.tile([0.1, 0.6, 0.3], (3, 1))
    for letter, score in (("I", 0.6), ("O", 0.3), ("U", 0.6)):
        found = replace(labels(3 * letter), scores=scores, above_threshold=None)
        assert [event.score for event in found.events()] == [score]


LETTERS = st.text(alphabet=".iIoOu", max_size=30)


@settings(deadline=None)
@given(LETTERS, st.data())
def test_a_frame_that_becomes_louder_never_removes_a_finding_and_events_hold_what_is_flagged(
    text, data
):
    """Louder: `ok` becomes failure or unknown, a failure exceeds the threshold, for good."""
    louder = {".": ".iIoOu", "i": "iIoOu", "o": "iIoOu", "I": "IOu", "O": "IOu", "u": "uIO"}
    changed = "".join(data.draw(st.sampled_from(louder[letter])) for letter in text)
    before, after = labels(text), labels(changed)
    assert (after.flagged >= before.flagged).all()
    events = after.events()
    assert bool(events) >= bool(before.events())
    assert not (after.debounced[after.label == UNKNOWN] == "ok").any()
    inside = np.zeros(len(text), dtype=bool)
    for event in events:
        inside |= (after.start >= event.start - 1e-9) & (after.stop <= event.stop + 1e-9)
    assert (inside >= after.flagged).all()
    assert all(one.stop < other.start for one, other in pairwise(events))


@pytest.mark.parametrize("last", [0.003, 0.05, 0.1])
def test_the_step_of_labels_does_not_depend_on_where_the_last_frame_lies(last):
    start = np.append(HOP * np.arange(5), 4 * HOP + last)
    found = Labels(start, start + LENGTH, np.full(6, "ok"), np.zeros((6, 3)), CLASSES)
    assert found.step == pytest.approx(HOP)
