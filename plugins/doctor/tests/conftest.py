from tests.conftest import real_data, scenefw, warm

__all__ = ["real_data", "scenefw", "warm"]
