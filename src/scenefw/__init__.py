"""scenefw: complete, instance-segmented 3D scenes from views of cluttered table-tops.

`scenefw.load("reconstruction")` is where to begin in Python: docs/api.md.
"""


def __getattr__(name: str) -> object:
    """`load`, from where it is written: importing scenefw itself stays quick (PEP 562)."""
    if name != "load":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from scenefw.api.load import load

    return load


def __dir__() -> list[str]:
    return [*globals(), "load"]
