from types import SimpleNamespace

import pytest
from PIL import Image
from tests.unit.report.test_overview import estimate_of

from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw_publishing.pictures import Pictures, in_columns

MARKED = "# Title\n<!-- pictures -->\nold\n<!-- /pictures -->\nend\n"


@pytest.fixture
def predict(tmp_path):
    (tmp_path / "images").mkdir()
    for name in ("a", "b"):
        (tmp_path / "images" / f"{name}.npz").touch()
    return SimpleNamespace(
        images=SimpleNamespace(path=tmp_path / "images"),
        output=tmp_path / "out",
        predict=lambda image, folder: estimate_of(objects=1 + (image.stem == "b")),
    )


def entries(*names):
    return {f"p{name}": {"image": f"{name}.npz", "words": f"Thing {name}"} for name in names}


def test_pictures_and_the_table_that_shows_them(predict, tmp_path):
    document = tmp_path / "README.md"
    document.write_text(MARKED)
    task = Pictures(predict, {**entries("a", "b"), "none": None}, document, "docs/real")
    assert task.run() == {"pa/objects": 1, "pb/objects": 2}
    text = document.read_text()
    assert text.startswith(
        "# Title\n<!-- pictures -->\n| ![Thing a: 1 object found](docs/real/pa.webp)"
    )
    assert "| Thing a: 1 object found | Thing b: 2 objects found |" in text
    assert text.endswith("<!-- /pictures -->\nend\n")
    for name in ("pa", "pb"):
        picture = tmp_path / "docs" / "real" / f"{name}.webp"
        assert Image.open(picture).size == (888, 330)
        assert picture.stat().st_size < 30_000
    assert sorted(p.name for p in (tmp_path / "docs" / "real").iterdir()) == ["pa.webp", "pb.webp"]


def test_columns():
    cells = [("A", "a"), ("B", "b"), ("C", "c")]
    expected = ["| A | B |", "| --- | --- |", "| a | b |", "| C |  |", "| c |  |"]
    assert in_columns(cells, 2).splitlines() == expected


def test_what_is_missing_is_found_out_before_the_work(predict, tmp_path):
    document = tmp_path / "README.md"
    document.write_text(MARKED)
    predict.predict = None
    with pytest.raises(InputError, match=r"no image c\.npz"):
        Pictures(predict, entries("c"), document).run()
    document.write_text("no place")
    with pytest.raises(StorageError, match="<!-- pictures -->"):
        Pictures(predict, entries("a"), document).run()
    with pytest.raises(ConfigError, match=r"publishing\.images is invalid"):
        Pictures(predict, {"x": {"picture": "a"}}, document)
    with pytest.raises(ConfigError, match="no image"):
        Pictures(predict, {"x": None}, document)
