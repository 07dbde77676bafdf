"""Layouts for Foxglove and PlotJuggler that open an exported MCAP as the recording looks.

From top to bottom: the class (in Foxglove), the noise, its level above 10 Hz, the probability of a
failure with the alarm threshold, and the velocities of the joints, measured and desired; in
Foxglove the findings are listed at the left. Neither has a spectrogram of its own.
"""

import json
from typing import Any
from xml.etree import ElementTree

from inspector import colors
from inspector.export.content import Content
from inspector.export.mcap import DESIRED, MEASURED, joint_signals

LEVEL = "level above 10 Hz [dB re 1 rad/s]"
LISTED = 12
"""A legend with more lines would cover the plot."""


def foxglove(content: Content) -> str:
    """A layout of Foxglove, to be imported there, as JSON.

    Args:
        content: What was exported.
    """
    over_time: dict[str, tuple[dict[str, Any], float]] = {}
    if content.analysis.labels is not None:
        state = {"value": "/class.label", "label": "class", "timestampMethod": "receiveTime"}
        over_time["StateTransitions!class"] = ({"paths": [state], "isSynced": True}, 1.0)
    noise = {"/noise.simplified": ("noise, simplified [rad/s]", colors.NOISE)}
    over_time["Plot!noise"] = (_foxglove_plot("Noise", noise), 2.0)
    level = {"/level.level": (LEVEL, colors.NOISE)}
    over_time["Plot!level"] = (_foxglove_plot(LEVEL, level), 1.5)
    if content.analysis.labels is not None:
        failure = {"/labels.failure": ("probability of a failure", colors.CLASSES["impact"])}
        if content.analysis.alarm is not None:
            failure["/labels.alarm"] = ("alarm threshold", colors.THRESHOLD)
        plot = _foxglove_plot("Probability of a failure", failure)
        over_time["Plot!failure"] = (plot | {"minYValue": 0, "maxYValue": 1}, 1.5)
    for topic, title, names in _velocities(content):
        lines = {
            f"{topic}.velocity[{place}]": (name, color)
            for place, (name, color) in enumerate(
                zip(names, colors.of_series(len(names)), strict=True)
            )
        }
        over_time[f"Plot!{title}"] = (_foxglove_plot(f"Velocities, {title} [rad/s]", lines), 2.0)
    panels = {name: config for name, (config, _) in over_time.items()}
    layout: Any = _stacked([(name, share) for name, (_, share) in over_time.items()])
    if content.analysis.findings:
        panels["RosOut!findings"] = {"topicToRender": "/log", "minLogLevel": 1}
        layout = {
            "direction": "row",
            "first": "RosOut!findings",
            "second": layout,
            "splitPercentage": 25,
        }
    whole = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": layout,
    }
    return json.dumps(whole, indent=1) + "\n"


def plotjuggler(content: Content) -> str:
    """A layout of PlotJuggler, to be loaded there after the MCAP, as XML.

    Args:
        content: What was exported.
    """
    plots = {
        "noise": {"/noise/simplified": colors.NOISE},
        "level": {"/level/level": colors.NOISE},
    }
    if content.analysis.labels is not None:
        plots["failure"] = {"/labels/failure": colors.CLASSES["impact"]}
        if content.analysis.alarm is not None:
            plots["failure"]["/labels/alarm"] = colors.THRESHOLD
    for topic, title, names in _velocities(content):
        hues = colors.of_series(len(names))
        curves = (f"{topic}/{name}/velocity" for name in names)
        plots[f"velocities, {title}"] = dict(zip(curves, hues, strict=True))
    root = ElementTree.Element("root")
    window = ElementTree.SubElement(
        root, "tabbed_widget", {"parent": "main_window", "name": "Main Window"}
    )
    tab = ElementTree.SubElement(window, "Tab", containers="1", tab_name="noise-inspector")
    splitter = ElementTree.SubElement(
        ElementTree.SubElement(tab, "Container"),
        "DockSplitter",
        orientation="-",
        count=str(len(plots)),
        sizes=";".join([f"{1 / len(plots):.6f}"] * len(plots)),
    )
    for name, curves_of in plots.items():
        area = ElementTree.SubElement(splitter, "DockArea", name=name)
        plot = ElementTree.SubElement(
            area, "plot", mode="TimeSeries", style="Lines", flip_x="false", flip_y="false"
        )
        for curve, color in curves_of.items():
            ElementTree.SubElement(plot, "curve", name=curve, color=_hex(color))
    ElementTree.SubElement(window, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    ElementTree.indent(root, " ")
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _velocities(content: Content) -> list[tuple[str, str, tuple[str, ...]]]:
    """Topics with velocities, what they are, and their joints."""
    joints = joint_signals(content)
    return [
        (topic, title, joints[topic][0])
        for topic, title in ((MEASURED, "measured"), (DESIRED, "desired"))
        if topic in joints and "velocity" in joints[topic][1]
    ]


def _foxglove_plot(title: str, lines: dict[str, tuple[str, colors.Color]]) -> dict[str, Any]:
    paths = [
        {
            "value": value,
            "label": label,
            "color": _hex(color),
            "enabled": True,
            "showLine": True,
            "timestampMethod": "receiveTime",
        }
        for value, (label, color) in lines.items()
    ]
    return {
        "title": title,
        "foxglovePanelTitle": title,
        "paths": paths,
        "isSynced": True,
        "showLegend": 1 < len(paths) <= LISTED,
        "legendDisplay": "floating",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "xAxisVal": "timestamp",
    }


def _stacked(panels: list[tuple[str, float]]) -> Any:
    """Panels above each other, by share of the height."""
    (first, share), *rest = panels
    if not rest:
        return first
    percent = 100 * share / sum(each for _, each in panels)
    return {
        "direction": "column",
        "first": first,
        "second": _stacked(rest),
        "splitPercentage": round(percent, 1),
    }


def _hex(color: colors.Color) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)
