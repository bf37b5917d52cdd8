"""The exponent of severity from the tests of one life whose duty steps: how often the true one is found, and believed."""

import numpy as np

from service.lives.assumptions import Assumptions
from service.lives.criteria import SEVERITY_EXPONENTS
from service.lives.severity_estimate import severity_estimate
from tests.service.lives.test_assumptions import SCATTER, TESTS, life

#: The energy of a cycle by stage of life [J]: what is said of large steps, and of small ones.
STEPS = {"10, 20, 40 kJ": (10e3, 20e3, 40e3), "20, 24 kJ": (20e3, 24e3)}


def severity(count: int, seed: int) -> str:
    """By energies and true exponent: lives in which it is the most probable one, and its mean probability."""
    lines = [
        f"{count} lives of eq. 6 each, seed {seed}, {TESTS} tests, scatter {SCATTER:.1%} of the value; exponents weighed: "
        f"{', '.join(f'{exponent:g}' for exponent in SEVERITY_EXPONENTS)}\n",
        "| energy of a cycle | true exponent | found | its probability, mean | off by, mean |",
        "|---|---|---|---|---|",
    ]
    for name, steps in STEPS.items():
        for exponent in (0.0, 1.0, 2.0):
            found = [severity_estimate(life(exponent, steps, seed + index), Assumptions()) for index in range(count)]
            known = [each for each in found if each is not None]
            right = np.mean([each.likeliest == exponent for each in known])
            believed = np.mean([each.probability[SEVERITY_EXPONENTS.index(exponent)] for each in known])
            off = np.mean([abs(each.mean - exponent) for each in known])
            lines.append(f"| {name} | {exponent:g} | {right:.0%} | {believed:.2f} | {off:.2f} |")
    return "\n".join(lines)
