"""Drawings in few bytes show what they showed."""

from xml.etree import ElementTree

from scenefw.report.svg import compact

DRAWING = """<svg xmlns:xlink="http://www.w3.org/1999/xlink" width="648pt" height="216pt"
 viewBox="0 0 648 216" xmlns="http://www.w3.org/2000/svg" version="1.1">
 <g id="axes_1">
  <g id="line2d_1">
   <defs>
    <path id="m1" d="M 0 1.5
C 0.397805 1.5 0.77937 1.341951 1.06066 1.06066
z
" style="stroke: #4477cc"/>
   </defs>
   <g clip-path="url(#p1)">
    <use xlink:href="#m1" x="62.839991" y="102.623677" style="fill: #4477cc; stroke: #4477cc"/>
    <use xlink:href="#m1" x="64.820421" y="3.445277" style="fill: #4477cc; stroke: #4477cc"/>
   </g>
   <use xlink:href="#m1" x="1" y="2" style="fill: #000000"/>
  </g>
  <g id="text_1">
   <text style="font-size: 10px; font-family: 'DejaVu Sans', sans-serif; fill: #808890"
 x="60.859561" y="196.596635" transform="rotate(-0 60.859561 196.596635)">0.00125 &lt; a</text>
   <text x="3" y="4" transform="rotate(-90 60.859561 196.596635)">up</text>
  </g>
  <path d="M 10.04 20.06
L 30.55 40
M 7.123456 8
L 7.123456 8
" style="stroke-opacity: 0.15"/>
 </g>
</svg>"""


def named(root, name):
    return root.iter(f"{{http://www.w3.org/2000/svg}}{name}")


def test_a_drawing_gets_shorter_and_stays_the_same():
    found = compact(DRAWING)
    assert found.startswith("<svg ")
    assert len(found) < 0.75 * len(DRAWING)
    assert compact(found) == found
    root = ElementTree.fromstring(found)
    assert "DejaVu Sans" in root.get("font-family")
    assert "font-family" not in found.partition(">")[2]
    (mark, line) = (path.get("d") for path in named(root, "path"))
    assert mark == "M0 1.5C0.4 1.5 0.78 1.34 1.06 1.06z"
    assert line == "M10 20.1L30.6 40M7.12 8h0"
    places = [(use.get("x"), use.get("y"), use.get("style")) for use in named(root, "use")]
    assert places == [("62.8", "102.6", None), ("64.8", "3.45", None), ("1", "2", "fill:#000000")]
    clipped, alike = named(root, "g")  # others did nothing
    assert (clipped.get("clip-path"), list(clipped)) == ("url(#p1)", [alike])
    assert alike.get("style") == "fill:#4477cc;stroke:#4477cc"
    words = list(named(root, "text"))
    assert [word.text for word in words] == ["0.00125 < a", "up"]
    assert [word.get("transform") for word in words] == [None, "rotate(-90 60.859561 196.596635)"]
    assert 'stroke-opacity:0.15"' in found
