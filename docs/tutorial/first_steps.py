# %% [markdown]
# # First steps: a clutch's tests, what they say, what comes next
# Run each cell against a service: `clutchlife serve` in another terminal.

# %%
import os

import numpy as np
from clutchlife import Client

rig = Client(os.environ.get("CLUTCHLIFE_URL", "http://127.0.0.1:8000"))
rig.register("first-steps", origin="simulated")

# %% [markdown]
# Six tests of a clutch that wears. The oil was warm in every second test, and thinner oil shears more easily: an effect that
# the service's model does not have.

# %%
rng = np.random.default_rng(3)
speed = np.tile(np.linspace(20, 1970, 40), 3)
pressure = np.repeat([2.0, 4.0, 6.0], 40)
for number, cycles in enumerate(range(0, 6000, 1000)):
    oil, viscosity = [(80.0, 1.0), (89.0, 0.8)][number % 2]
    friction = (4.4 - 0.2 * number) * (1 - 0.15 * np.exp(-300 / (viscosity * speed)))
    film = 0.15 * (viscosity * speed) ** 0.3
    channels = {
        "pressure_bar": pressure,
        "speed_rpm": speed,
        "torque_nm": pressure * (friction + film) * rng.normal(1, 0.01, speed.size),
        "oil_temperature_c": np.full(speed.size, oil),
    }
    receipt = rig.post_run("first-steps", kind="stationary_stribeck", cycles=cycles, channels=channels)
    print(cycles, receipt["fits"][0]["mean_cof"])

# %% [markdown]
# How long it will last, and the same under planned duty.

# %%
life = rig.remaining_useful_life("first-steps")
print(life["statement"], life["remaining_cycles"])
print(rig.forecast("first-steps", [{"cycles": 1000}], pace_cycles_per_hour=120)["end_of_life_at"])

# %% [markdown]
# What the model gets wrong. Here the report names the cause and offers an extended model: adopt it.

# %%
report = rig.diagnose("first-steps")
print(report["summary"])

# %%
rig.adopt("first-steps", report["diagnosis_id"])
print("with the extended model:", rig.remaining_useful_life("first-steps")["statement"])
