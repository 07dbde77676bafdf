"""Alarms and failures in whole recordings: frames of 0.4 s every 0.1 s."""

import numpy as np
import pytest
from predicted_runs import GOOD, IMPACT, OSCILLATION, blocks, frames, many, perfect, predicted

from noiseclassifier.evaluation.eventmeasures import measure
from noiseclassifier.evaluation.eventscore import score
from noiseclassifier.evaluation.intervals import Resampling
from noiseclassifier.evaluation.matching import Matched

COUNT = len(frames())


def labelled(**labels):
    """Labels of frames, by class the numbers of the frames; all others are ok."""
    names = ["ok"] * COUNT
    for label, numbers in labels.items():
        for number in numbers:
            names[number] = label
    return names


def scored(*recordings):
    return score(Matched.of(recordings))


def measured(recordings):
    return measure(
        score(Matched.of(recordings)), Resampling.of([each.group for each in recordings])
    )


def false(result):
    return int(result.alarms.false.sum())


def test_a_model_without_mistakes_finds_and_names_everything_without_false_alarms():
    events = measured(many(8))
    assert events.all_found.value == events.all_named.value == events.failure_recall.value == 1.0
    assert events.found["impact"].value == events.named["oscillations"].value == 1.0
    assert events.false_alarms == events.wrong_stretches == 0
    assert events.false_alarm_rate.value == 0.0
    assert np.isnan(events.found["highaccelerations"].value)  # there is none
    assert 0.0 < events.delay.value <= events.late_delay.value <= 0.1


def test_a_model_that_predicts_ok_everywhere_finds_nothing_and_has_no_false_alarms():
    events = measured(many(8, labelled()))
    assert events.all_found.value == events.failure_recall.value == 0.0
    assert events.false_alarms == 0
    assert events.false_alarms_per_hour.low == 0.0
    assert events.false_alarms_per_hour.high == pytest.approx(3.6889 / events.ok_hours, abs=1e-3)
    assert np.isnan(events.delay.value)
    none = scored(predicted("a", IMPACT, labelled())).alarms
    assert len(none) == len(none.start) == len(none.stop) == len(none.false) == 0


def test_a_model_that_flags_every_frame_finds_everything_with_false_alarms():
    recordings = many(8, labelled(impact=range(COUNT)))
    events = measured(recordings)
    assert events.all_found.value == events.found["oscillations"].value == 1.0
    assert events.named["oscillations"].value == 0.0
    assert events.false_alarms == 8  # one in each good run: the others run on into a failure
    assert events.wrong_stretches == 8 * 5  # which the ok blocks before and after do not forgive
    assert events.false_alarm_rate.value == 1.0


def test_one_false_alarm_of_three_frames_counts_once():
    assert false(scored(predicted("a", GOOD, labelled(impact=[10, 11, 12])))) == 1


def test_an_alarm_is_one_whatever_the_predicted_classes_of_its_frames():
    assert (
        len(scored(predicted("a", GOOD, labelled(impact=[10], oscillations=[11, 13]))).alarms) == 1
    )


def test_frames_that_touch_are_one_alarm_and_those_further_apart_are_two():
    touching = scored(predicted("a", GOOD, labelled(impact=[10, 14])))  # 1.0 to 1.4 s, 1.4 to 1.8 s
    assert len(touching.alarms) == false(touching) == 1
    assert (touching.alarms.start[0], touching.alarms.stop[0]) == pytest.approx((1.0, 1.8))
    assert false(scored(predicted("a", GOOD, labelled(impact=[10, 15])))) == 2


def test_alarms_of_two_runs_never_join():
    last, first = labelled(impact=[COUNT - 1]), labelled(impact=[0])
    result = scored(predicted("a", GOOD, last), predicted("b", GOOD, first, start=5.0))
    assert false(result) == 2
    assert [each["run"] for each in result.false_alarms()] == ["a", "b"]


def test_an_alarm_that_runs_on_into_a_failure_is_not_false_but_wrong_where_it_is_ok():
    early = range(10, 21)  # from 1.0 s on; the blow comes at 2.03 s
    result = scored(predicted("a", IMPACT, labelled(impact=early)))
    assert (false(result), result.wrong.tolist()) == (0, [1.0])
    assert result.found.tolist() == [True]


