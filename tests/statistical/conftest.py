"""Seeds are printed."""

import pytest


@pytest.fixture(autouse=True)
def _seed(request: pytest.FixtureRequest) -> None:
    print(f"seed {getattr(request.module, 'SEED', 'in the test')}")
