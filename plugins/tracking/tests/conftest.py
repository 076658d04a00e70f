from tests.conftest import scenefw, warm

__all__ = ["scenefw", "warm"]
