import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "src"))
from tests.conftest import scenefw, warm

__all__ = ["scenefw", "warm"]
