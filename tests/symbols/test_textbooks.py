"""Closed forms against those of textbooks, by SymPy difference zero. The robots here have the
frames of the books; point masses and centres of mass are put in the place of the parameters by
substitution.

    [C]  J. J. Craig, Introduction to Robotics: Mechanics and Control, 3rd ed., Pearson 2005:
    section 3.7 (PUMA 560), section 6.7 (planar arm)
    [S]  M. W. Spong, S. Hutchinson, M. Vidyasagar, Robot Modeling and Control, Wiley 2006: section
    3.2 (cylindrical, Stanford), section 7.4 (elbow)
    [M]  R. M. Murray, Z. Li, S. S. Sastry, A Mathematical Introduction to Robotic Manipulation, CRC
    1994: section 4.3 (SCARA)
    [K]  W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, Hermes Penton 2002:
    chapters 3, 5 (RX-90: its determinant)

The books were not at hand when this was written: sections are given, not pages.
"""

from __future__ import annotations

import pytest
import sympy
from sympy import Matrix, Rational, cos, sin, symbols

import symgen
from oracles.exact_zero import are_zero, is_zero

q1, q2, q3, q4, q5, q6 = q = symbols("q1:7", real=True)
QP1, QP2, QP3 = symbols("QP1:4", real=True)
QDP1, QDP2, QDP3 = symbols("QDP1:4", real=True)
D2, D3, L, g = symbols("D2 D3 L g", real=True)


def real(names: str):
    return symbols(names, real=True)


def described(text: str) -> symgen.Robot:
    return symgen.parse_robot(text.encode(), "book.yaml")


PLANAR = described(
    """
symgen: 1
name: planar
gravity: [0, -g, 0]
constants: {D2: 0.5, D3: 0.4, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0,  theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}
  3: {ant: 2, sigma: 2, alpha: 0, d: D3, theta: 0,  r: 0}
massless: [3]
"""
)


def planar_values(centre: bool) -> dict:
    """[S]: centres of mass at lc, inertias I about them; [C]: point masses at the ends, lc = l, I =
    0.
    """
    m1, m2 = real("m1 m2")
    lc1, lc2 = real("lc1 lc2") if centre else (D2, D3)
    I1, I2 = real("I1 I2") if centre else (0, 0)
    zero = dict.fromkeys(real("MY1 MY2 XX1 XY1 XZ1 YY1 YZ1 XX2 XY2 XZ2 YY2 YZ2 MZ1 MZ2"), 0)
    M1, M2, MX1, MX2, ZZ1, ZZ2 = real("M1 M2 MX1 MX2 ZZ1 ZZ2")
    return zero | {
        M1: m1,
        M2: m2,
        MX1: m1 * lc1,
        MX2: m2 * lc2,
        ZZ1: I1 + m1 * lc1**2,
        ZZ2: I2 + m2 * lc2**2,
    }


def test_planar_arm_of_craig() -> None:
    """[C] section 6.7: joint torques of two point masses."""
    m1, m2 = real("m1 m2")
    found = (
        symgen.symbolic(PLANAR, parameters="standard").inverse_dynamics().subs(planar_values(False))
    )
    l1, l2, s2, c2, c1, c12 = D2, D3, sin(q2), cos(q2), cos(q1), cos(q1 + q2)
    tau1 = (
        m2 * l2**2 * (QDP1 + QDP2) + m2 * l1 * l2 * c2 * (2 * QDP1 + QDP2) + (m1 + m2) * l1**2 * QDP1
        - m2 * l1 * l2 * s2 * QP2**2 - 2 * m2 * l1 * l2 * s2 * QP1 * QP2 + m2 * l2 * g * c12 + (m1 + m2) * l1 * g * c1
    )  # fmt: skip
    tau2 = (
        m2 * l1 * l2 * c2 * QDP1
        + m2 * l1 * l2 * s2 * QP1**2
        + m2 * l2 * g * c12
        + m2 * l2**2 * (QDP1 + QDP2)
    )
    assert are_zero(found - Matrix([tau1, tau2]))


