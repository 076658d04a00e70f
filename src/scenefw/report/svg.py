"""Drawings (SVG) in few bytes."""

import re
from itertools import groupby
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

_SVG = "http://www.w3.org/2000/svg"
_GROUP, _MARK, _WORDS = (f"{{{_SVG}}}{name}" for name in ("g", "use", "text"))
_FONTS = "DejaVu Sans,Verdana,Arial,sans-serif"

ElementTree.register_namespace("", _SVG)
ElementTree.register_namespace("xlink", "http://www.w3.org/1999/xlink")


def compact(svg: str) -> str:
    """The same drawing in less than half the bytes.

    Places are rounded to a tenth of their unit, the font is told once, marks of one style share a
    group, and groups that change nothing go.
    """
    root = ElementTree.fromstring(svg)
    for element in root.iter():
        _shorten(element)
    root.set("font-family", _FONTS)
    _flatten(root)
    return ElementTree.tostring(root, encoding="unicode").replace(" />", "/>").strip()


def _shorten(element: Element) -> None:
    for key, value in element.items():
        if key == "style":
            shorter = re.sub(r"font-family:[^;]*;?", "", value)
            element.set(key, re.sub(r"([:;])\s+", r"\1", shorter).strip())
        elif key == "d":
            path = re.sub(r"\s*([A-Za-z])\s*", r"\1", _rounded(value)).strip()
            element.set(key, re.sub(r"M([^A-Z]+)L\1(?=M|$)", r"M\1h0", path))  # a dot
        elif key in {"x", "y", "width", "height"}:
            element.set(key, _rounded(value))
    if element.get("transform", "").startswith("rotate(-0 "):
        del element.attrib["transform"]
    if element.tag == _GROUP:
        element.attrib.pop("id", None)


def _rounded(numbers: str) -> str:
    """Numbers below 10, as in the outlines of marks, keep two digits."""
    return re.sub(r"\d+\.\d{2,}", lambda match: _shorter(float(match[0])), numbers)


def _shorter(number: float) -> str:
    return f"{round(number, 1 if number >= 10 else 2):g}"


def _flatten(parent: Element) -> None:
    """Takes out groups without attributes, and puts marks of one style into one."""
    if parent.tag == _WORDS:
        return
    children: list[Element] = []
    for child in parent:
        _flatten(child)
        children += child if child.tag == _GROUP and not child.attrib else [child]
    elements: list[Element] = []
    for style, members in groupby(
        children, lambda element: element.tag == _MARK and element.get("style")
    ):
        marks = list(members)
        if style and len(marks) > 1:
            group = Element(_GROUP, {"style": style})
            for mark in marks:
                del mark.attrib["style"]
            _fill(group, marks)
            marks = [group]
        elements += marks
    _fill(parent, elements)


def _fill(parent: Element, children: list[Element]) -> None:
    """Makes these its children, a line each."""
    parent[:] = children
    parent.text = "\n" if children else parent.text
    for child in children:
        child.tail = "\n"
