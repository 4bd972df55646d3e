"""Camera, calibration, jobs and examinations behind the pages and the calls; no web imports."""
