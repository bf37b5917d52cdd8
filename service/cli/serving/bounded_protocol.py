"""The protocol of one of several processes, which find their settings in the environment: the server imports it by name."""

from service.settings import Settings
from service.web.connections import bounded

PROTOCOL = bounded(Settings.from_environment().connections_at_once)
