"""The diagnosis: a campaign goes in, a report comes out. Open `diagnose.py`: it is the table of contents of the chapters.

Chapters in order: campaign, criteria, design, baseline, noise, effects, pooled_fit, extension, detection, attribution,
validation, experiments, report, diagnose. A chapter imports only earlier ones.
"""
