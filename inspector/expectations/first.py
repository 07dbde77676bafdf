"""A first file of expectations, from what was found, for people to edit."""

import json
from collections.abc import Sequence
from datetime import date
from glob import escape
from pathlib import Path

from inspector.errors import InspectorError
from inspector.expectations.expectations import FORMAT, NAME, TOLERANCE, relative
from inspector.verdict import Verdict

HEAD = f"""\
# Which findings `inspector classify` expects of the runs in this folder, and below it.
# Edit it: give the reasons, delete what should be repaired. Times are in seconds.
format = "{FORMAT}"
others = "fail"    # findings that no entry is about: "fail" or "allow"
"""

FOOT = """
# [[require]]                      # it is a finding if there is none
# runs = "pick*.npz"
# class = "impact"
# at = 1.2
# tolerance = 0.1
#
# [[forbid]]                       # whatever is allowed
# class = ["impact", "oscillations"]
# joints = "left_*"                # of the joint with the largest share
# time = [0.0, 1.0]
#
# [[waive]]                        # counts again after that day
# class = "oscillations"
# reason = "ticket 123"
# until = 2027-01-31
#
# [[budget]]                       # of each run; beyond, all of them count
# class = "highaccelerations"
# findings = 2
# percent = 1.0                    # of the time
"""


def path_for(runs: Sequence[Path], output: Path | None) -> Path:
    """Choose where the file goes: beside a run, or into the folder of several.

    Args:
        runs: What was named, files or folders.
        output: What was chosen, if anything.

    Raises:
        InspectorError: If the runs do not lie in one folder.
    """
    if output is not None:
        return output / NAME if output.is_dir() else output
    folders = {run if run.is_dir() else run.parent for run in runs}
    if len(folders) > 1:
        raise InspectorError(
            f"{len(folders)} folders ({', '.join(sorted(map(str, folders))[:3])}): name the file"
            f" that is written, say -o {NAME} in a folder above them"
        )
    return folders.pop() / NAME


def first(verdicts: Sequence[Verdict], folder: Path, *, required: bool, today: date) -> str:
    """Write a file of expectations after which what was found is expected.

    Args:
        verdicts: What was found in runs, localised.
        folder: Folder of the file.
        required: Whether the findings are required, or only allowed.
        today: The day that the reasons name.

    Returns:
        TOML.
    """
    parts = [HEAD]
    for verdict in verdicts:
        name = relative(verdict.path, folder).as_posix()
        for event in verdict.events:
            known = verdict.localisations.get(event)
            joints = known.joints[:1] if known is not None else ()
            lines = [
                f"[[{'require' if required else 'allow'}]]",
                f"runs = {_text(escape(name))}",
                f"class = {_text(event.label)}",
                f"at = {event.start:.3f}",
                f"tolerance = {TOLERANCE:g}",
                *(
                    f"# joints = {_text(joint)}    # {share:.0%} of the finding"
                    for joint, share in joints
                ),
                f'reason = "found on {today}, score {event.score:.2f}"',
            ]
            parts.append("\n".join(lines) + "\n")
    return "\n".join([*parts, FOOT.lstrip("\n")])


def _text(value: str) -> str:
    """A text as TOML has it: JSON's escapes are a part of TOML's."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