def test_an_alarm_without_annotations_around_is_neither_right_nor_false():
    gap = blocks((0.0, 1.0, "ok"), (2.0, 5.0, "ok"))
    assert false(scored(predicted("a", gap, labelled(impact=[12, 13])))) == 0
    assert false(scored(predicted("a", gap, labelled(impact=[12, 16, 20])))) == 1  # 2.0 s on is ok


def test_ok_blocks_that_touch_are_one_stretch_of_ok():
    halves = blocks((0.0, 2.5, "ok"), (2.5, 5.0, "ok"))
    assert false(scored(predicted("a", halves, labelled(impact=[23])))) == 1


def test_ok_blocks_that_overlap_or_hold_each_other_count_once():
    nested = blocks((0.0, 1.0, "ok"), (2.0, 4.0, "ok"), (2.5, 3.0, "ok"), (3.8, 4.2, "ok"))
    matched = Matched.of([predicted("a", nested)])
    assert matched.ok_annotated.tolist() == pytest.approx([1.0 + 2.2])
    assert np.flatnonzero(matched.frames.in_ok).tolist() == [*range(7), *range(20, 39)]


def test_of_several_failures_in_a_frame_it_is_that_which_fills_most():
    # Frame 10 lasts from 1.0 s to 1.4 s; both failures are in it as a whole.
    both = blocks((1.02, 1.1, "impact"), (1.15, 1.35, "oscillations"), (1.9, 2.7, "impact"))
    truth = Matched.of([predicted("a", both)]).frames.truth
    expected = {10: "oscillations", 11: "oscillations", 7: "impact", 8: "impact", 9: "impact"}
    assert {frame: truth[frame] for frame in expected} == expected
    # 0.8 s long: by half, 0.2 s, from frame 17 (1.7 to 2.1 s) to 25 (2.5 to 2.9 s).
    assert np.flatnonzero(truth == "impact")[3:].tolist() == list(range(17, 26))
    assert truth[16] == truth[26] == ""
    found = Matched.of([predicted("a", both), predicted("b", both[1:])])
    first = [7, 8, 16, COUNT + 8, COUNT + 16]
    assert found.failures.first.tolist() == first
    assert found.failures.end.tolist() == [11, 14, 27, COUNT + 14, COUNT + 27]
    assert found.failures.run.tolist() == [0, 0, 0, 1, 1]
    failing = [*range(7, 14), *range(16, 27)]
    assert np.flatnonzero(found.frames.failing[:COUNT]).tolist() == failing


def test_a_failure_is_named_by_a_frame_of_its_own_class_alone():
    result = scored(predicted("a", IMPACT, labelled(highaccelerations=[18, 19])))
    assert (result.found.tolist(), result.named.tolist()) == ([True], [False])
    result = scored(predicted("a", IMPACT, labelled(highaccelerations=[18], impact=[19])))
    assert result.named.tolist() == [True]
    beside = scored(predicted("a", IMPACT, labelled(highaccelerations=[18], impact=[30])))
    assert beside.named.tolist() == [False]


@pytest.mark.parametrize(("frame", "delay"), [(17, 0.07), (18, 0.17), (20, 0.37)])
def test_the_delay_lasts_until_the_first_flagged_frame_is_complete(frame, delay):
    # The blow starts at 2.03 s; frame 17 lasts from 1.7 s to 2.1 s.
    result = scored(predicted("a", IMPACT, labelled(impact=range(frame, 23))))
    assert result.delay.tolist() == pytest.approx([delay])


def test_a_frame_that_shares_no_more_than_a_sample_with_a_failure_does_not_find_it():
    late = blocks((0.0, 2.0, "ok"), (2.1, 2.2, "impact"))
    assert scored(predicted("a", late, labelled(impact=[17]))).found.tolist() == [False]
    sooner = blocks((0.0, 2.0, "ok"), (2.098, 2.2, "impact"))
    assert scored(predicted("a", sooner, labelled(impact=[17]))).found.tolist() == [True]


def test_what_is_missed_is_listed():
    result = scored(predicted("a", OSCILLATION), predicted("b", IMPACT, labelled()))
    assert result.missed() == [{"run": "b", "label": "impact", "start": 2.03, "stop": 2.2}]
    assert np.isnan(result.delay[1])


