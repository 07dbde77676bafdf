"""XML that is parsed within limits: no document type, no entities, no endless nesting."""

from xml.etree import ElementTree as ET
from xml.parsers import expat

MAX_DEPTH = 500
"""Most elements within each other, as MuJoCo has it too; parsers that recurse crash on more."""
MAX_ATTRIBUTES = 200
"""Most attributes of an element; Pinocchio compares each with all others."""


def parsed(text: bytes) -> ET.Element:
    """Root element of a text, in any encoding.

    Args:
        text: The XML.

    Returns:
        The root.

    Raises:
        ValueError: If the text has a document type (which may define entities, bombs among them),
            is nested too deeply, has an element of too many attributes, or is not XML.
    """
    parser = expat.ParserCreate()
    depth = 0

    def refuse(*_: object) -> None:
        raise ValueError("no document type or entities are read")

    def enter(_: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if len(attributes) > MAX_ATTRIBUTES:
            raise ValueError(f"an element has more than {MAX_ATTRIBUTES} attributes")
        if depth > MAX_DEPTH:
            raise ValueError(f"elements are nested more than {MAX_DEPTH} deep")

    def leave(*_: object) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = enter
    parser.EndElementHandler = leave
    try:
        parser.Parse(text, True)
        return ET.fromstring(text)  # noqa: S314
    except (expat.ExpatError, ET.ParseError, LookupError) as error:
        raise ValueError(f"not XML ({error})") from error
