"""`clutchlife serve`: one service, or several behind one port.

In: settings of the environment and the command line. Out: processes that answer until they are stopped. Open `serve.py`
first (what is checked and said before), then `services.py` (the processes).
"""
