"""How pages call the methods of sets."""

_NAMES = {"scenefw": "set network"}


def called(method: str) -> str:
    """The words of a method's key in `evaluation.methods`.

    The network that an experiment of sets trains is no other page's `scenefw`, so its words differ.
    """
    return _NAMES.get(method, method.replace("_", " "))