def test_planar_elbow_of_spong() -> None:
    """[S] section 7.4: D(q), Christoffel symbols with h = -m2 l1 lc2 sin q2, and the gravity
    vector.
    """
    m1, m2, lc1, lc2, I1, I2 = real("m1 m2 lc1 lc2 I1 I2")
    models, values = symgen.symbolic(PLANAR, parameters="standard"), planar_values(True)
    d22 = m2 * lc2**2 + I2
    d12 = m2 * (lc2**2 + D2 * lc2 * cos(q2)) + I2
    d11 = m1 * lc1**2 + m2 * (D2**2 + lc2**2 + 2 * D2 * lc2 * cos(q2)) + I1 + I2
    assert are_zero(models.inertia_matrix().subs(values) - Matrix([[d11, d12], [d12, d22]]))
    h = -m2 * D2 * lc2 * sin(q2)
    C = Matrix([[h * QP2, h * QP2 + h * QP1], [-h * QP1, 0]])
    assert are_zero(models.coriolis().subs(values) - C)
    phi = Matrix(
        [
            (m1 * lc1 + m2 * D2) * g * cos(q1) + m2 * lc2 * g * cos(q1 + q2),
            m2 * lc2 * g * cos(q1 + q2),
        ]
    )
    assert are_zero(models.gravity().subs(values) - phi)


def test_planar_jacobian() -> None:
    """[C] section 5.7, [S] section 4.6: Jacobian of the end of the two-link arm in frame 0 and in
    frame 3, and its determinant l1 l2 s2.
    """
    models = symgen.symbolic(PLANAR)
    J = Matrix(
        [
            [-D2 * sin(q1) - D3 * sin(q1 + q2), -D3 * sin(q1 + q2)],
            [D2 * cos(q1) + D3 * cos(q1 + q2), D3 * cos(q1 + q2)],
        ]
    )
    assert models.jacobian()[:2, :] == J
    assert are_zero(
        models.jacobian(frame=3)[:2, :] - Matrix([[D2 * sin(q2), 0], [D2 * cos(q2) + D3, D3]])
    )
    assert is_zero(models.determinant(rows=(1, 2)) - D2 * D3 * sin(q2))


def test_scara_of_murray() -> None:
    """[M] section 4.3: inertia matrix, Coriolis matrix and gravity of the SCARA by alpha, beta,
    gamma, delta.
    """
    m1, m2, m3, m4, r1, r2, I1, I2, I3, I4 = real("m1 m2 m3 m4 r1 r2 Iz1 Iz2 Iz3 Iz4")
    M, MX, ZZ = real("M1:5"), real("MX1:5"), real("ZZ1:5")
    names = [f"{p}{j}" for j in range(1, 5) for p in ("MY", "Ia", "FV", "FS", "OFFSET")]
    values = dict.fromkeys(real(" ".join(names)), 0)
    values |= {
        M[0]: m1,
        MX[0]: m1 * r1,
        ZZ[0]: I1 + m1 * r1**2,
        M[1]: m2,
        MX[1]: m2 * r2,
        ZZ[1]: I2 + m2 * r2**2,
    }
    values |= {M[2]: m3, MX[2]: 0, ZZ[2]: I3, M[3]: m4, MX[3]: 0, ZZ[3]: I4}
    models, l1, l2 = symgen.symbolic("scara", parameters="standard"), D2, D3
    a = I1 + r1**2 * m1 + l1**2 * (m2 + m3 + m4)
    b = I2 + I3 + I4 + l2**2 * (m3 + m4) + m2 * r2**2
    c = l1 * l2 * (m3 + m4) + l1 * m2 * r2
    d = I3 + I4
    c2, s2 = cos(q2), sin(q2)
    A = Matrix(
        [[a + b + 2 * c * c2, b + c * c2, d, 0], [b + c * c2, b, d, 0], [d, d, d, 0], [0, 0, 0, m4]]
    )
    assert are_zero(models.inertia_matrix().subs(values) - A)
    C = sympy.zeros(4, 4)
    C[0, 0], C[0, 1], C[1, 0] = -c * s2 * QP2, -c * s2 * (QP1 + QP2), c * s2 * QP1
    assert are_zero(models.coriolis().subs(values) - C)
    assert are_zero(models.gravity().subs(values) - Matrix([0, 0, 0, m4 * g]))


CYLINDRICAL = described(
    """
symgen: 1
name: cylindrical
gravity: [0, 0, -g]
constants: {L: 0.3, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0,     d: 0, theta: q1, r: L}
  2: {ant: 1, sigma: 1, alpha: 0,     d: 0, theta: 0,  r: q2}
  3: {ant: 2, sigma: 1, alpha: -pi/2, d: 0, theta: 0,  r: q3}
"""
)


