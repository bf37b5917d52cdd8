"""`clutchlife demo`: a simulated life, posted to a service of its own.

In: a seed. Out: the prognosis after each test, a diagnosis, an open dashboard. Open `demo` first; `life` simulates.
"""
