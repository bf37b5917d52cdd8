"""`/docs`: the API's description for people, without the internet and without a script in the page.

The dashboard keeps the reader's key in the storage of this origin, so that no page of it may run what is not a file of the
service (`Edge`). Swagger UI is that of the package fastapi-offline.
"""

from fastapi import APIRouter
from fastapi.responses import Response

router = APIRouter(include_in_schema=False)

#: Addresses are relative, so that the page works below a proxy's path too.
_PAGE = """<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8" />
    <meta name="viewport" content="width=device-width, initial-scale=1" />
    <title>Clutchlife: the API</title>
    <link rel="icon" href="static-offline-docs/favicon.png" />
    <link rel="stylesheet" href="static-offline-docs/swagger-ui.css" />
  </head>
  <body>
    <div id="swagger-ui"></div>
    <script src="static-offline-docs/swagger-ui-bundle.js"></script>
    <script src="docs/start.js"></script>
  </body>
</html>
"""
_START = """SwaggerUIBundle({
  url: "openapi.json",
  dom_id: "#swagger-ui",
  layout: "BaseLayout",
  presets: [SwaggerUIBundle.presets.apis],
  deepLinking: true,
  validatorUrl: null,
});
"""


@router.get("/docs")
async def description() -> Response:
    """The page."""
    return Response(content=_PAGE, media_type="text/html; charset=utf-8", headers={"Cache-Control": "no-cache"})


@router.get("/docs/start.js")
async def start() -> Response:
    """The script that starts it."""
    return Response(content=_START, media_type="text/javascript; charset=utf-8", headers={"Cache-Control": "no-cache"})
