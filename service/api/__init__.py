"""What goes over the wire: pydantic models of request bodies (`...In`) and of answers, every field described.

In: JSON. Out: checked values, or the description at /openapi.json. Open `base` first, then `clutch` and `run` (requests),
`life` and `diagnosis` (answers).
"""
