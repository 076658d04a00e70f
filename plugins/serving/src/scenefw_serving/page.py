"""The page of the service: its routes, from their OpenAPI description; nothing is fetched."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jinja2 import Environment

_TEMPLATE = """\
<!doctype html>
<html lang="en">
<meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{{ info.title }}</title>
<style>
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem }
code, pre { font: 14px/1.4 ui-monospace, monospace; background: #8882; border-radius: 4px }
code { padding: 0 .3em } pre { padding: .6rem; overflow-x: auto }
td, th { text-align: left; vertical-align: top; padding: .1rem 1rem .1rem 0 }
:root { color-scheme: light dark }
</style>
<h1>{{ info.title }} {{ info.version }}</h1>
<p>Described by <a href="openapi.json">openapi.json</a>. Errors are <code>{"error": "..."}</code>,
one line.</p>
{% for path, methods in paths.items() %}{% for method, about in methods.items() %}
<h2>{{ method | upper }} {{ path }}</h2>
<p>{{ about.summary }}.</p>
{% if about.requestBody %}
{% set form = about.requestBody.content["multipart/form-data"].schema %}
<pre>curl -F depth=@table.png -F intrinsics=@camera.json -F colour=@table.jpg URL{{ path }}
curl --data-binary @table.npz URL{{ path }}</pre>
<table>
{% for name, field in form.properties.items() %}
<tr><th>{{ name }}</th><td>{{ field.description }}</td></tr>
{% endfor %}
{% for parameter in about.parameters %}
<tr><th>?{{ parameter.name }}=</th>
<td>{% if parameter.name == "format" %}{{ about.responses["200"].description }}, default {% endif %}
{{ parameter.schema.default }}</td></tr>
{% endfor %}
</table>
{% endif %}
{% endfor %}{% endfor %}
"""


def index_page(description: Mapping[str, Any]) -> str:
    """HTML of an OpenAPI description."""
    return Environment(autoescape=True).from_string(_TEMPLATE).render(**description)
