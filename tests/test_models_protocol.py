"""The protocol: findings as they are reported, beside all injected faults, robots weighed alike."""

import hashlib
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from predicted_runs import CLASSES, GOOD, IMPACT, OSCILLATION, blocks, frames, predicted

from noiseclassifier import match, measures
from noiseclassifier.labels import Event, Labels
from noiseclassifier.matching import (
    SHIFTS,
    Outcome,
    confirmed_at,
    meet,
    pairs,
    run_score,
    truth_of,
    union,
)
from noiseclassifier.measures import MOST, Protocol, Resampling, auc
from noiseclassifier.recording import Fault

COUNT = len(frames())


def reporting(name, annotated, findings, *, faults=(), seconds=5.0, **facts):
    """A run with findings of these labels, starts and stops."""
    events = tuple(Event(label, start, stop, 1.0) for label, start, stop in findings)
    one = predicted(name, annotated, ["ok"] * len(frames(seconds)), seconds=seconds)
    return replace(one, located=(events, events), events=tuple(faults), facts=facts)


def exact(name, annotated, **facts):
    """A run whose findings are its failures, to the sample."""
    found = [(b.label, b.start, b.stop) for b in annotated if b.label != "ok"]
    return reporting(name, annotated, found, **facts)


def measured(runs, unanswered=()):
    return Protocol.of(runs, Resampling.of([run.group for run in runs]), unanswered)


def perfect(seeds=4, robot="talos", **facts):
    return [
        exact(f"{robot}/{scenario}-{seed:03d}", annotated, scenario=scenario, **facts)
        for seed in range(seeds)
        for scenario, annotated in (("good", GOOD), ("blow", IMPACT), ("swing", OSCILLATION))
    ]


def test_perfect_findings_score_one_without_false_alarms():
    found = measured(perfect())
    for name in measures.SHARES:
        assert found.alike[name].value == (0.0 if name == "ok_flagged" else 1.0), name
    assert found.alike["false_alarms_per_hour"].value == 0.0
    assert found.alike["alarms_in_unlabelled_per_hour"].value == 0.0
    assert found.missed() == found.false_alarms() == []


def test_a_run_that_is_flagged_throughout_has_all_of_its_ok_time_flagged():
    whole = [("impact", 0.0, 5.0)]
    found = measured([reporting(run.name, run.blocks, whole) for run in perfect()])
    assert found.alike["ok_flagged"].value == pytest.approx(1.0)
    assert found.alike["recall_injected"].value == 1.0
    # The good run's alone overlaps no failure.
    assert found.counts["false_alarms"] == 4
    assert found.alike["class_f1"].value == pytest.approx(2 * 4 / (12 + 8))


def test_robots_weigh_alike_however_many_runs_and_hours_they_have():
    deaf = [reporting(f"go2/blow-{seed:03d}", IMPACT, []) for seed in range(2)]
    few, lots = (measured([*perfect(seeds), *deaf]) for seeds in (2, 20))
    assert few.alike["recall_injected"].value == lots.alike["recall_injected"].value == 0.5
    assert few.pooled["recall_injected"].value < lots.pooled["recall_injected"].value
    loud = reporting("go2/good-000", GOOD, [("impact", 1.0, 1.5)])
    for hours, pooled in ((1, 3600 / 10), (19, 3600 / 100)):
        long = blocks((0.0, 5.0 * hours, "ok"))
        found = measured([reporting("panda/good-000", long, [], seconds=5.0 * hours), loud])
        assert found.alike["false_alarms_per_hour"].value == pytest.approx(3600 / 5 / 2)
        assert found.pooled["false_alarms_per_hour"].value == pytest.approx(pooled)


def test_as_many_pairs_as_can_be_are_matched():
    findings = [Event("impact", 1.0, 1.2, 1.0), Event("oscillations", 1.1, 2.0, 1.0)]
    faults = [Fault(1.5, 1.9, "oscillations"), Fault(0.9, 1.1, "impact"), Fault(4.0, 4.1, "impact")]
    assert sorted(match(findings, faults)) == [(0, 1), (1, 0)]
    assert match(findings[:1], faults[2:]) == match([], faults) == match(findings, []) == []
    assert match(findings[:1], faults[2:], collar=3.0) == [(0, 0)]


