import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "src"))
from tests.conftest import scenefw, warm

__all__ = ["scenefw", "warm"]


@pytest.fixture(scope="module")
def service():
    """A client of a service, and the service."""
    from plugins.serving.tests.services import serving

    with serving() as pair:
        yield pair


@pytest.fixture
def client(service):
    """A client of a service."""
    return service[0]