def test_two_failures_in_one_alarm_are_found_both():
    twice = blocks((0.0, 1.0, "ok"), (1.1, 1.2, "impact"), (1.4, 2.0, "oscillations"))
    result = scored(predicted("a", twice))
    assert (result.found.tolist(), result.named.tolist()) == ([True, True], [True, True])
    assert len(result.alarms) == 1


def test_a_frame_is_a_failure_if_it_holds_it_or_is_filled_by_it_by_half():
    truth = Matched.of([predicted("a", IMPACT)]).frames.truth
    # 0.17 s from 2.03 s on: held whole by the frames that start at 1.8, 1.9 and 2.0 s
    assert np.flatnonzero(truth == "impact").tolist() == [18, 19, 20]
    assert np.flatnonzero(truth == "ok").tolist() == [*range(17), *range(30, COUNT)]
    truth = Matched.of([predicted("a", OSCILLATION)]).frames.truth
    assert np.flatnonzero(truth == "oscillations").tolist() == [*range(9, 34)]


def test_time_in_which_no_alarm_could_be_false_is_not_counted_as_covered():
    short = blocks((0.0, 0.3, "ok"), (0.5, 0.6, "impact"), (1.05, 1.85, "ok"))
    matched = Matched.of([predicted("a", short), predicted("b", GOOD)])
    assert matched.ok_annotated.tolist() == pytest.approx([1.1, 5.0])
    assert matched.ok_covered.tolist() == pytest.approx([0.7, 5.0])  # frames from 1.1 s to 1.8 s


def test_times_may_start_anywhere():
    moved = scored(
        predicted("a", IMPACT, start=1e6), predicted("b", GOOD, labelled(impact=[3]), start=-7.0)
    )
    plain = scored(predicted("a", IMPACT), predicted("b", GOOD, labelled(impact=[3])))
    assert moved.found.tolist() == plain.found.tolist()
    assert moved.delay == pytest.approx(plain.delay, abs=1e-6)
    assert false(moved) == false(plain) == 1


def test_a_failure_in_a_gap_is_missed():
    deaf = predicted("a", blocks((0.0, 1.0, "ok"), (6.0, 6.5, "impact")))
    assert scored(deaf).found.tolist() == [False]


def test_a_recording_without_a_frame_counts_for_nothing():
    silent = predicted("a", blocks((0.0, 0.2, "impact")), [], seconds=0.4)
    empty = silent.labels.__class__(
        np.zeros(0), np.zeros(0), np.zeros(0, dtype=str), np.zeros((0, 4)), silent.labels.classes
    )
    recordings = [silent.__class__(**{**vars(silent), "labels": empty}), *many(1)]
    assert scored(*recordings).found.tolist() == [False, True, True]
    assert measured(recordings).ok_hours == measured(many(1)).ok_hours


def test_the_order_of_the_recordings_does_not_matter():
    random = np.random.default_rng(1)
    recordings = many(6)
    noisy = [
        predicted(
            each.name,
            each.blocks,
            [
                label if random.random() < 0.8 else "impact" if label == "ok" else "ok"
                for label in perfect(each.blocks)
            ],
        )
        for each in recordings
    ]
    one, other = measured(noisy), measured(noisy[::-1])
    assert 0.0 < one.false_alarms == other.false_alarms
    for name in ("all_found", "all_named", "failure_recall", "false_alarms_per_hour", "delay"):
        first, second = getattr(one, name), getattr(other, name)
        assert (first.value, first.low, first.high) == pytest.approx(
            (second.value, second.low, second.high)
        )


def test_a_robot_alone_is_measured_by_its_own_runs():
    recordings = [
        *many(6),
        *[predicted(f"go2/blow-{seed:03d}", IMPACT, labelled()) for seed in range(6)],
    ]
    resampling = Resampling.of([each.group for each in recordings])
    result = score(Matched.of(recordings))
    own = np.array([each.name.startswith("go2") for each in recordings])
    assert measure(result, resampling, own).all_found.value == 0.0
    assert measure(result, resampling, ~own).all_found.value == 1.0
    assert measure(result, resampling, own).all_found.runs == 6
    assert measure(result, resampling).all_found.value == pytest.approx(12 / 18)
