"""Joins api/openapi.json and api/asyncapi.yaml into one document of named types, for the generators to read.

- A message of the stream is named after itself, as in `WelcomeMessage`, and a call's query after the call, as in
  `GetHeightsQuery`.
- What both documents speak of is one type, and so is what one of them spells out again.
- An answer leaves nothing out: what has no value is null, what was not asked for has its default. So all fields of
  answers are there, but for those of `LEFT_OUT`. Where requests may leave some of them out, they have a type of their
  own, as `GridSpec` is to `Grid`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import yaml

API = Path(__file__).parents[2] / "api"
HERE = "#/components/schemas/"
REST = "openapi.json" + HERE

# What stands in an answer only where there is some: what an object stands on, what a batch did, what only alpine snow has, and what
# was told of its weather.
ALPINE = {"physics", "weather_step", "site", "rained", "deposited", "sublimated", "runoff"}
ALPINE |= {"liquid_water", "hand_hardness", "snow_water_equivalent", "skin_temperature", "albedo"}
WEATHER = {"latitude", "longitude", "start", "wind_direction", "pressure", "snowfall", "rainfall", "precipitation"}
WEATHER |= {"shortwave", "longwave", "cloud_cover", "sun"}
LEFT_OUT = {"shape", "footprints", "results", "errors"} | ALPINE | WEATHER

Schema = Any
Schemas = dict[str, Schema]


def main() -> None:
    rest = json.loads((API / "openapi.json").read_text())
    stream = yaml.safe_load((API / "asyncapi.yaml").read_text())["components"]
    rest_types, stream_types = types_of_rest(rest), types_of_stream(stream)
    if twice := rest_types.keys() & stream_types.keys():
        sys.exit(
            f"api/asyncapi.yaml describes again what api/openapi.json has: {', '.join(sorted(twice))}; refer to it"
        )
    schemas = dict(sorted((rest_types | stream_types).items()))
    document = {"openapi": "3.1.0", "info": rest["info"], "paths": {}, "components": {"schemas": schemas}}
    print(json.dumps(document, indent=1))


def types_of_rest(rest: Any) -> Schemas:
    written = rest["components"]["schemas"]
    spelt_once = once(written)
    named = {name: {key: rewrite(part, spelt_once) for key, part in schema.items()} for name, schema in written.items()}
    operations = [operation for path in rest["paths"].values() for operation in path.values()]
    asked = reached(named, (operation.get("requestBody") for operation in operations))
    told = reached(named, (operation["responses"] for operation in operations))

    whole = {name: rewrite(named[name], all_there) for name in told}
    differing = {name for name in asked & told if named[name] != whole[name]}
    differing |= {name for name in asked & told if reached(named, [named[name]]) & differing}
    specs = {HERE + name: HERE + name + "Spec" for name in differing}

    def as_spec(schema: Schema) -> Schema:
        return schema | {"$ref": specs.get(schema["$ref"], schema["$ref"])} if "$ref" in schema else schema

    requests = {name + "Spec" * (name in differing): rewrite(named[name], as_spec) for name in asked - told | differing}
    queries = {pascal(operation["operationId"]) + "Query": query(operation) for operation in operations}
    return rewrite_all(whole | requests | {name: schema for name, schema in queries.items() if schema}, bare)


def types_of_stream(stream: Any) -> Schemas:
    messages = {pascal(name) + "Message": message for name, message in stream["messages"].items()}
    payloads = {
        name: {"description": message["summary"], **message["payload"]}
        for name, message in messages.items()
        if message.get("contentType") is None and "$ref" not in message["payload"]
    }
    own = {pascal(name): schema for name, schema in stream["schemas"].items()}
    # All fields of answers are there already; what only says so again is another name for the same type.
    own = rewrite_all(own, without_requirements)
    aliases = {HERE + name: schema["$ref"] for name, schema in own.items() if "$ref" in schema}

    def named(schema: Schema) -> Schema:
        if "$ref" not in schema:
            return schema
        document, name = schema["$ref"].split(HERE)
        target = HERE + pascal(name) if document == "" else schema["$ref"]
        return {**schema, "$ref": aliases.get(target, target).replace(REST, HERE)}

    own = {name: schema for name, schema in own.items() if HERE + name not in aliases}
    return rewrite_all(rewrite_all(own | payloads, named), bare)


def rewrite(schema: Schema, change: Callable[[Schema], Schema]) -> Schema:
    """Changes a schema and every one in it, the innermost first."""
    if isinstance(schema, list):
        return [rewrite(part, change) for part in schema]
    if isinstance(schema, dict):
        return change(
            {
                key: rewrite_all(part, change) if key == "properties" else rewrite(part, change)
                for key, part in schema.items()
            }
        )
    return schema


def rewrite_all(schemas: Schemas, change: Callable[[Schema], Schema]) -> Schemas:
    return {name: rewrite(schema, change) for name, schema in schemas.items()}


def once(named: Schemas) -> Callable[[Schema], Schema]:
    """What is spelled out although it has a name becomes a reference."""
    names = {json.dumps(schema, sort_keys=True): name for name, schema in named.items()}

    def change(schema: Schema) -> Schema:
        name = names.get(json.dumps(schema, sort_keys=True))
        return schema if name is None else {"$ref": HERE + name}

    return change


def reached(named: Schemas, roots: Iterable[Any]) -> set[str]:
    """Names of all schemas that JSON at these places consists of."""
    found: set[str] = set()

    def follow(place: Any) -> None:
        if isinstance(place, list):
            for part in place:
                follow(part)
        elif isinstance(place, dict):
            for key, part in place.items():
                if key == "$ref":
                    name = part.removeprefix(HERE)
                    if name not in found:
                        found.add(name)
                        follow(named[name])
                elif "/" not in key or key.endswith("json"):
                    follow(part)

    follow(list(roots))
    return found


def all_there(schema: Schema) -> Schema:
    required = schema.get("required", [])
    there = [field for field in schema.get("properties", {}) if field in required or field not in LEFT_OUT]
    return schema if set(there) == set(required) else schema | {"required": there}


def without_requirements(schema: Schema) -> Schema:
    parts = [part for part in schema.get("allOf", []) if part.keys() != {"required"}]
    return parts[0] if len(parts) == 1 else schema


def query(operation: Any) -> Schema | None:
    given = [parameter for parameter in operation.get("parameters", []) if parameter["in"] == "query"]
    if not given:
        return None
    return {
        "type": "object",
        "description": operation["summary"],
        "required": [parameter["name"] for parameter in given if parameter.get("required")],
        "properties": {
            parameter["name"]: {**parameter["schema"], "description": parameter["description"]} for parameter in given
        },
    }


def bare(schema: Schema) -> Schema:
    """Without what says nothing about the type; descriptions as text, which in REST are Markdown."""
    kept = {key: part for key, part in schema.items() if key not in ("format", "example", "examples", "default")}
    if isinstance(kept.get("description"), str):
        kept["description"] = kept["description"].replace("\\", "").strip()
    return kept


def pascal(name: str) -> str:
    return "".join(part[0].upper() + part[1:] for part in name.split("_"))


if __name__ == "__main__":
    main()
