"""The version of the program."""

from importlib.metadata import PackageNotFoundError, version


def program_version() -> str:
    """The version that is installed; "0" of a program that is run from its folder."""
    try:
        return version("noise-inspector")
    except PackageNotFoundError:
        return "0"
