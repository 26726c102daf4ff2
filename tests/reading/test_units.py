"""Units at the border: what the table says is what pint says, texts are checked before pint sees
them, and figures come out in SI.
"""

import subprocess
import sys
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pint
import pytest
from campaign import some
from hypothesis import given
from hypothesis import strategies as st

from runtime import read_record
from runtime.ground.errors import InputError, SettingsError
from runtime.reading.units import GRAMMAR, SI, TABLE, position_unit, speed, time_unit, torque_unit
from runtime.study import study_from_mapping

OURS = {"counts", "count", "°", "Nm", "mNm", "rev"}


@pytest.mark.parametrize("name", [name for name in TABLE if name not in OURS])
@some(4)
def test_table_is_that_of_pint(name):
    kind, factor = TABLE[name]
    assert (
        float(
            pint.UnitRegistry(non_int_type=Fraction)
            .Quantity(Fraction(1), name)
            .to(SI[kind])
            .magnitude
        )
        == factor
    )


@pytest.mark.parametrize(
    ("read", "name", "kind", "factor"),
    [
        (position_unit, "degree", "angle", np.pi / 180),
        (position_unit, "turn", "angle", 2 * np.pi),
        (position_unit, "mrad", "angle", 1e-3),
        (position_unit, "inch", "length", 0.0254),
        (position_unit, "cm", "length", 0.01),
        (torque_unit, "mN*m", "torque", 1e-3),
        (torque_unit, "N·m", "torque", 1.0),
        (torque_unit, "N m", "torque", 1.0),
        (torque_unit, "kgf*cm", "torque", 0.0980665),
        (torque_unit, "lbf*ft", "torque", 1.3558179483314004),
        (torque_unit, "ozf*inch", "torque", 0.00706155181422604375),
        (torque_unit, "lbf", "force", 4.4482216152605),
        (torque_unit, "kA", "current", 1e3),
        (torque_unit, "mV", "voltage", 1e-3),
        (lambda text: ("time", time_unit(text)), "µs", "time", 1e-6),
        (lambda text: ("time", time_unit(text)), "minute", "time", 60.0),
    ],
)
def test_units_of_pint(read, name, kind, factor):
    """Definitions of the pound and the inch: BIPM and NIST SP 811, appendix B."""
    found = read(name)
    assert found[0] == kind and found[1] == pytest.approx(factor, rel=2e-16)


@pytest.mark.parametrize(
    ("read", "text", "said"),
    [
        (position_unit, "grad/s", "such as rad, deg, rev"),
        (position_unit, "percent", "not a unit known here"),
        (position_unit, "grad", "write gon or deg"),
        (
            position_unit,
            "Grad",
            (
                "one 'Grad' is 1e+09 radian, which is too large a unit for a robot; expected units such as "
                "rad, deg"
            ),
        ),
        (
            torque_unit,
            "%",
            "'%' is a share of a rated value that is not given; write the unit",
        ),
        (torque_unit, "MA", "'MA' is 1e+06 ampere"),
        (position_unit, "s", "is a unit of time"),
        (
            torque_unit,
            "deg",
            "is a unit of angle; expected one of torque, force, current, voltage, such as N*m",
        ),
        (torque_unit, "N*m/rad", "not a unit known here"),
        (torque_unit, "nm", "is a unit of length"),
        (time_unit, "Hz", "such as s, ms, us, ns"),
        (position_unit, "", "such as rad"),
        (position_unit, "10**10**10", "such as rad"),
        (position_unit, "rad**4**4", "such as rad"),
        (position_unit, "__import__('os').system('true')", "such as rad"),
        (position_unit, "a" * 10_000, "such as rad"),
        (position_unit, "(" * 30, "such as rad"),
        (position_unit, "degC", "such as rad"),
    ],
)
def test_refused(read, text, said):
    with pytest.raises(InputError) as e:
        read(text)
    assert said in str(e.value) and len(str(e.value)) < 300


@given(st.text(alphabet="radegNmAVs*/·^°µ_ 0129.()-", max_size=45))
def test_any_text_is_a_unit_or_an_error(text):
    for read in (position_unit, torque_unit, time_unit, speed):
        try:
            read(text)
        except InputError as e:
            assert "such as" in str(e)


def test_grammar_has_no_numbers_calls_or_large_powers():
    for text in ("2*m", "m(2)", "m**5", "m**22", "m.real", "m;m", "m\nm", "1/s"):
        assert not GRAMMAR.fullmatch(text)


def test_study_units_name_the_key():
    with pytest.raises(SettingsError, match=r"record\.units\.tau: 'deg' is a unit of angle"):
        study_from_mapping({"record": {"units": {"tau": "deg"}}})
    with pytest.raises(SettingsError, match=r"record\.units\.q\[1\]: 'degz' is not a unit"):
        study_from_mapping({"record": {"units": {"q": ["deg", "degz"]}}})
    with pytest.raises(SettingsError, match="counts need this key"):
        study_from_mapping({"record": {"units": {"q": ["deg", "count"]}}})


def test_speeds():
    rows = study_from_mapping({"rows": {"low_speed": ["30 rpm", "5 deg/s", 0.1, "2*pi/60"]}}).rows
    np.testing.assert_allclose(rows.low_speed, [np.pi, np.pi / 36, 0.1, np.pi / 30], rtol=3e-16)
    assert study_from_mapping({"rows": {"low_speed": "20 mm/s"}}).rows.low_speed == 0.02
    for text, said in (
        ("30 rpmz", "'rpmz' is not a unit"),
        ("30 deg", "is a unit of angle"),
        ("1..2 rpm", "such as 30 rpm"),
    ):
        with pytest.raises(SettingsError, match=rf"rows\.low_speed: .*{said}"):
            study_from_mapping({"rows": {"low_speed": text}})


def test_degrees_and_milliampere(tmp_path):
    """A record of a drive: degrees, mA and us become rad, N m and s."""
    rng = np.random.default_rng(1)
    q, current = rng.normal(size=(2, 30, 2))
    t = np.arange(30) / 250
    np.savez(tmp_path / "a.npz", t=1e6 * t, q=np.degrees(q), i=1e3 * current)
    record = {
        "files": "a.npz",
        "columns": {"t": "t", "q": "q", "tau": "i"},
        "units": {"t": "us", "q": "degree", "tau": "mA"},
        "side": "motor",
    }
    drives = {
        "ratio": np.diag([50.0, -80.0]),
        "offset": [0.0, 0.0],
        "torque_constant": [0.06, 0.08],
    }
    robot = SimpleNamespace(NAME="arm", JOINTS=(1, 2), DRIVES=drives)
    found = read_record(study_from_mapping({"record": record}).record[0], robot, folder=tmp_path)
    np.testing.assert_allclose(found.q, q / [50, -80], rtol=1e-15)
    np.testing.assert_allclose(found.tau, current * [3.0, -6.4], rtol=1e-15)
    assert found.rate == pytest.approx(250)


def test_pint_is_loaded_only_where_it_is_needed():
    code = (
        "import sys\nfrom runtime.study import study_from_mapping\n"
        "study_from_mapping({'record': {'units': {'q': 'deg', 'tau': 'mA', 't': 'ms'}}})\n"
        "assert 'pint' not in sys.modules\n"
        "study_from_mapping({'record': {'units': {'q': 'mrad'}}})\n"
        "assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
