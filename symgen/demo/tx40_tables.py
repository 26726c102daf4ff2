"""Published figures of the Staubli TX40 that the demo sets beside its own.

Source: Experimental Identification of the Inverse Dynamic Model: Minimal Encoder Resolution Needed,
Application to an Industrial Robot Arm and a Haptic Interface, in Robot Manipulators, M. Ceccarelli
(ed.), InTech 2008, section 4.1, Tables 2, 3 and 4. SI units, joint side.
"""

from __future__ import annotations

from math import pi

# Table 2 with its %sigma; Table 3 at Delta 1 ... 4; Table 4 at Phi 1 ... 4, each five times the one
# before: their values are not given.
_PRINTED = """
ZZ1R      1.230   0.483    1.200  1.141  0.850  0.406    1.200  1.192  1.184  1.170
FV1       8.070   0.468    8.120  8.202  8.175  8.168    8.192  8.180  8.204  8.188
FS1       5.780   1.610    5.620  5.421  5.399  5.319    5.388  5.457  5.386  5.417
MX2R      2.090   0.681    2.110  2.132  2.269  2.454    2.112  2.114  2.114  2.116
FV2       5.550   0.632    5.570  5.613  5.658  5.589    5.582  5.581  5.594  5.605
FS2       7.540   1.024    7.570  7.389  7.196  7.092    7.400  7.371  7.388  7.375
XX3R      0.127   5.306    0.122  0.116  0.084  0.065    0.117  0.120  0.115  0.115
MX3       0.045  11.865    0.055  0.049  0.046  0.060    0.049  0.046  0.048  0.056
Ia3       0.084   4.013    0.086  0.089  0.100  0.092    0.086  0.087  0.089  0.092
FV3       2.240   0.963    2.440  2.471  2.525  2.480    2.461  2.463  2.486  2.480
FS3       5.860   0.992    5.770  5.632  5.475  5.441    5.678  5.674  5.587  5.643
Ia4       0.027   4.825    0.027  0.028  0.024  0.019    0.028  0.028  0.029  0.028
FV4       1.130   0.604    1.150  1.180  1.182  1.195    1.173  1.174  1.175  1.173
FS4       2.310   0.967    2.220  2.100  2.091  2.014    2.164  2.133  2.127  2.127
OFFSET4   0.096  15.960    0.071  0.032  0.040  0.029    0.055  0.064  0.061  0.070
Ia5       0.053   5.442    0.051  0.054  0.043  0.023    0.056  0.055  0.056  0.055
FV5       2.010   1.114    2.080  2.178  2.232  2.243    2.174  2.160  2.197  2.206
FS5       3.780   1.411    3.590  3.387  3.184  3.086    3.391  3.443  3.311  3.291
Ia6       0.014   8.324    0.014  0.014  0.013  0.009    0.014  0.014  0.014  0.015
FV6       0.721   1.809    0.744  0.770  0.793  0.782    0.764  0.762  0.785  0.761
OFFSET6   0.166  16.300    0.120  0.128  0.133  0.147    0.134  0.139  0.144  0.123
"""
_ROWS = {name: tuple(map(float, x)) for name, *x in map(str.split, _PRINTED.split("\n")[1:-1])}
TABLE_2 = {name: x[0] for name, x in _ROWS.items()}
TABLE_2_SIGMA = {name: x[1] for name, x in _ROWS.items()}  # relative deviation, %
TABLE_3 = {name: x[2:6] for name, x in _ROWS.items()}
TABLE_4 = {name: x[6:] for name, x in _ROWS.items()}
TABLE_3_RESIDUAL = ("<1 %", "<2 %", "<10 %", "~10 %")  # %e(rho)
TABLE_4_RESIDUAL = ("<1 %", "<2 %", "<3 %", "<4 %")
DELTA = tuple(2 * pi / counts for counts in (10000, 5000, 2000, 1000))  # rad: Delta 1 ... Delta 4
PHI = (0.002, 0.01, 0.05, 0.25)
"""N m, motor side: ours, in the ratio 1/5; the largest is above the ripple of the record."""
MAIN = (
    "ZZ1R", "FV1", "FS1", "XX2R", "ZZ2R", "MX2R", "FV2", "FS2", "MY3R", "Ia3", "FV3",
    "FS3", "Ia4", "FV4", "FS4", "Ia5", "FV5", "FS5", "FV6"
)  # fmt: skip
"""Parameters that carry the model of the public record."""

CONTRADICTIONS = (
    "Table 1 prints alpha 4, 5, 6 with signs for which eq. (27) does not hold; this study uses "
    "the signs of eq. (27). Table 1 as printed is the robot tx40_table1.",
    "The text says 60 base parameters; Table 1 gives 58. The two others are the friction FVM6, "
    "FSM6 of motor 6, which also turns with joint 5.",
    "Last row of Table 3: with %e(rho) as printed in (22) the residual grows by hundreds of per "
    "cent when ZZ1R loses two thirds of its value. The increase of the norm in per cent of the "
    "norm of Y has the printed order. Both are shown.",
    "The text below (28) speaks of motor positions; only noise on the joint side reproduces "
    "Table 3.",
    "The Gaussian rounding is called pessimistic; it has the variance of the two-point "
    "rounding and gives the same result.",
    "Phi of Table 4 is never given, and torque steps alone change nothing; the values of Table 4 "
    "resemble those of Table 3 at the first two steps, so they were perhaps found with position "
    "steps as well. Both cases are shown.",
)
