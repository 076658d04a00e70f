import numpy as np
from PIL import Image
from tests.unit.labelling.fakes import truth

from scenefw.report.labelling.growth import Growth


def test_pictures_and_a_film_of_them(tmp_path):
    growth, whole = Growth(tmp_path, side=64), truth()
    assert growth.film() is None
    shown = [growth.show(whole, 20)]
    whole.heights[:, 10:] = np.nan
    shown.append(growth.show(whole, 40))
    assert [path.name for path in shown] == ["000020.png", "000040.png"]
    with Image.open(growth.film()) as film, Image.open(shown[0]) as first:
        assert film.n_frames == 2
        assert film.size == first.size
