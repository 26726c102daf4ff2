"""Published figures of the haptic interface that the demo sets beside its own; fC of the chapter is FS here.

Source: Experimental Identification of the Inverse Dynamic Model: Minimal Encoder Resolution Needed, Application to an Industrial Robot Arm and a
Haptic Interface, in Robot Manipulators, M. Ceccarelli (ed.), InTech 2008, section 4.2, Tables 6 and 7. SI units, joint side.
"""

from __future__ import annotations

NAMES = (
    "ZZ1R", "MY1R", "FS1", "XX2R", "ZZ2R", "MX2R", "FS2R", "OFFSET2", "XX3R", "ZZ3R", "MX3R", "MX5R", "FS5R", "OFFSET5",
)  # fmt: skip
INERTIA = tuple(name for name in NAMES if name[:2] in ("ZZ", "XX"))
GRAVITY = tuple(name for name in NAMES if name[:2] in ("MX", "MY"))
TABLE_6 = dict(zip(NAMES, (  # column LS Identified Value; the column CESTAC repeats it
    "0.051", "0.024", "0.12", "-0.023", "0.029", "-0.019", "0.11", "0.020", "-0.011", "0.014", "0.039", "0.068", "0.11", "0.030",
), strict=True))  # fmt: skip
TABLE_6_CAD = dict(zip(NAMES, (  # * identified by specific tests
    "0.050", "0.025", "0.12*", "-0.023", "0.03", "-0.02", "0.11*", "0.03", "-0.012", "0.014", "0.04", "0.07", "0.11*", "0.03",
), strict=True))  # fmt: skip
TABLE_7 = dict(zip(NAMES, (  # %e at Delta = 2 pi/4000, 2 pi/100, 2 pi/80 of the motor
    ("<1", "1", "4"), ("<1", "2", "6"), ("<1", "<1", "1"), ("<1", "2", "5"), ("<1", "1", "4"), ("<1", "3", "6"), ("<1", "<1", "<1"),
    ("<1", "<1", "5"), ("<1", "2", "5"), ("<1", "<1", "<1"), ("<1", "<1", "2"), ("<1", "<1", "2"), ("<1", "<1", "<1"), ("<1", "<1", "<1"),
), strict=True))  # fmt: skip
TABLE_7_RESIDUAL = ("<1", "5", ">10")  # %e(rho)
APPEARS = {"two-point": 100, "uniform": 100, "gaussian": 200}  # counts at which small variations appear, section 4.2.3
