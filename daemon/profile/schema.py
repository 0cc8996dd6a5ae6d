"""The JSON Schema of a profile, by which editors complete and check it: `python -m daemon.profile.schema`."""

import json
import sys
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from daemon.profile.tables import ProfileTable
from drivers import registry

Schema = dict[str, Any]


def profile_schema() -> Schema:
    """Return the schema of a profile, with the options of the drivers of this package.

    What needs more than one key to judge, such as a unit that has to fit its axis, is left to `load_profile`.
    """
    controllers = {name: registry.controller_driver(name) for name in registry.BUILT_IN["controllers"]}
    cameras = {name: registry.camera_driver(name) for name in registry.BUILT_IN["cameras"]}
    models: list[type[BaseModel]] = [ProfileTable]
    models += [model for driver in controllers.values() for model in (driver.Options, driver.AxisOptions)]
    models += [driver.Options for driver in cameras.values()]
    references, collected = models_json_schema([(model, "validation") for model in models])
    definitions: dict[str, Schema] = collected["$defs"]

    def reference(model: type[BaseModel]) -> Schema:
        return dict(references[model, "validation"])

    def definition(model: type[BaseModel]) -> Schema:
        name: str = reference(model)["$ref"].rpartition("/")[2]
        return definitions[name]

    definitions["ControllerTable"]["oneOf"] = _by_driver(
        {name: _with_driver_key(definition(driver.Options)) for name, driver in controllers.items()}
    )
    definitions["CameraTable"]["oneOf"] = _by_driver(
        {name: {"properties": {"options": reference(driver.Options)}} for name, driver in cameras.items()}
    )
    # An axis's driver is named in its controller's table, where a schema cannot look it up: this only offers.
    axis_options = definitions["AxisTable"]["properties"]["options"]
    axis_options["anyOf"] = [reference(driver.AxisOptions) for driver in controllers.values()]
    axis_options["anyOf"].append({"type": "object"})
    root = definitions.pop("ProfileTable")
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **root, "$defs": definitions}
    tidied: Schema = _as_toml(schema)
    return tidied | {"title": "A rig's profile for activecam"}


def _with_driver_key(options: Schema) -> Schema:
    return {**options, "properties": {"driver": {}, **options.get("properties", {})}}


def _by_driver(branches: dict[str, Schema]) -> list[Schema]:
    """Return a branch for each driver of ours, and one that leaves drivers of other packages alone."""
    chosen = []
    for name, branch in branches.items():
        properties = {**branch["properties"], "driver": {"const": name}}
        chosen.append({**branch, "properties": properties})
    return [*chosen, {"properties": {"driver": {"not": {"enum": list(branches)}}}}]


def _as_toml(node: Any) -> Any:
    """Return the schema without null, which TOML does not have, and titles that only repeat the keys."""
    if isinstance(node, list):
        return [_as_toml(item) for item in node]
    if not isinstance(node, dict):
        return node
    kept = {key: _as_toml(value) for key, value in node.items() if not _is_noise(key, value, node)}
    choices = [choice for choice in kept.get("anyOf", []) if choice != {"type": "null"}]
    if len(choices) == 1:
        del kept["anyOf"]
        return choices[0] | kept
    return kept | {"anyOf": choices} if choices else kept


def _is_noise(key: str, value: object, node: Schema) -> bool:
    if key == "title":
        return isinstance(value, str)
    # A quantity's default is held as a number, which is not how it is written.
    return key == "default" and (
        value is None or (node.get("type") == "string" and not isinstance(value, str))
    )


def main() -> None:
    """Write the schema to standard output."""
    sys.stdout.write(json.dumps(profile_schema(), indent=2, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
