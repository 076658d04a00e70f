from tests.conftest import real_data, scenefw, simulated, simulator, warm

__all__ = ["real_data", "scenefw", "simulated", "simulator", "warm"]
