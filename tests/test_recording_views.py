import numpy as np
import pytest

from inspector.recording import views
from inspector.recording.views import AXIS, TEXT, Panel

PANEL = Panel("a", 118.0)


def test_a_label_stands_where_its_place_or_its_row_is_in_the_plot():
    # In windows of 1440 x 900 and 1920 x 1080 the panel is 1.05 and 1.3 times as high.
    for height in (1.05 * PANEL.height, 1.3 * PANEL.height):
        for place in (0.0, 0.5, 0.8):
            middle = PANEL.y(place) * height + TEXT
            assert middle == pytest.approx((1 - place) * (height - AXIS), abs=5.0)
        assert PANEL.y(1.0) * height + TEXT >= 9.0  # none is cut by the upper edge
    places = [label.place for label in views.row_labels(["a", "b", "c"])]
    np.testing.assert_allclose(np.array(views.middles(3)) / views.TOP, places)
    assert places == sorted(places, reverse=True)  # the first at the top


@pytest.mark.parametrize(
    ("low", "high"), [(9.8, 5000.0), (9.8, 500.0), (2.4, 40.0), (10.0, 3000.0)]
)
@pytest.mark.parametrize("height", [120.0, 176.0, 400.0])
def test_ticks_are_round_apart_and_within_the_axis(low, high, height):
    found = views.ticks(low, high, Panel("a", height))
    assert len(found) >= 1
    assert low * 0.999 <= found[0]
    assert found[-1] <= high
    decade = (height - AXIS) / np.log10(high / low)
    if len(found) > 1 and not all(np.log10(tick) % 1 == 0 for tick in found):
        assert np.diff(np.log10(found)).min() * decade >= views.APART
    assert all(f"{tick:.0e}"[0] in "1235" for tick in found)
