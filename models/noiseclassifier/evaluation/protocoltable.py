"""The protocol as text: what it is worth, where it is worst, and by robot, domain or scenario."""

from collections.abc import Callable, Mapping, Sequence
from math import isnan

from noiseclassifier.evaluation.intervals import Estimate
from noiseclassifier.evaluation.protocol import RATES, WORST, Part, Protocol

NAME, WIDE, NARROW = 38, 26, 12
SHOWN = 12
"""Rows of a table by robot or domain at most; the JSON has all."""
LONGEST = 32
"""Characters of a name at most."""
ROWS = (
    ("False alarms per hour of ok time", "false_alarms_per_hour", "false_alarms"),
    ("  by findings unknown", "unknown_false_alarms_per_hour", "unknown_false_alarms"),
    ("Ok time flagged", "ok_flagged", ""),
    ("Alarms per hour of unlabelled time", "alarms_in_unlabelled_per_hour", "alarms_in_unlabelled"),
    ("Faults found, of all injected", "recall_injected", "found/faults"),
    ("Faults found, of those felt", "recall_felt", "found_felt/felt"),
    ("Onset right within 0.2 s, of found", "onset_within", "onset_close/found"),
    ("Events by class, precision", "class_precision", "matched_by_class/findings"),
    ("  recall", "class_recall", "matched_by_class/faults"),
    ("  F1", "class_f1", ""),
    ("Events of any class, precision", "any_precision", "matched/findings"),
    ("  recall", "any_recall", "matched/faults"),
    ("  F1", "any_f1", ""),
)
"""Title, measure and counts of each row."""
COLUMNS = (
    ("false/h", "false_alarms_per_hour"),
    ("ok flagged", "ok_flagged"),
    ("unlab./h", "alarms_in_unlabelled_per_hour"),
    ("found", "recall_injected"),
    ("felt found", "recall_felt"),
    ("F1 class", "class_f1"),
    ("delay", "delay"),
)


def lines_of(protocol: Protocol, by: str = "") -> list[list[str]]:
    """Paragraphs of lines.

    Args:
        protocol: The measures.
        by: ``robot``, ``domain`` or ``scenario``: the one table to print, whole; by default those
            of robots and domains, if there are several, down to the worst.
    """
    keys = [by] if by else [key for key in ("robot", "domain") if len(protocol.by[key]) > 1]
    parts = [_summary(protocol), _not_answered(protocol), _worst(protocol)]
    parts += [_table(protocol, key, whole=bool(by)) for key in keys]
    return [part for part in parts if part]


def _summary(protocol: Protocol) -> list[str]:
    counts, delay = protocol.counts, protocol.pooled["delay"]
    lines = [
        "At the operating point that ships: findings as `inspector classify` reports them",
        _line("", ["robots alike", "all runs pooled"], ["by chance", "counts"]),
    ]
    for title, name, behind in ROWS:
        form = _rate if name in RATES else _share
        chance = protocol.by_chance.get(name)
        count = " of ".join(f"{counts[each]:.0f}" for each in behind.split("/")) if behind else ""
        figures = [_ranged(each[name], form) for each in (protocol.alike, protocol.pooled)]
        lines.append(_line(title, figures, ["" if chance is None else _share(chance), count]))
    late = protocol.alike["late_delay"].value
    figures = [
        f"{_time(protocol.alike['delay'].value)}, 90 %: {_time(late)}",
        _ranged(delay, _time),
    ]
    return [
        *lines,
        _line("Delay until a live listener knows", figures),
        _line("AUC of runs, mean over domains", [_share(protocol.auc), ""], ["50.0%"]),
        _line("pAUC (FPR up to 10 %)", [_share(protocol.pauc), ""], ["50.0%"]),
        _line("Score of DCASE task 2 (harmonic mean)", [_share(protocol.official), ""], ["50.0%"]),
        _line(
            "Runs without a verdict",
            [_share(protocol.not_answered), ""],
            ["", f"{len(protocol.unanswered)} of {_runs(protocol)}"],
        ),
    ]


def _not_answered(protocol: Protocol) -> list[str]:
    """Reasons why runs have no verdict, each with its runs and robots."""
    reasons: dict[str, list[str]] = {}
    for each in protocol.unanswered:
        reasons.setdefault(each.reason, []).append(each.origin.robot)
    return [
        f"not answered: {_many(len(robots), 'run')} ({reason}) of {_few(sorted(set(robots)))}"
        for reason, robots in reasons.items()
    ]


