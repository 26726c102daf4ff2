"""Published figures of the Staubli TX40 that the demo sets beside its own.

Source: Experimental Identification of the Inverse Dynamic Model: Minimal Encoder Resolution Needed, Application to an Industrial Robot Arm and a
Haptic Interface, in Robot Manipulators, M. Ceccarelli (ed.), InTech 2008, section 4.1, Tables 2, 3 and 4. SI units, joint side.
"""

from __future__ import annotations

from math import pi

NAMES = (
    "ZZ1R", "FV1", "FS1", "MX2R", "FV2", "FS2", "XX3R", "MX3", "Ia3", "FV3", "FS3", "Ia4", "FV4", "FS4", "OFFSET4", "Ia5", "FV5", "FS5", "Ia6",
    "FV6", "OFFSET6",
)  # fmt: skip
TABLE_2 = dict(zip(NAMES, (
    1.230, 8.070, 5.780, 2.090, 5.550, 7.540, 0.127, 0.045, 0.084, 2.240, 5.860, 0.027, 1.130, 2.310, 0.096, 0.053, 2.010, 3.780, 0.014, 0.721,
    0.166,
), strict=True))  # fmt: skip
TABLE_2_SIGMA = dict(zip(NAMES, (  # relative deviation, %
    0.483, 0.468, 1.610, 0.681, 0.632, 1.024, 5.306, 11.865, 4.013, 0.963, 0.992, 4.825, 0.604, 0.967, 15.960, 5.442, 1.114, 1.411, 8.324, 1.809,
    16.30,
), strict=True))  # fmt: skip
DELTA = (2 * pi / 10000, 2 * pi / 5000, 2 * pi / 2000, 2 * pi / 1000)  # rad: Delta 1 ... Delta 4 of Table 3
TABLE_3 = dict(zip(NAMES, (
    (1.200, 1.141, 0.850, 0.406), (8.120, 8.202, 8.175, 8.168), (5.620, 5.421, 5.399, 5.319), (2.110, 2.132, 2.269, 2.454),
    (5.570, 5.613, 5.658, 5.589), (7.570, 7.389, 7.196, 7.092), (0.122, 0.116, 0.084, 0.065), (0.055, 0.049, 0.046, 0.060),
    (0.086, 0.089, 0.100, 0.092), (2.440, 2.471, 2.525, 2.480), (5.770, 5.632, 5.475, 5.441), (0.027, 0.028, 0.024, 0.019),
    (1.150, 1.180, 1.182, 1.195), (2.220, 2.100, 2.091, 2.014), (0.071, 0.032, 0.040, 0.029), (0.051, 0.054, 0.043, 0.023),
    (2.080, 2.178, 2.232, 2.243), (3.590, 3.387, 3.184, 3.086), (0.014, 0.014, 0.013, 0.009), (0.744, 0.770, 0.793, 0.782),
    (0.120, 0.128, 0.133, 0.147),
), strict=True))  # fmt: skip
TABLE_3_RESIDUAL = ("<1 %", "<2 %", "<10 %", "~10 %")  # %e(rho)
TABLE_4 = dict(zip(NAMES, (  # Phi 1 ... Phi 4, each five times the one before; their values are not given
    (1.200, 1.192, 1.184, 1.170), (8.192, 8.180, 8.204, 8.188), (5.388, 5.457, 5.386, 5.417), (2.112, 2.114, 2.114, 2.116),
    (5.582, 5.581, 5.594, 5.605), (7.400, 7.371, 7.388, 7.375), (0.117, 0.120, 0.115, 0.115), (0.049, 0.046, 0.048, 0.056),
    (0.086, 0.087, 0.089, 0.092), (2.461, 2.463, 2.486, 2.480), (5.678, 5.674, 5.587, 5.643), (0.028, 0.028, 0.029, 0.028),
    (1.173, 1.174, 1.175, 1.173), (2.164, 2.133, 2.127, 2.127), (0.055, 0.064, 0.061, 0.070), (0.056, 0.055, 0.056, 0.055),
    (2.174, 2.160, 2.197, 2.206), (3.391, 3.443, 3.311, 3.291), (0.014, 0.014, 0.014, 0.015), (0.764, 0.762, 0.785, 0.761),
    (0.134, 0.139, 0.144, 0.123),
), strict=True))  # fmt: skip
TABLE_4_RESIDUAL = ("<1 %", "<2 %", "<3 %", "<4 %")
PHI = (0.002, 0.01, 0.05, 0.25)  # N m, motor side: ours, chosen in the ratio 1/5; the largest is above the ripple of the record

CONTRADICTIONS = (
    "Table 1 prints alpha 4, 5, 6 with signs for which eq. (27) does not hold; this study uses the signs of eq. (27). Table 1 as printed is the robot tx40_table1.",
    "The text says 60 base parameters; Table 1 gives 58. The two others are the friction FVM6, FSM6 of motor 6, which also turns with joint 5.",
    "Last row of Table 3: with %e(rho) as printed in (22) the residual grows by hundreds of per cent when ZZ1R loses two thirds of its value. The "
    "increase of the norm in per cent of the norm of Y has the printed order. Both are shown.",
    "The text below (28) speaks of motor positions; only noise on the joint side reproduces Table 3.",
    "The Gaussian rounding is called pessimistic; it has the variance of the two-point rounding and gives the same result.",
    "Phi of Table 4 is never given, and torque steps alone change nothing; the values of Table 4 resemble those of Table 3 at the first two steps, "
    "so they were perhaps found with position steps as well. Both cases are shown.",
)
