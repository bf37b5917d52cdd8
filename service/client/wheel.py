"""A hook of the build: a wheel of the service holds the client as `clutchlife` too, an editable install does not."""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ClientBesideService(BuildHookInterface):  # type: ignore[misc]
    """Adds the folder to wheels that are copied. Hatchling is there only while one is built."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before a wheel is built; `version` is `standard` or `editable`."""
        if version == "standard":
            build_data["force_include"]["service/client/clutchlife"] = "clutchlife"
