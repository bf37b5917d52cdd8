"""A hook of the build: a wheel of the service holds the client as `clutchlife` too, an editable install does not."""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ClientBesideService(BuildHookInterface):  # type: ignore[misc]
    """A build hook that adds the client's folder to copied wheels. Hatchling is available only while a wheel is built."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the folder; called before a wheel is built, with `version` `standard` or `editable`."""
        if version == "standard":
            build_data["force_include"]["service/client/clutchlife"] = "clutchlife"
