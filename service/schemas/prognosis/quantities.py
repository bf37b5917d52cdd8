"""The public names of quantities, by what they come from; lists of names elsewhere are made of these."""

from typing import Literal

ParameterQuantity = Literal["static_torque_nm", "coulomb_ratio", "stribeck_velocity_m_s", "viscous_coefficient"]
LoopQuantity = Literal["attractor", "film_time", "loop_area"]
EngagementQuantity = Literal[
    "stop_time_s",
    "engagement_energy_kj",
    "peak_power_kw",
    "initial_cof",
    "midpoint_cof",
    "endpoint_cof",
    "breakaway_cof",
    "initial_cof_ratio",
    "endpoint_cof_ratio",
    "breakaway_cof_ratio",
    "torque_rise",
    "normalised_duration",
    "euclidean_distance",
    "spectral_angle_rad",
]
#: Other names of three of them, as a record's criteria and a query may have them.
ALIASES = {"static_ratio": "breakaway_cof_ratio", "stop_time": "stop_time_s", "energy": "engagement_energy_kj"}
#: Measured at a pressure level.
LevelQuantity = Literal[ParameterQuantity, "slope", LoopQuantity]
#: Tracked along a life.
QuantityName = Literal["mean_cof", LevelQuantity, EngagementQuantity]
#: Rows of `/series`.
SeriesQuantity = Literal[
    "mean_cof",
    LevelQuantity,
    EngagementQuantity,
    "health",
    "remaining_cycles",
    "at_least",
    "probability_of_reaching",
    "held_runs",
]