def truth(annotated):
    start = frames()
    return truth_of(start, start + 0.4, annotated, step=0.001)


def test_a_frame_is_a_failure_if_it_holds_it_or_is_filled_by_it_by_half():
    # 0.17 s from 2.03 s on: held whole by the frames that start at 1.8, 1.9 and 2.0 s
    assert np.flatnonzero(truth(IMPACT) == "impact").tolist() == [18, 19, 20]
    assert np.flatnonzero(truth(IMPACT) == "ok").tolist() == [*range(17), *range(30, COUNT)]
    assert np.flatnonzero(truth(OSCILLATION) == "oscillations").tolist() == [*range(9, 34)]


def test_of_several_failures_in_a_frame_it_is_that_which_fills_most():
    # Frame 10 lasts from 1.0 s to 1.4 s; both failures are in it as a whole.
    both = blocks((1.02, 1.1, "impact"), (1.15, 1.35, "oscillations"), (1.9, 2.7, "impact"))
    found = truth(both)
    expected = {10: "oscillations", 11: "oscillations", 7: "impact", 8: "impact", 9: "impact"}
    assert {frame: found[frame] for frame in expected} == expected
    # 0.8 s long: by half, 0.2 s, from frame 17 (1.7 to 2.1 s) to 25 (2.5 to 2.9 s).
    assert np.flatnonzero(found == "impact")[3:].tolist() == list(range(17, 26))
    assert found[16] == found[26] == ""


def test_spans_that_touch_are_one():
    spans = np.array([[3.0, 4.0], [0.0, 1.0], [1.0, 2.0], [0.2, 0.5]])
    assert union(spans).tolist() == [[0.0, 2.0], [3.0, 4.0]]


def test_ok_blocks_that_overlap_or_hold_each_other_are_one_stretch():
    nested = blocks((0.0, 1.0, "ok"), (2.0, 4.0, "ok"), (2.5, 3.0, "ok"), (3.8, 4.2, "ok"))
    assert np.flatnonzero(truth(nested) == "ok").tolist() == [*range(7), *range(20, 39)]


@pytest.mark.parametrize(
    ("start", "stop", "met"),
    [
        (0.1, 1.0 - 0.2, True),
        (0.1, 0.7999, False),
        (2.0 + 0.2, 3.0, True),
        (2.2001, 3.0, False),
        (1.2, 1.3, True),
    ],
)
def test_a_finding_meets_a_fault_up_to_a_fifth_of_a_second_apart(start, stop, met):
    assert meet(np.array([[start, stop]]), np.array([[1.0, 2.0]])).tolist() == [[met]]


def test_faults_that_cannot_be_detected_count_apart():
    faults = (Fault(1.05, 3.5, "oscillations"), Fault(4.0, 4.2, "impact", felt=False))
    counts = Outcome.of(exact("a", OSCILLATION, faults=faults)).counts
    assert (counts["faults"], counts["felt"]) == (2, 1)
    assert (counts["found"], counts["found_felt"], counts["onset_close"]) == (1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("start", "stop", "kind"),
    [
        (1.0, 2.0310, "false"),  # shares a sample with the failure block
        (1.0, 2.0320, "met"),  # and two
        (2.0292, 2.0312, "met"),  # shares a sample, more than half of it
        (2.0282, 2.0302, "unlabelled"),  # shares less than half
        (2.75, 3.25, "false"),  # half of it lies in ok time
        (2.74, 3.24, "unlabelled"),
        (2.5, 3.4, "unlabelled"),  # two ok blocks overlap there, whose time counts once
    ],
)
def test_a_finding_counts_by_what_it_shares_with_blocks(start, stop, kind):
    more = blocks((3.0, 4.0, "ok"))
    far = (Fault(4.6, 4.7, "impact"),)
    run = reporting("a", (*IMPACT, *more), [("unknown", start, stop)], faults=far)
    outcome = Outcome.of(run)
    assert outcome.kind.tolist() == [kind]
    assert outcome.counts["false_alarms"] == (kind == "false")
    assert outcome.counts["alarms_in_unlabelled"] == (kind == "unlabelled")


