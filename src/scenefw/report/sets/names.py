"""How pages call the methods of sets."""


def called(method: str) -> str:
    """The words of a method's key in `evaluation.methods`."""
    return method.replace("_", " ")
