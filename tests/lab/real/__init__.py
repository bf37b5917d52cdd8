"""Real measurements, where they lie beside the project: `make real` posts them to a service and prints what it says."""
