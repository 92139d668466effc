"""TypeScript declarations of all messages between server and page, from the schemas of the web application.

`python -m tests.app.web.message_types` writes `app/web/static/messages.d.ts`; a test checks that it is up to date.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from spinscope.app.web.app_state import AppState
from spinscope.app.web.application import application
from spinscope.app.web.coach_application import SESSION as COACH
from spinscope.app.web.coach_application import CoachState, coach_application
from spinscope.app.web.message_schemas import ServerMessage
from spinscope.pipeline.session import DEFAULT_SAMPLE, Choices

TARGET = Path(__file__).parents[3] / "app/web/static/messages.d.ts"
HEAD = "// Generated from the schemas in app/web by `python -m tests.app.web.message_types`: do not edit."
SESSION = "/api/sessions/{session_id}/"
SIMPLE = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}
Schema = dict[str, Any]


def declarations() -> str:
    """The whole file."""
    state = AppState(DEFAULT_SAMPLE, Choices())
    api = application(state).openapi()
    state.drawings.close()
    messages = TypeAdapter(ServerMessage).json_schema(mode="serialization")
    coach = coach_application(CoachState([])).openapi()
    schemas: dict[str, Schema] = {
        **api["components"]["schemas"],
        **coach["components"]["schemas"],
        **messages["$defs"],
    }
    for validation in ("HTTPValidationError", "ValidationError"):
        schemas.pop(validation, None)
    parts = [HEAD, *(_interface(name, schemas[name]) for name in sorted(schemas))]
    kinds = [_type(one) for one in messages["anyOf"]]
    members = [f'  "{schemas[name]["properties"]["kind"]["const"]}": {name};' for name in kinds]
    parts.append("/** Messages of the server by their kind. */\nexport interface ServerMessages {\n")
    parts[-1] += "\n".join(members) + "\n}"
    others = {path: one for path, one in api["paths"].items() if not path.startswith(SESSION)}
    parts += [
        _routes("SessionPosts", "post", api["paths"], SESSION),
        _routes("SessionGets", "get", api["paths"], SESSION),
        _routes("Posts", "post", others, ""),
        _routes("Gets", "get", others, ""),
        _routes("CoachPosts", "post", coach["paths"], COACH),
        _routes("CoachGets", "get", coach["paths"], COACH),
    ]
    return "\n".join(parts) + "\n"


def _interface(name: str, schema: Schema) -> str:
    # The server leaves nothing out of what it sends.
    required = schema.get("required", []) if name.endswith("Request") else schema.get("properties", {})
    fields = [
        f"{field}{'' if field in required else '?'}: {_type(own)}"
        for field, own in schema.get("properties", {}).items()
    ]
    text = schema.get("description", "").splitlines()
    head = f"/** {text[0]} */\n" if text else ""
    return f"{head}export type {name} = {{ {'; '.join(fields)} }};"


def _type(schema: Schema) -> str:
    if "$ref" in schema:
        return str(schema["$ref"]).rsplit("/", 1)[1]
    if "const" in schema:
        return f'"{schema["const"]}"'
    if "enum" in schema:
        return " | ".join(f'"{value}"' for value in schema["enum"])
    if "anyOf" in schema:
        return " | ".join(dict.fromkeys(_type(one) for one in schema["anyOf"]))
    if "prefixItems" in schema:
        return f"[{', '.join(_type(one) for one in schema['prefixItems'])}]"
    match schema.get("type"):
        case "array":
            inner = _type(schema["items"])
            return f"({inner})[]" if " | " in inner else f"{inner}[]"
        case "object":
            inner = schema.get("additionalProperties", True)
            return f"Record<string, {'any' if inner is True else _type(inner)}>"
        case None:
            return "any"
        case simple:
            return SIMPLE[simple]


def _routes(name: str, method: str, paths: dict[str, Any], prefix: str) -> str:
    lines = [f"/** {method.upper()} requests{' of a session' if prefix else ''}: what is sent and answered. */"]
    lines.append(f"export interface {name} {{")
    for path, operations in sorted(paths.items()):
        answers = operations.get(method, {}).get("responses", {})
        answer = next((one for status, one in answers.items() if status.startswith("2")), {})
        schema = answer.get("content", {}).get("application/json", {}).get("schema", {})
        if not path.startswith(prefix) or not schema:
            continue
        body = operations[method].get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema")
        sent = "null" if body is None else _type(body)
        lines.append(f'  "{path.removeprefix(prefix)}": {{ sent: {sent}; answered: {_type(schema)} }};')
    return "\n".join([*lines, "}"])


if __name__ == "__main__":
    TARGET.write_text(declarations(), encoding="utf-8")