def chance_by_hand(run):
    """Mean counts over shifts of all findings by one time, which wrap around at the end."""
    begin, end = float(run.labels.start[0]), float(run.labels.stop[-1])
    seed = int.from_bytes(hashlib.sha256(run.name.encode()).digest()[:8], "big")
    offsets = np.random.default_rng(seed).uniform(0.0, end - begin, SHIFTS)
    counts = []
    for offset in offsets:
        met = np.zeros((len(run.findings), len(run.events)), dtype=bool)
        close = np.zeros_like(met)
        for row, finding in enumerate(run.findings):
            start = begin + (finding.start - begin + offset) % (end - begin)
            stop = start + finding.stop - finding.start
            pieces = [(start, min(stop, end))]
            if stop > end:
                pieces.append((begin, stop - (end - begin)))
            for column, fault in enumerate(run.events):
                met[row, column] = any(
                    a <= fault.stop + 0.2 and b >= fault.start - 0.2 for a, b in pieces
                )
                close[row, column] = met[row, column] and abs(start - fault.start) <= 0.2
        same = [[e.label == fault.label for fault in run.events] for e in run.findings]
        felt = [fault.felt for fault in run.events]
        counts.append(
            {
                "found": met.any(axis=0).sum(),
                "found_felt": met.any(axis=0)[felt].sum(),
                "onset_close": close.any(axis=0).sum(),
                "matched_by_class": len(pairs(met & same)),
            }
        )
    return {name: float(np.mean([each[name] for each in counts])) for name in counts[0]}


def test_the_level_of_chance_is_that_of_findings_shifted_one_by_one():
    faults = (
        Fault(0.3, 0.5, "oscillations", felt=False),
        Fault(2.03, 2.2, "impact"),
        Fault(4.2, 4.9, "impact"),
    )
    found = [("impact", 0.1, 1.3), ("oscillations", 1.9, 2.4), ("impact", 4.4, 4.6)]
    for number, lead in ((0, 0.0), (1, 0.0), (2, 64.0), (3, 64.0)):
        run = reporting(f"a{number}", IMPACT, found[number % 2 :], faults=faults)
        labels = replace(run.labels, start=run.labels.start + lead, stop=run.labels.stop + lead)
        moved = tuple(replace(e, start=e.start + lead, stop=e.stop + lead) for e in run.findings)
        events = tuple(f._replace(start=f.start + lead, stop=f.stop + lead) for f in run.events)
        run = replace(run, labels=labels, located=(moved, moved), events=events)
        counts = Outcome.of(run).counts
        for name, expected in chance_by_hand(run).items():
            assert counts[f"{name}_by_chance"] == pytest.approx(expected), name
    silent = Outcome.of(reporting("a", IMPACT, [], faults=faults)).counts
    assert {silent[name] for name in silent if name.endswith("_by_chance")} == {0.0}


def test_time_without_a_label_is_counted_beside_ok_time():
    counts = Outcome.of(exact("a", IMPACT)).counts
    assert counts["ok_hours"] * 3600 == pytest.approx(4.0)
    assert counts["unlabelled_hours"] * 3600 == pytest.approx(0.03 + 0.8)
    faint = Fault(2.5, 2.9, "impact", felt=False)
    both = Outcome.of(exact("a", IMPACT, faults=(Fault(2.03, 2.2, "impact"), faint))).counts
    assert both["unlabelled_hours"] * 3600 == pytest.approx(0.03 + 0.4)


@pytest.mark.parametrize(
    ("start", "share"), [(2.03, 1.0), (2.2, 1.0), (1.84, 1.0), (1.8, 0.0), (2.3, 0.0)]
)
def test_an_onset_is_right_within_a_fifth_of_a_second(start, share):
    found = measured([reporting("a", IMPACT, [("impact", start, 2.6)])])
    assert found.pooled["onset_within"].value == share


