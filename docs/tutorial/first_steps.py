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
# Five tests of a clutch that wears: torque falls by a few per cent from test to test.

# %%
speed = np.linspace(20, 1970, 40)
for number, cycles in enumerate([0, 1000, 2000, 3000, 4000]):
    torque = (22.0 - 1.2 * number) * (1 - 0.1 * np.exp(-speed / 300)) - speed / 2000
    channels = {"pressure_bar": np.full(speed.size, 5.0), "speed_rpm": speed, "torque_nm": torque}
    receipt = rig.post_run("first-steps", kind="stationary_stribeck", cycles=cycles, channels=channels)
    print(cycles, receipt["fits"][0]["mean_cof"])

# %% [markdown]
# How long it will last, and the same under planned duty.

# %%
life = rig.remaining_useful_life("first-steps")
print(life["statement"], life["remaining_cycles"])
print(rig.forecast("first-steps", [{"cycles": 1000}], pace_cycles_per_hour=120)["end_of_life_at"])

# %% [markdown]
# What the simulation gets wrong about it.

# %%
print(rig.diagnose("first-steps")["summary"])

# %%
print(rig.runs("first-steps")[["run_id", "cycles", "state"]])
