import numpy as np
import pytest
from test_noisemodel_noise import arm_run

from inspector.localisation import Localisation, fault_links
from noiseclassifier import Event
from noisemodel.noise import LinkNoise, link_noise

LINKS = ("body", "thigh", "foot", "other_foot")
MOVERS = (set(), {"hip"}, {"hip", "knee"}, {"other_knee"})
BLOW, RATTLE = Event("impact", 1.0, 1.4, 1.0), Event("oscillations", 2.0, 2.5, 1.0)


def noise(**excess):
    """Links that hum at 1 mW, and louder as given: from, to, and by how much."""
    time = np.arange(300) / 100 + 0.005
    vibration = np.full((300, len(LINKS)), 1e-3)
    for link, (start, stop, power) in excess.items():
        vibration[(time > start) & (time < stop), LINKS.index(link)] += power
    movers = tuple(map(frozenset, MOVERS))
    return LinkNoise("normal", LINKS, movers, time, vibration, vibration, ())


def blow(*joints, onset=1.0):
    """Localisation of a blow with innovation in some joints."""
    return Localisation("measured", joints=tuple((joint, 0.5) for joint in joints), onset=onset)


def test_a_rattling_joint_is_named_by_its_link():
    for joint, link in ((5, "wrist_3_link"), (4, "wrist_2_link")):
        named = dict(fault_links(link_noise(arm_run(joint)), RATTLE, [RATTLE]))
        assert link in named
        assert "shoulder_link" not in named
        assert sum(named.values()) <= 1.0 + 1e-12


def test_shares_are_of_the_whole_excess():
    links = noise(body=(1.0, 1.4, 0.6), thigh=(1.0, 1.4, 0.3), foot=(1.0, 1.4, 0.1))
    named = fault_links(links, BLOW, [BLOW])
    assert [link for link, _ in named] == ["body", "thigh", "foot"]
    assert [share for _, share in named] == pytest.approx([0.6, 0.3, 0.1])


def test_the_beginning_of_a_blow_counts_and_all_of_a_vibration():
    links = noise(foot=(1.0, 1.05, 0.5), other_foot=(1.1, 1.4, 0.5))
    assert [link for link, _ in fault_links(links, BLOW, [BLOW], known=blow())] == ["foot"]
    lasting = Localisation("commanded", "measured", 0.001)
    assert fault_links(links, BLOW, [BLOW], known=lasting)[0][0] == "other_foot"


def test_a_limb_whose_joints_fail_is_named_though_others_are_louder():
    loud = {
        link: (1.0, 1.4, power) for link, power in zip(LINKS, (0.4, 0.3, 0.2, 0.1), strict=True)
    }
    links = noise(**loud)
    plain = [link for link, _ in fault_links(links, BLOW, [BLOW], known=blow("hip"))]
    assert plain == ["body", "thigh", "foot"]
    named = fault_links(links, BLOW, [BLOW], known=blow("other_knee"))
    assert [link for link, _ in named] == ["body", "thigh", "other_foot"]
    assert [share for _, share in named] == pytest.approx([0.4, 0.3, 0.1])


def test_a_failure_without_excess_or_after_the_end_of_the_noise_has_no_links():
    assert fault_links(noise(), BLOW, [BLOW], known=blow("hip")) == ()
    late = Event("impact", 5.0, 5.4, 1.0)
    assert fault_links(noise(foot=(1.0, 1.4, 0.5)), late, []) == ()