def probable(evidence, *, apart=()):
    """Labels of frames that are evidence of an impact by their numbers."""
    starts = frames() + np.searchsorted(apart, np.arange(COUNT), side="right") * 10.0
    above = np.isin(np.arange(COUNT), evidence)
    names = np.where(above, "impact", "ok")
    scores = np.where(above[:, None], [0.1, 0.9, 0, 0], [0.9, 0.1, 0, 0])
    return Labels(starts, starts + 0.4, names, scores, CLASSES, above)


@pytest.mark.parametrize(
    ("evidence", "known"),
    [
        ((17, 18, 19), 2.2),  # frame 17 ends at 2.1 s, and the next one confirms it
        ((19, 20), 2.4),
        (range(5, 25), 2.1),  # known before; the first frame that holds any of it
    ],
)
def test_a_live_listener_knows_at_the_end_of_the_frame_that_confirms(evidence, known):
    run = replace(predicted("a", IMPACT), labels=probable(evidence))
    assert Outcome.of(run).delay.tolist() == pytest.approx([known - 2.03])


def test_what_is_known_before_a_fault_starts_has_no_delay():
    fault = Fault(1.15, 1.2, "impact")  # the finding of frames 5 to 7 ends at 1.1 s
    run = replace(predicted("a", GOOD), labels=probable([5, 6, 7]), events=(fault,))
    assert Outcome.of(run).delay.tolist() == [0.0]
    late = replace(run, events=(Fault(0.9, 1.3, "impact"), Fault(3.0, 3.1, "impact")))
    delay = Outcome.of(late).delay.tolist()
    assert delay[0] == pytest.approx(1.0 - 0.9)
    assert np.isnan(delay[1])


def test_stretches_are_confirmed_where_a_count_frame_by_frame_has_enough_evidence():
    random = np.random.default_rng(4)
    for _ in range(40):
        text = random.choice(list("..ooOu"), size=COUNT)
        apart = np.flatnonzero(random.random(COUNT) < 0.1)
        labels = replace(
            probable([], apart=apart),
            label=np.array([{".": "ok", "u": "unknown"}.get(each, "impact") for each in text]),
            above_threshold=np.array([each.isupper() for each in text]),
        )
        found, count, known = confirmed_at(labels), 0, {}
        gap = np.append(True, labels.start[1:] > labels.stop[:-1])
        for frame in range(COUNT):
            if not labels.flagged[frame]:
                continue
            if gap[frame] or not labels.flagged[frame - 1]:
                begin, count = frame, 0
            beside = gap[frame] or frame == COUNT - 1 or gap[frame + 1]
            count += (2 if beside else 1) * bool(text[frame] in "Ou")
            if count >= 2:
                known.setdefault(begin, frame)
            assert found[frame] >= begin
        assert {begin: found[begin] for begin in known} == known
    assert confirmed_at(labels.part(slice(0, 0))).tolist() == []
    alone = replace(labels, above_threshold=None)
    assert confirmed_at(alone).tolist() == list(range(COUNT))


def test_the_score_of_a_run_is_that_which_two_neighbouring_frames_reach():
    scores = np.full((COUNT, 4), 0.0)
    scores[:, 0] = 1.0
    for frame, risk in ((7, 0.9), (20, 0.6), (21, 0.5)):
        scores[frame] = [1.0 - risk, risk, 0.0, 0.0]
    labels = replace(probable([]), scores=scores)
    assert run_score(labels) == pytest.approx(0.5)
    assert run_score(replace(labels, above_threshold=None)) == pytest.approx(0.9 - 0.1)
    assert np.isnan(run_score(labels.part(slice(0, 0))))
    scores[0] = [0.2, 0.8, 0.0, 0.0]
    assert run_score(replace(labels, scores=scores)) == pytest.approx(0.8)


def test_partial_auc_counts_the_faulty_runs_above_a_tenth_of_the_good_ones():
    good, faulty = np.arange(10.0), np.array([10.0, 8.5])
    area = 0.1 * 0.5  # up to one good run of ten, half of the faulty ones are above
    expected = (1 + (area - 0.005) / (0.1 - 0.005)) / 2
    assert auc(good, faulty, most=MOST) == pytest.approx(expected)


