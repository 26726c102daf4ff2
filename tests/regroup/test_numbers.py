"""Robots that carry numbers: exact certificates, formulas as the file writes them, torques of the
emitted module; nothing hangs.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from campaign import FULL, campaign, sampled, some

from oracles.numeric_robots import describe_numbers, numeric_robot
from symgen import Robot, SymgenError, load_robot, parse_robot, regrouping
from symgen.certify.certificate import Certificate, certify_formulas
from symgen.certify.modules import certified_files, certify
from symgen.derive.constants import keep_rationals, units_of
from symgen.description.expression import Expression, Number, call
from symgen.description.values import at_values, exact
from symgen.regroup.regrouping import EXACT, BaseParameter, Regrouping

HEAD = "symgen: 1\nname: x\ngravity: {gravity}\nconstants: {{{constants}}}\nframes:\n"
SLOWEST = 60.0  # s of processor time, a bound that no robot comes near


def arm(
    *rows: str, gravity: str = "[0, 0, -g]", constants: str = "g: 9.81", rest: str = ""
) -> Robot:
    """A robot from rows `alpha d theta r` of a chain of hinges; a row that starts with { is taken
    as it is.
    """
    text = HEAD.format(gravity=gravity, constants=constants)
    for j, row in enumerate(rows, start=1):
        if not row.startswith("{"):
            alpha, d, theta, r = row.split()
            row = f"{{ant: {j - 1}, sigma: 0, alpha: {alpha}, d: {d}, theta: {theta}, r: {r}}}"
        text += f"  {j}: {row}\n"
    return parse_robot((text + rest).encode(), "x.yaml")


def slide(ant: int, j: int, d: str = "0", mu: int = 1) -> str:
    return f"{{ant: {ant}, sigma: 1, mu: {mu}, alpha: 0, d: {d}, theta: 0, r: q{j}}}"


ROBOTS = {
    "square root beside its angle": arm(
        "0 0 q1 0", "pi/6 0.4 q2 sqrt(3)/2", "pi/6 0.3 q3 sqrt(3)/2"
    ),
    "square root as a length": arm("0 0 q1 0", "pi/2 sqrt(3)/2 q2 0", "0 0.4 q3 0"),
    "slide before a hinge, 9.80665": arm(
        slide(0, 1),
        "0 0.4318 q2 0",
        gravity="[0, 0, -9.80665]",
        rest="elements:\n  Ia: {kind: inertia, along: all}\n  OFFSET: {kind: offset, along: all}\n",
    ),
    "SCARA in numbers": arm(
        "0 0 q1 0.4318",
        "0 0.325 q2 0",
        "0 0.2251 q3 0",
        slide(3, 4, "0.0123"),
        gravity="[0, 0, -9.80665]",
        rest=(
            "elements:\n  Ia: {kind: inertia, along: all}\n  FV: {kind: viscous, along: all}\n  "
            "OFFSET: {kind: offset, along: all}\n"
        ),
    ),
    "gears": arm(
        "0 0 q1 0",
        "pi/2 0 q2 0",
        rest="elements:\n  IM: {kind: inertia, along: {1: 101.25*q1, 2: 1798/7*q2}}\n  FV: {kind: "
        "viscous, along: all}\n"
        "  FM: {kind: viscous, along: {1: 101.25*q1, 2: 80*q2}}\n",
    ),
    "inertia along 100*q1": arm(
        "0 0 q1 0", rest="elements: {IM: {kind: inertia, along: {1: 100*q1}}}\n"
    ),
    "friction along sum and difference": arm(
        "0 0 q1 0",
        "pi/2 D2 q2 0",
        constants="g: 9.81, D2: 0.3",
        rest="elements:\n  FA: {kind: viscous, along: {1: q1 + q2}}\n  FB: {kind: viscous, along: "
        "{1: q1 - q2}}\n"
        "  SA: {kind: coulomb, along: {1: q1 + q2}}\n  SB: {kind: coulomb, along: {1: q1 - q2}}\n",
    ),
    "star of massless slides": arm(
        "0 0 q1 0",
        *(slide(0, j) for j in range(2, 22)),
        gravity="[0, -g, 0]",
        rest="massless: [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21]\n"
        "elements:\n  FV: {kind: viscous, along: all}\n  FS: {kind: coulomb, along: {1: q1}}\n  "
        "OFFSET: {kind: offset, along: {1: q1}}\n"
        "  K: {kind: stiffness, along: {1: q1}}\n",
    ),
    "pi in the offset of a mimic slide": arm(
        "0 0 q1 0",
        "{ant: 1, sigma: 0, mu: 0, alpha: 0, d: L, theta: q2, r: 0}",
        "{ant: 2, sigma: 0, mu: 0, alpha: 0, d: L, theta: q3, r: 0}",
        "{ant: 3, sigma: 1, mu: 0, alpha: pi/2, d: L, theta: 0, r: q4}",
        gravity="[0, -g, 0]",
        constants="L: 0.1, g: 9.81, c: 0.2",
        rest=(
            "constraints: {q2: q1 + c, q3: 2*q2 - pi/3, q4: 0.05*q3}\nelements: {FV: {kind: "
            "viscous, along: all}}\n"
        ),
    ),
    "an odd fraction of pi": arm("0 0 q1 0", "0.123456789*pi 0.3 q2 0", "0.123456789*pi 0.2 q3 0"),
    "odd fractions of pi that add up to a right angle": arm(
        "0 0 q1 0", "0.123456789*pi 0.3 q2 0", "0.376543211*pi 0.2 q3 0.1", "0.2 0.1 q4 0"
    ),
    "many fractions of pi": arm(
        "0 0 q1 0", "pi/7 0.3 q2 0", "pi/9 0.2 q3 0.1", "pi/11 0.1 q4 0", "pi/13 0.1 q5 0"
    ),
    "decimal angles": arm(
        "0 0 q1 0",
        "1.23456 0.3 q2 0",
        "0.7854 0.2 q3 0.1",
        "0.123456789012 0.1 q4 0",
        "-2.469 0.1 q5 0",
    ),
    "roots of large numbers": arm(
        "0 0 q1 0",
        "pi/2 sqrt(1009) q2 0",
        "0 sqrt(2)*sqrt(3) q3 sqrt(6)",
        "pi/2 sqrt(123456789) q4 0",
    ),
    "roots of constants": arm(
        "0 0 q1 0",
        "pi/2 sqrt(a**2+b**2) q2 0",
        "0 a q3 b",
        "pi/3 sqrt(a**2+b**2) q4 0",
        constants="g: 9.81, a: 0.3, b: 0.4",
    ),
    "nested roots": arm(
        "0 0 q1 0", "pi/8 sqrt(2+sqrt(2))/2 q2 0", "pi/8 sqrt(2+sqrt(2))/2 q3 0", "pi/4 0.1 q4 0"
    ),
    "nested roots that few primes have": arm(
        "0 0 q1 0",
        "pi/2 sqrt(123456789123456789123)*1e-11 q2 sqrt(2+sqrt(3+sqrt(5)))",
        "0 0.3 q3 0",
    ),
    "twenty-nine digits": arm(
        "0 0 q1 0",
        "0 0.12345678901234567890123456789 q2 0",
        "0 0.98765432109876543210987654321 q3 0",
    ),
    "frames without mass between links, at decimal angles": arm(
        "0 0 q1 0",
        "1.2345678 0.3 q2 0",
        "{ant: 2, sigma: 2, alpha: 0.9876543, d: 0.1, theta: 0.3456789, r: 0.05}",
        "{ant: 3, sigma: 2, alpha: pi/2, d: 0, theta: 0, r: 0.07}",
        "{ant: 4, sigma: 0, alpha: 0.7654321, d: 0.2, theta: q5, r: 0}",
        "{ant: 3, sigma: 1, alpha: 0.5432101, d: 0.2, theta: 0, r: q6}",
        rest="massless: [3, 4]\n",
    ),
    "lengths that add up": arm(
        "0 0 q1 0", "pi/2 0.3 q2 0", "0 0.2 q3 0", "0 0.5 q4 0", "pi/2 -0.5 q5 0"
    ),
}


@pytest.mark.parametrize("what", sampled(ROBOTS, 10))
@some(5)
def test_certified_with_its_emitted_module(what: str) -> None:
    certificate = certify(regrouping(ROBOTS[what]))
    assert certificate.valid, certificate
    assert certificate.primes and max(certificate.errors.values()) < 1e-10


def test_many_decimal_angles_are_read_quickly() -> None:
    rng = np.random.default_rng(8)
    rows = [
        f"{rng.uniform(-3, 3):.12f}+{rng.uniform(-3, 3):.11f}*pi 0.1 q{j} 0" for j in range(1, 41)
    ]
    robot = arm(
        "0 0 q1 0", *(row.replace(f"q{j}", f"q{j + 1}") for j, row in enumerate(rows, start=1))
    )
    start = time.process_time()
    units = units_of(robot)
    assert time.process_time() - start < 2
    for f in robot.frames[1:]:
        parts = units.of(f.alpha)
        assert float(sum(k * c * (np.pi if m else 1) for (m, c), k in parts)) == pytest.approx(
            f.alpha.value({})
        )


def formulas(robot: Robot) -> dict[str, str]:
    return {b.name: str(b.formula) for b in regrouping(robot).base}


def test_numbers_stay_as_they_are_written() -> None:
    scara = formulas(ROBOTS["SCARA in numbers"])
    assert "0.2251**2*M4" in scara["ZZ2R"].replace("(M4)", "M4") or "0.2251**2" in scara["ZZ2R"], (
        scara
    )
    assert formulas(ROBOTS["inertia along 100*q1"])["ZZ1R"] == "ZZ1 + 100**2*IM1"
    assert formulas(ROBOTS["gears"])["FV2R"] == "FV2 + 80**2*FM2"


def test_known_cosines_and_roots_get_their_values() -> None:
    text = " ".join(formulas(ROBOTS["square root beside its angle"]).values())
    assert "cos(" not in text and "sqrt(3)**2" not in text and "sin(" not in text


def test_roots_are_one_normal_form() -> None:
    def sqrt(c: int | str) -> Expression:
        return call("sqrt", Expression.number(c))

    assert (
        sqrt(12) == sqrt(3) * 2
        and sqrt(2) * sqrt(3) == sqrt(6)
        and sqrt("3/4") ** 2 == Expression.number("3/4")
    )
    assert sqrt(3).inverse() * 3 == sqrt(3) and (1 + sqrt(5)) * (sqrt(5) - 1) == Expression.number(
        4
    )


def test_kept_numbers_have_their_value() -> None:
    e = Expression.number("0.4318") * Expression.symbol("a") - 2
    assert keep_rationals(e) != e and keep_rationals(e).value({"a": 3.0}) == e.value({"a": 3.0})
    assert {a for a in keep_rationals(e).atoms if isinstance(a, Number)} and str(
        keep_rationals(e)
    ) == "0.4318*a - 2"


def test_values_at_which_a_formula_divides_by_zero_are_told() -> None:
    """A right angle of the haptic interface: tan(c) grows without bound; the regrouping at the
    values holds.
    """
    robot = load_robot("haptic")
    special = replace(robot, constants={**robot.constants, "c": math.pi / 2})
    certificate = certify(regrouping(special))
    assert not certificate.valid
    assert (
        "divides by cos(c), which is zero at c = 1.5708" in certificate.failures[-1]
        and "--at-values" in certificate.failures[-1]
    )
    with pytest.raises(SymgenError, match=r"cos\(c\), which is zero at c = 1.5708.*--at-values"):
        certified_files(special)
    found = regrouping(at_values(special))
    assert certify(found).valid and not found.robot.constants


def test_lengths_too_far_apart_are_told() -> None:
    certificate = certify(regrouping(arm("0 0 q1 0", "pi/2 0.3 q2 1e-9", "0 1e6 q3 0")))
    text = "between 1e-09 m (0.000000001, frame 2) and 1e+06 m (1000000, frame 3) lie too far apart"
    assert not certificate.valid and text in certificate.failures[-1]


def test_constants_become_their_decimals() -> None:
    assert exact(0.4318) == Expression.number("0.4318") and exact(
        1.5707963267948966, angle=True
    ) == Expression.symbol("pi") * Fraction(1, 2)
    assert exact(0.5, angle=True) == Expression.number("0.5")


def perturbed(found: Regrouping, rng: np.random.Generator) -> list[Regrouping]:
    """One coefficient changed a little, one sign turned, one base parameter left out."""
    changes = []
    places = [
        (k, name) for k, b in enumerate(found.base) for name in b.combination if name != b.own
    ]
    if places:
        k, name = places[int(rng.integers(len(places)))]
        b = found.base[k]
        for c in (b.combination[name] + Expression.number("0.001"), -b.combination[name]):
            wrong = BaseParameter(b.name, b.own, {**b.combination, name: c})
            changes.append(replace(found, base=(*found.base[:k], wrong, *found.base[k + 1 :])))
    k = int(rng.integers(len(found.base)))
    return [*changes, replace(found, base=(*found.base[:k], *found.base[k + 1 :]))]


def campaign_of(seeds: range) -> list[tuple[int, float, Certificate]]:
    """Every robot certified with its module, every perturbation refused; (seed, processor time,
    certificate).
    """
    results = []
    for seed in seeds:
        start = time.process_time()
        robot = numeric_robot(seed)
        found = regrouping(robot)
        certificate = certify(found)
        spent = time.process_time() - start
        assert certificate.valid, (seed, str(certificate))
        assert max(certificate.errors.values()) < 1e-9, (seed, certificate.errors)
        assert spent < SLOWEST, (seed, spent)
        for wrong in perturbed(found, np.random.default_rng(seed)):
            assert not certify_formulas(wrong).valid, (seed, [b.formula for b in wrong.base])
        results.append((seed, spent, certificate))
    return results


def test_random_robots_with_numbers() -> None:
    campaign_of(range(3))


@campaign
@pytest.mark.parametrize("start", range(0, 2000 if FULL else 100, 20))
def test_many_random_robots_with_numbers(start: int) -> None:
    results = campaign_of(range(1000 + start, 1020 + start))
    exact = sum(bool(certificate.primes) for _, _, certificate in results)
    print(
        f"seeds {start}: {exact} of {len(results)} exact, slowest "
        f"{max(t for _, t, _ in results):.1f} s"
    )


@pytest.mark.parametrize("seed", [1257, 2035, 1554, 2099, 2374])
@some(2)
def test_coefficients_of_many_numbers_and_angles_are_recognised(seed: int) -> None:
    """Gears as factors; angles whose cosines are polynomials of each other."""
    assert regrouping(numeric_robot(seed)).method == EXACT


def test_the_mix() -> None:
    shares = describe_numbers(numeric_robot(seed) for seed in range(60))
    print(", ".join(f"{name} {share:.0%}" for name, share in shares.items()))
    assert all(share > 0.03 for share in shares.values()), shares