def _worst(protocol: Protocol) -> list[str]:
    lines = []
    cases, cells = protocol.cases, protocol.cells
    if worst := protocol.worst(cases, "recall_injected"):
        lines.append(f"The worst {len(worst)} of robot and scenario, by injected faults found")
        for key in worst:
            counts = cases[key].counts
            lines.append(
                _line(
                    "  " + _short(" ".join(key)),
                    [_share(cases[key].measures["recall_injected"])],
                    [
                        f"{counts['found']:.0f} of {counts['faults']:.0f} injected,"
                        f" {counts['found_felt']:.0f} of {counts['felt']:.0f} felt"
                    ],
                )
            )
    for title, measure, parts in (
        ("robot and domain", "false_alarms_per_hour", cells),
        ("robot and domain", "alarms_in_unlabelled_per_hour", cells),
    ):
        if worst := protocol.worst(parts, measure):
            what = "unlabelled time" if "unlabelled" in measure else "ok time"
            lines.append(f"The worst {len(worst)} of {title}, by alarms per hour of {what}")
            alarms, hours = RATES[measure]
            for key in worst:
                counts = parts[key].counts
                lines.append(
                    _line(
                        "  " + _short(" ".join(key)),
                        [f"{_rate(parts[key].measures[measure])} per hour"],
                        [f"{counts[alarms]:.0f} in {counts[hours]:.3g} h"],
                    )
                )
    return lines


def _table(protocol: Protocol, key: str, *, whole: bool) -> list[str]:
    parts = protocol.by[key]
    names = list(parts)
    left = 0
    if not whole and len(names) > SHOWN:
        left = len(names) - SHOWN
        names = sorted(names, key=lambda name: _order(parts[name]))[:SHOWN]
    head = f"By {key}, the worst {SHOWN} of {len(parts)} by F1 of the class"
    ranked = protocol.ranked if key == "domain" else {}
    titles = [title for title, _ in COLUMNS] + (["AUC", "pAUC"] if ranked else [])
    titles = ["runs", "ok h", *titles]
    lines = [head, _cells("", titles, titles)] if left else [_cells(f"By {key}", titles, titles)]
    for name in names:
        part = parts[name]
        figures = [_figure(measure, part.measures[measure]) for _, measure in COLUMNS]
        if ranked:
            own = ranked.get(name)
            figures += [_share(own.auc), _share(own.pauc)] if own else ["-", "-"]
        counts = part.counts
        runs = f"{counts['runs']:.0f}" + (f"+{part.unanswered}" if part.unanswered else "")
        figures = [runs, f"{counts['ok_hours']:.3g}", *figures]
        lines.append(_cells(_short(name), figures, titles))
    if any(part.unanswered for part in parts.values()):
        lines.append("(+n: runs without a verdict)")
    return lines


def _order(part: Part) -> float:
    value = part.measures["class_f1"]
    return 2.0 if isnan(value) else value


def _figure(measure: str, value: float) -> str:
    forms: Mapping[str, Callable[[float], str]] = {"delay": _time}
    return forms.get(measure, _rate if measure in RATES else _share)(value)


def _share(value: float) -> str:
    return "-" if isnan(value) else f"{100.0 * value:.1f}%"


def _rate(value: float) -> str:
    return "-" if isnan(value) else f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _time(value: float) -> str:
    return "-" if isnan(value) else f"{value:.3g} s"


def _ranged(estimate: Estimate, form: Callable[[float], str]) -> str:
    bounds = "" if isnan(estimate.low) else f" [{form(estimate.low)}, {form(estimate.high)}]"
    return form(estimate.value) + bounds.replace("%", "").replace(" s", "")


def _runs(protocol: Protocol) -> int:
    return len(protocol.outcomes) + len(protocol.unanswered)


def _line(name: str, figures: Sequence[str], others: Sequence[str] = ()) -> str:
    line = name.ljust(NAME) + "".join(figure.ljust(WIDE) for figure in figures)
    return (line + "".join(other.ljust(NARROW) for other in others)).rstrip()


def _cells(name: str, cells: Sequence[str], titles: Sequence[str]) -> str:
    """A row, each cell as wide as its title or a figure."""
    widths = [max(len(title), 7) + 2 for title in titles]
    figures = (cell.rjust(width) for cell, width in zip(cells, widths, strict=True))
    return name.ljust(LONGEST) + "".join(figures)


def _short(name: str) -> str:
    """A name that fits its column: its middle is left out if it is long."""
    most = LONGEST - 2
    half = (most - 1) // 2
    return name if len(name) <= most else f"{name[:half]}…{name[-half:]}"


def _few(names: Sequence[str]) -> str:
    rest = len(names) - WORST
    return ", ".join(names[:WORST]) + (f" and {rest} more" if rest > 0 else "")


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
