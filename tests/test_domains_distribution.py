"""Domains are drawn by seed, within the distribution and what a family bears."""

import numpy as np
import pytest

from noiseclassifier.scenarios.domains import RATES, SETTINGS, Domain, Limits, Logger

FREE = Limits()


def domains(count=200, limits=FREE):
    return [Domain.draw(np.random.default_rng(seed), limits) for seed in range(count)]


def loggers(count=200):
    return [
        Logger.draw(np.random.default_rng(seed), domain, most=10_000.0)
        for seed, domain in enumerate(domains(count))
    ]


def test_values_lie_between_the_ends():
    for name, drawn in (
        *((name, domains()) for name in ("payload", "gear", "torque_limit", "torque_rise")),
        *((name, loggers()) for name in ("noise", "jitter", "gear")),
    ):
        ends, values = SETTINGS[name]["ends"], [getattr(one, name) for one in drawn]
        assert min(ends) <= min(values) <= max(values) <= max(ends), name


def test_the_far_ends_are_drawn_by_wild_runs_only():
    mild = [d.stiffness for d in domains(500) if d.wildness < 0.2 and d.control != "impedance"]
    wild = [d.stiffness for d in domains(500) if d.wildness > 0.8]
    assert min(mild) > 0.5
    assert min(wild) < 0.15


def test_every_kind_of_control_and_of_log_is_drawn():
    assert {d.control for d in domains()} == {"pd", "computed-torque", "impedance", "policy"}
    assert {log.velocity for log in loggers()} == {"measured", "filtered", "differentiated"}
    assert {log.desired for log in loggers()} == {"commanded", "planned", "zero", "missing"}
    assert {log.rate for log in loggers(500)} == set(RATES)
    assert {log.hold > 1 for log in loggers()} == {True, False}


def test_some_logs_have_efforts_and_of_these_half_are_currents():
    drawn = loggers(500)
    kinds = [log.effort for log in drawn]
    assert kinds.count("missing") / 500 == pytest.approx(0.4, abs=0.06)
    assert kinds.count("current") / 500 == pytest.approx(0.3, abs=0.06)
    for log in drawn:
        assert (log.current > 0) == (log.effort == "current")
        assert 9 <= log.effort_bits <= 16
        assert 0.0003 <= log.effort_noise <= 0.01


def test_what_a_family_does_not_bear_is_not_drawn():
    limits = Limits(stiffness=(0.5, 1.0), damping=(0.6, 1.1), delay=2e-3, hold=0.01)
    for domain in domains(limits=limits):
        assert 0.5 <= domain.stiffness <= 1.0
        assert 0.6 <= domain.damping <= 1.1
        assert domain.delay <= 2e-3
        assert domain.policy_rate == 0 or domain.policy_rate >= 100 - 1e-9


def test_a_part_of_the_domains_is_never_learnt_from():
    assert {d.target for d in domains()} == {True, False}
    assert all(d.target == (d.control == "impedance") for d in domains())
    shares = np.mean([log.target for log in loggers(500)])
    assert 0.05 < shares < 0.4
