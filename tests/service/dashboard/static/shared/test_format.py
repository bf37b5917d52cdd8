"""Numbers as a person reads them: ordinary values, none at all, and the edges of each rule."""

import json
import math
from collections.abc import Callable
from typing import Any

import pytest

from tests.browser.modules import Module

pytestmark = pytest.mark.browser

#: What is no number to show.
NOTHING = (None, math.nan, math.inf, -math.inf)
#: A function, its arguments as JSON, its text. Eight decimals at most; two digits stay however wide an interval is; no minus
#: before nothing but zeros; a first digit of 1 is followed by a second one; a clock may be ahead.
TABLE = """
quantity ["oil_temperature_c"]                 = Oil temperature, °C
quantity ["pressure_bar"]                      = Pressure, bar
quantity ["speed_rpm"]                         = Speed, rpm
quantity ["torque_nm"]                         = Torque, Nm
quantity ["time_s"]                            = Time, s
quantity ["frequency_hz"]                      = Frequency, Hz
quantity ["cycles"]                            = Cycles
quantity ["mean_cof"]                          = Mean cof
quantity ["_c"]                                = , °C
quantity [""]                                  =
fixed [0, 0]                                   = 0
fixed [1234567, 0]                             = 1,234,567
fixed [1234.5678, 2]                           = 1,234.57
fixed [0.5, 0]                                 = 1
fixed [-3.14159, 3]                            = −3.142
fixed [-0.0004, 2]                             = 0.00
fixed [-0.006, 2]                              = −0.01
fixed [2, 4]                                   = 2.0000
fixed [-0.0, 1]                                = 0.0
fixed [2.4]                                    = 2
significant [0, 3]                             = 0
significant [1, 3]                             = 1.00
significant [3.14159, 3]                       = 3.14
significant [-3.14159, 2]                      = −3.1
significant [31415.9, 3]                       = 31,400
significant [999.6, 3]                         = 1,000
significant [0.0012345, 3]                     = 0.00123
significant [0.0001, 1]                        = 0.0001
significant [9.9e-05, 2]                       = 9.9e−5
significant [-2e-05, 2]                        = −2.0e−5
significant [999999, 2]                        = 1,000,000
significant [1000000.0, 3]                     = 1.00e+6
significant [7234600000.0, 4]                  = 7.235e+9
significant [0.6666666666666666]               = 0.667
withSd [21.23456, 0.34]                        = 21.2 ± 0.3
withSd [21.23456, 0.14]                        = 21.23 ± 0.14
withSd [21.23456, 0.19999]                     = 21.23 ± 0.20
withSd [0.13412, 0.00112]                      = 0.1341 ± 0.0011
withSd [1234.5, 25]                            = 1,235 ± 25
withSd [-0.2, 0.05]                            = −0.20 ± 0.05
withSd [5, 0]                                  = 5.000
withSd [5, null]                               = 5.000
withSd [5, NaN]                                = 5.000
withSd [5, Infinity]                           = 5.000
withSd [1, 3e-12]                              = 1.00000000 ± 0.00000000
withSd [null, 1]                               = –
withSd [NaN, 1]                                = –
cycles [0]                                     = 0
cycles [7]                                     = 7
cycles [7000.4]                                = 7,000
cycles [12345, 10000, 15000]                   = 12,300
cycles [12345, 12000, 12150]                   = 12,350
cycles [12345, 0, 20]                          = 12,345
cycles [12345, 0, 1000000000.0]                = 12,000
cycles [123456]                                = 123,500
cycles [3, 0, 1000000.0]                       = 3
cycles [12345, 10000, null]                    = 12,350
cycles [-4321, 0, 1000000.0]                   = −4,300
interval [{"0.05": 1234, "0.5": 3, "0.95": 5678}] = 1,200 to 5,700
interval [{"0.05": 0, "0.5": 3, "0.95": 400}]  = 0 to 400
interval [{"0.05": 1234, "0.5": 3, "0.95": null}] = 1,200 to over 1,000,000
interval [{"0.05": 12345, "0.5": 3, "0.95": null}] = 12,000 to over 1,000,000
interval [{"0.05": 0.4, "0.5": 3, "0.95": null}] = 0 to over 1,000,000
interval [{"0.05": null, "0.5": 3, "0.95": null}] = –
interval [{"0.05": null, "0.5": 3, "0.95": 5678}] = – to 5,680
interval [{"0.05": 100, "0.5": 3, "0.95": 100}] = 100 to 100
percent [0.123, 0]                             = 12 %
percent [0.123, 1]                             = 12.3 %
percent [0, 0]                                 = 0 %
percent [1, 0]                                 = 100 %
percent [-0.2, 0]                              = −20 %
percent [1.5, 1]                               = 150.0 %
probability [0]                                = < 1 %
probability [1e-09]                            = < 1 %
probability [0.00499]                          = < 1 %
probability [0.005]                            = 1 %
probability [0.5]                              = 50 %
probability [0.995]                            = > 99 %
probability [0.9951]                           = > 99 %
probability [0.999999]                         = > 99 %
probability [1]                                = > 99 %
age [0, 0]                                     = just now
age [-4999, 0]                                 = just now
age [3600000, 0]                               = just now
age [-5000, 0]                                 = 5 s ago
age [-59999, 0]                                = 59 s ago
age [-60000, 0]                                = 1 min ago
age [-3540000, 0]                              = 59 min ago
age [-3600000, 0]                              = 1 h ago
age [-82800000, 0]                             = 23 h ago
age [-86400000, 0]                             = 1 day ago
age [-172800000, 0]                            = 2 days ago
age [-31449600000, 0]                          = 364 days ago
age [-31536000000, 0]                          = 1 year ago
age [-69120000000, 0]                          = 2 years ago
moment ["2026-11-02T08:00:00+01:00"]           = 2 Nov 2026, 08:00
moment ["2026-07-02T22:30:00Z"]                = 3 Jul 2026, 00:30
moment [""]                                    = –
moment [null]                                  = –
kindName ["stationary_stribeck"]               = Stationary Stribeck test
kindName ["dynamic_stribeck"]                  = Dynamic Stribeck test
kindName ["duty_cycles"]                       = Duty cycles
kindName ["run_in"]                            = Run-in
kindName ["maintenance"]                       = Maintenance
kindName ["another_kind"]                      = Another kind
words ["oil_change"]                           = Oil change
words ["x"]                                    = X
words [""]                                     =
words [7]                                      = 7
seconds [0]                                    = 1 s
seconds [400]                                  = 1 s
seconds [1499]                                 = 1 s
seconds [1500]                                 = 2 s
seconds [59999]                                = 60 s
seconds [60000]                                = 1 min
seconds [95000]                                = 2 min
"""
CASES = [
    (called.split(" ", 1), text.strip()) for called, text in (row.split(" =", 1) for row in TABLE.split("\n")[1:-1])
]


@pytest.fixture(scope="module")
def shown(loaded: Callable[[str], Module]) -> Module:
    return loaded("shared/format.js")


@pytest.mark.parametrize("name", sorted({name for (name, _), _ in CASES}))
def test_numbers_are_shown_as_the_table_has_them(shown: Module, name: str) -> None:
    for (function, arguments), text in CASES:
        if function == name:
            assert shown(name, *json.loads(arguments)) == text, (name, arguments)


def test_the_clock_of_the_reader(shown: Module) -> None:
    assert shown.evaluate("m => m.age(Date.now() - 3 * 60_000)") == "3 min ago"
    assert shown.evaluate("m => m.clock(new Date('2026-11-02T08:05:09+01:00'))") == "08:05:09"


@pytest.mark.parametrize("name", ["fixed", "significant", "withSd", "cycles", "percent", "probability"])
def test_what_is_no_number_is_a_dash(shown: Module, name: str) -> None:
    arguments: list[Any] = [1] if name == "withSd" else []
    assert [shown(name, value, *arguments) for value in NOTHING] == ["–"] * len(NOTHING)
    assert shown.evaluate(f"m => m.{name}(undefined)") == "–"