def test_cylindrical_arm_of_spong() -> None:
    """[S] section 3.2, three-link cylindrical robot: T; and its dynamics with point mass m3 at the
    end of the slide, inertia I about the column.
    """
    models = symgen.symbolic(CYLINDRICAL, parameters="standard")
    c1, s1 = cos(q1), sin(q1)
    assert models.pose() == Matrix(
        [[c1, 0, -s1, -s1 * q3], [s1, 0, c1, c1 * q3], [0, -1, 0, L + q2], [0, 0, 0, 1]]
    )
    m2, m3, inertia = real("m2 m3 I")
    kept = dict(zip(real("M2 M3 ZZ1"), (m2, m3, inertia), strict=True))
    values = {x: kept.get(x, 0) for x in models.parameters}
    assert are_zero(
        models.inertia_matrix().subs(values) - sympy.diag(inertia + m3 * q3**2, m2 + m3, m3)
    )
    force = Matrix(
        [
            (inertia + m3 * q3**2) * QDP1 + 2 * m3 * q3 * QP1 * QP3,
            (m2 + m3) * (QDP2 + g),
            m3 * QDP3 - m3 * q3 * QP1**2,
        ]
    )
    assert are_zero(models.inverse_dynamics().subs(values) - force)


def test_spherical_arm_of_stanford() -> None:
    """[S] section 3.2, first three joints (RRP) of the Stanford manipulator: origin of the wrist,
    Jacobian, determinant -q3**2 sin q2.
    """
    models = symgen.symbolic("stanford")
    RL1, RL2 = real("RL1 RL2")
    c1, s1, c2, s2 = cos(q1), sin(q1), cos(q2), sin(q2)
    origin = Matrix([c1 * s2 * q3 - s1 * RL2, s1 * s2 * q3 + c1 * RL2, c2 * q3 + RL1])
    assert are_zero(models.pose(of=3)[:3, 3] - origin)
    J = models.jacobian(of=3)
    assert are_zero(J[:3, :3] - origin.jacobian([q1, q2, q3])) and J[:, 3:].is_zero_matrix
    three = described(
        """
symgen: 1
name: rrp
gravity: [0, 0, -g]
constants: {RL1: 0.4, RL2: 0.15, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0,     d: 0, theta: q1, r: RL1}
  2: {ant: 1, sigma: 0, alpha: -pi/2, d: 0, theta: q2, r: RL2}
  3: {ant: 2, sigma: 1, alpha: pi/2,  d: 0, theta: 0,  r: q3}
"""
    )
    rrp = symgen.symbolic(three, parameters="standard")
    assert is_zero(rrp.determinant(rows=(1, 2, 3)) + q3**2 * s2)
    m3 = real("M3")
    values = {x: 0 for x in rrp.parameters if x != m3}
    A = Matrix(
        [
            [m3 * (q3**2 * s2**2 + RL2**2), -m3 * RL2 * q3 * c2, -m3 * RL2 * s2],
            [-m3 * RL2 * q3 * c2, m3 * q3**2, 0],
            [-m3 * RL2 * s2, 0, m3],
        ]
    )
    assert are_zero(
        rrp.inertia_matrix().subs(values) - A
    )  # m3 J' J of the point mass at the origin above


CRAIG_PUMA = described(
    """
symgen: 1
name: puma
gravity: [0, 0, -g]
constants: {a2: 0.4318, a3: 0.0203, d3: 0.15, d4: 0.4318, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0,     d: 0,  theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: -pi/2, d: 0,  theta: q2, r: 0}
  3: {ant: 2, sigma: 0, alpha: 0,     d: a2, theta: q3, r: d3}
  4: {ant: 3, sigma: 0, alpha: -pi/2, d: a3, theta: q4, r: d4}
  5: {ant: 4, sigma: 0, alpha: pi/2,  d: 0,  theta: q5, r: 0}
  6: {ant: 5, sigma: 0, alpha: -pi/2, d: 0,  theta: q6, r: 0}
"""
)


