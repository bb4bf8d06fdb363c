"""The page of the server, made of its OpenAPI description: it needs nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kpred.reports.page import page, section, tag, text_of
from kpred.reports.table import facts

_EXAMPLES = """\
curl -F scan=@chair.ply -F answer=mesh http://127.0.0.1:8765/fit -o chair.glb
curl -F scan=@chair.ply -F up=z -F unit=mm http://127.0.0.1:8765/fit -o chair.zip
curl -F scan=@chair.ply -F answer=record http://127.0.0.1:8765/fit
kpred fit chair.ply -o chair.glb --server http://127.0.0.1:8765"""


def server_page(openapi: Mapping[str, Any]) -> str:
    """Return the page; `openapi`: what `/openapi.json` holds."""
    parts = [tag("p", text_of(openapi["info"].get("description", "")))]
    parts.append(section("Examples", tag("pre", text_of(_EXAMPLES))))
    for path, methods in openapi["paths"].items():
        for method, about in methods.items():
            answers = [(status, one["description"]) for status, one in about.get("responses", {}).items()]
            fields = facts(_fields(openapi, about))
            parts.append(section(f"{method.upper()} {path}: {about.get('summary', '')}", fields, facts(answers)))
    parts.append(section("For programs", tag("p", tag("a", "/openapi.json", href="/openapi.json"))))
    return page(f"kpred {openapi['info']['version']}", parts)


def _fields(openapi: Mapping[str, Any], about: Mapping[str, Any]) -> list[tuple[str, str]]:
    """List the fields of a form with their descriptions and values."""
    for content in about.get("requestBody", {}).get("content", {}).values():
        name = content["schema"]["$ref"].rpartition("/")[2]
        properties = openapi["components"]["schemas"][name]["properties"]
        return [(key, _described(one)) for key, one in properties.items()]
    return []


def _described(field: Mapping[str, Any]) -> str:
    kinds = [field, *field.get("anyOf", [])]
    values = [str(value) for kind in kinds for value in kind.get("enum", [])]
    values += [str(kind["const"]) for kind in kinds if "const" in kind]
    text = str(field.get("description", ""))
    text += f" ({', '.join(values)})" if values else ""
    default = field.get("default")
    return text + (f"; {default} if left out" if default is not None else "")