def test_domains_are_ranked_apart_and_summarised_by_their_harmonic_mean():
    def runs(domain, sign):
        scores = np.tile([[0.9, 0.1, 0.0, 0.0]], (COUNT, 1))
        loud = np.tile([[0.9 - sign * 0.2, 0.1 + sign * 0.2, 0.0, 0.0]], (COUNT, 1))
        return [
            replace(
                predicted(f"{domain}/{name}-{seed:03d}", annotated, ["ok"] * COUNT, scores=own),
                facts={"domain": domain},
            )
            for seed in range(3)
            for name, annotated, own in (("good", GOOD, scores), ("blow", IMPACT, loud))
        ]

    found = measured([*runs("a", 1), *runs("b", 0), exact("panda/good-000", GOOD, domain="c")])
    ranked = {name: part.measures for name, part in found.by["domain"].items()}
    assert [ranked[name]["auc"] for name in "ab"] == [1.0, 0.5]
    assert np.isnan(ranked["c"]["auc"])  # it has no faulty run, and counts nowhere
    assert found.auc == pytest.approx(2 / 3)
    assert (ranked["a"]["pauc"], ranked["b"]["pauc"]) == (1.0, 0.5)
    assert found.pauc == pytest.approx(2 / 3)
    assert np.isnan(measured([exact("panda/good-000", GOOD)]).auc)


def by_hand(run, collar=0.2, step=0.001):
    """Counts of a run on a grid of milliseconds and by all assignments."""
    time = np.arange(0.0, 5.0, step) + step / 2

    def during(start, stop):
        return (time > start) & (time < stop)

    ok = np.any([during(b.start, b.stop) for b in run.blocks if b.label == "ok"], axis=0)
    bad = [b for b in run.blocks if b.label != "ok"]
    kinds, flagged = [], np.zeros(len(time), dtype=bool)
    near = [
        [f.start - collar <= e.stop and e.start <= f.stop + collar for f in run.events]
        for e in run.findings
    ]
    for finding, met in zip(run.findings, near, strict=True):
        own = during(finding.start, finding.stop)
        flagged |= own
        if any(met) or any((own & during(b.start, b.stop)).any() for b in bad):
            kinds.append("met")
        else:
            kinds.append("false" if 2 * (own & ok).sum() >= own.sum() else "unlabelled")
    best = 0
    rows, columns = len(run.findings), len(run.events)
    for order in permutations(range(max(rows, columns)), rows) if rows else ():
        both = [(row, column) for row, column in enumerate(order) if column < columns]
        alike = [near[i][k] and run.findings[i].label == run.events[k].label for i, k in both]
        best = max(best, sum(alike))
    return kinds, np.sum(flagged & ok) * step, np.any(near, axis=0) if rows else [], best


def test_counts_are_those_of_a_count_by_hand():
    random = np.random.default_rng(11)
    annotated = blocks((0.0, 1.5, "ok"), (1.8, 2.0, "impact"), (2.6, 4.0, "ok"), (4.4, 5.0, "ok"))
    faults = (
        Fault(1.75, 1.9, "impact"),
        Fault(2.2, 2.3, "impact", felt=False),
        Fault(4.1, 4.15, "oscillations", felt=False),
    )
    for number in range(60):
        edges = np.sort(np.round(random.uniform(0.0, 5.0, (random.integers(0, 5), 2)), 3), axis=1)
        label = random.choice(["impact", "oscillations"])
        found = [(label, start, stop + 0.003) for start, stop in edges.tolist()]
        found = [each for each in found if each[2] < 5.0]
        outcome = Outcome.of(reporting(f"a{number}", annotated, found, faults=faults))
        kinds, flagged, hit, best = by_hand(outcome.run)
        assert outcome.kind.tolist() == kinds
        assert outcome.counts["ok_hours_flagged"] * 3600 == pytest.approx(flagged, abs=2e-3)
        assert outcome.found.tolist() == (list(hit) or [False] * 3)
        assert outcome.counts["matched_by_class"] == best