def test_puma_of_craig() -> None:
    """[C] section 3.7: 4T6, 3T6, 1T3 and 0T6 of the PUMA 560."""
    a2, a3, d3, d4 = real("a2 a3 d3 d4")
    c1, s1, c4, s4, c5, s5, c6, s6 = (f(x) for x in (q1, q4, q5, q6) for f in (cos, sin))
    c2, s2, c23, s23 = cos(q2), sin(q2), cos(q2 + q3), sin(q2 + q3)
    models = symgen.symbolic(CRAIG_PUMA)
    assert models.pose(of=6, frame=4) == Matrix(
        [[c5 * c6, -c5 * s6, -s5, 0], [s6, c6, 0, 0], [s5 * c6, -s5 * s6, c5, 0], [0, 0, 0, 1]]
    )
    T36 = Matrix(
        [
            [c4 * c5 * c6 - s4 * s6, -c4 * c5 * s6 - s4 * c6, -c4 * s5, a3],
            [s5 * c6, -s5 * s6, c5, d4],
            [-s4 * c5 * c6 - c4 * s6, s4 * c5 * s6 - c4 * c6, s4 * s5, 0],
            [0, 0, 0, 1],
        ]
    )
    assert models.pose(of=6, frame=3) == T36
    assert models.pose(of=3, frame=1) == Matrix(
        [[c23, -s23, 0, a2 * c2], [0, 0, 1, d3], [-s23, -c23, 0, -a2 * s2], [0, 0, 0, 1]]
    )
    T = models.pose()
    wrist, turned = c4 * c5 * c6 - s4 * s6, s4 * c5 * c6 + c4 * s6
    assert is_zero(T[0, 0] - (c1 * (c23 * wrist - s23 * s5 * c6) + s1 * turned))
    assert is_zero(T[1, 0] - (s1 * (c23 * wrist - s23 * s5 * c6) - c1 * turned))
    assert is_zero(T[2, 0] - (-s23 * wrist - c23 * s5 * c6))
    assert is_zero(T[0, 2] - (-c1 * (c23 * c4 * s5 + s23 * c5) - s1 * s4 * s5))
    assert is_zero(T[2, 2] - (s23 * c4 * s5 - c23 * c5))
    reach = a2 * c2 + a3 * c23 - d4 * s23
    assert are_zero(
        T[:3, 3]
        - Matrix([c1 * reach - d3 * s1, s1 * reach + d3 * c1, -a3 * s23 - a2 * s2 - d4 * c23])
    )
    assert models.jacobian(frame=4)[3:, 3:] == Matrix(
        [[0, 0, -s5], [0, -1, 0], [1, 0, c5]]
    )  # axes of the wrist in frame 4


def test_singularities_of_the_puma() -> None:
    """Elbow, shoulder and wrist of a PUMA 560 are factors: a3 s3 + d4 c3 (up to signs of alpha),
    the reach from axis 1, s5.
    """
    a2, a3, d4 = real("a2 a3 d4")
    det = symgen.symbolic(CRAIG_PUMA).determinant()
    elbow, reach = a3 * sin(q3) + d4 * cos(q3), a2 * cos(q2) + a3 * cos(q2 + q3) - d4 * sin(q2 + q3)
    assert is_zero(det - a2 * elbow * reach * sin(q5)) or is_zero(
        det + a2 * elbow * reach * sin(q5)
    )
    assert len(det.as_ordered_factors()) >= 4


def test_determinant_of_khalil() -> None:
    """[K] chapter 5: singularities of the RX-90, det J = -D3 RL4 c3 s5 (s23 RL4 - c2 D3)."""
    RL4 = real("RL4")
    expected = -D3 * RL4 * cos(q3) * sin(q5) * (sin(q2 + q3) * RL4 - cos(q2) * D3)
    assert is_zero(symgen.symbolic("rx90").determinant() - expected)


@pytest.mark.parametrize(
    ("name", "number"), [("D2", Rational(1, 2)), ("q2", sympy.pi / 2), ("M2", 3)]
)
def test_values_are_substitutions(name: str, number) -> None:
    """A value in the place of a symbol, zeros and right angles that leave the recursion included."""
    for model in ("inertia_matrix", "inverse_dynamics", "coriolis", "potential_energy"):
        free = getattr(symgen.symbolic(PLANAR, parameters="standard"), model)()
        fixed = getattr(
            symgen.symbolic(PLANAR, parameters="standard", values={name: number}), model
        )()
        difference = free.subs(real(name), number) - fixed
        assert are_zero(difference if hasattr(difference, "shape") else Matrix([difference])), model
