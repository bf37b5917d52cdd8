"""Chapter 2, the physics: one parameter vector and a design's points go in; the torque of every run and its derivatives come
out, from Stribeck curves over pressure and life (laws.py) and the lag of friction in loops (prediction.py).
Open prediction.py first: it joins the two.
"""
