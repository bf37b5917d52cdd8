"""The service with an empty route beside its own, `/empty`: what the transport and the framework take of any answer.

A script of its own, so that it serves the checkout in whose root it is run and which PYTHONPATH names:
`python -P empty_route.py PORT DATABASE`.
"""

import gc
import sys
from pathlib import Path

import uvicorn
from fastapi import Response
from threadpoolctl import threadpool_limits

import service
from service.app import create_app
from service.settings import Settings


def main(port: int, database: str) -> None:
    """Serve as `clutchlife serve` does; started in the root of its checkout."""
    if not Path(str(service.__file__)).is_relative_to(Path.cwd()):
        sys.exit(f"this is the service of another checkout: {service.__file__}, not of {Path.cwd()}")
    threadpool_limits(limits=1, user_api="blas")
    app = create_app(Settings.from_environment(f"sqlite:///{database}"))

    @app.get("/empty")
    async def empty() -> Response:
        return Response()

    gc.collect()
    gc.freeze()
    uvicorn.run(app, port=port, log_level="warning", access_log=False, server_header=False)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
