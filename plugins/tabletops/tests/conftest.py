from tests.conftest import run_elsewhere, scenefw, warm

__all__ = ["run_elsewhere", "scenefw", "warm"]
