"""Links from a report to the robot: a click on a link's name selects it in the 3D view.

Rerun's viewer follows ``recording://`` addresses of entities. It has none for times: the way to
an event is a click on its time in the list of events.
"""

import re
from collections.abc import Mapping


def linked(markdown: str, entities: Mapping[str, str]) -> str:
    """Let the names of links that stand before a share point to their entities.

    Args:
        markdown: A report.
        entities: Entity path by name of the link.

    Returns:
        The report with its names as Markdown links.
    """

    def address(found: re.Match[str]) -> str:
        entity = entities.get(found[1], "").lstrip("/")
        return f"[{found[1]}](recording://{entity}) {found[2]}" if entity else found[0]

    return re.sub(r"(?<=[ |])([^\s|,]+) (\d+%)", address, markdown)
