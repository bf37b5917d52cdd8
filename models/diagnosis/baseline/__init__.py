"""Chapter 2, the physics: predicts the torque of every run, with derivatives, from one parameter vector. In go a parameter
vector and a design's points; out come torque and derivatives, from Stribeck curves over pressure and life (laws.py) and the
lag of friction in loops (prediction.py). Open prediction.py first: it joins the two.
"""
