"""Values of settings as they are typed on the command line."""

from typing import Any


def as_typed(value: Any) -> str:
    """The text of a value."""
    if isinstance(value, list):
        return f"[{', '.join(map(as_typed, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return "null" if value is None else str(value)
