"""Units and physical constants: SI inside, everyday units only at the edges.

The package computes in metres, newtons, pascals, seconds and radians. Study files, tables and
reports use millimetres, km/h, tonnes, MGT (million gross tonnes), days and kPa; the factors
below convert between the two: multiply to enter SI, divide to leave it.
"""

MM = 1e-3  # m
KMH = 1.0 / 3.6  # m/s
TONNE = 1e3  # kg
MGT = 1e9  # kg (a million gross tonnes)
KPA = 1e3  # Pa
MPA = 1e6  # Pa
KN = 1e3  # N
DAYS_PER_YEAR = 365.0  # d/year, the year of the paper's economics
GRAVITY = 9.81  # m/s²
