import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "src"))
from tests.conftest import scenefw, warm
from tests.unit.report.conftest import page

__all__ = ["page", "scenefw", "warm"]
