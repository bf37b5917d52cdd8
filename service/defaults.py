"""Where the service and its database are where nothing is said; loads nothing, for every command begins with it."""

DEFAULT_DATABASE = "sqlite:///clutchlife.db"
LOOPBACK = "127.0.0.1"
DEFAULT_URL = f"http://{LOOPBACK}:8000"
#: What `--scheduler` takes, as its help and its error say.
SCHEDULERS = "local, processes[:N] on this machine, or tcp://host:port of a Dask scheduler"
