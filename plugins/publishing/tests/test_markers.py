import pytest

from scenefw.core.errors import StorageError
from scenefw_publishing.markers import fill, read_document

TEXT = "# Title\n\n<!-- part -->\nold | figures\n<!-- /part -->\n\nAfter <!-- other -->\n"


def test_only_what_stands_between_is_written_anew(tmp_path):
    document = tmp_path / "README.md"
    document.write_text(TEXT)
    fill(document, "part", "| new |\n| --- |\n\n")
    once = document.read_text()
    assert once == TEXT.replace("old | figures", "| new |\n| --- |")
    fill(document, "part", "| new |\n| --- |")
    assert document.read_text() == once


@pytest.mark.parametrize(
    "text",
    [
        "nothing",
        "<!-- part -->",
        "<!-- /part --> <!-- part -->",
        "<!-- part --><!-- /part --><!-- part --><!-- /part -->",
    ],
)
def test_a_document_without_the_place(tmp_path, text):
    document = tmp_path / "README.md"
    document.write_text(text)
    with pytest.raises(StorageError, match="<!-- part -->"):
        read_document(document, "part")
    with pytest.raises(StorageError, match="<!-- part -->"):
        fill(document, "part", "new")
    assert document.read_text() == text


def test_no_document(tmp_path):
    with pytest.raises(StorageError, match="no document"):
        read_document(tmp_path / "README.md", "part")
