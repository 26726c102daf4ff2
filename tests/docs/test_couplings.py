"""The example of couplings: what the coupled drives of the measured TX40 explain."""

import couplings
from campaign import campaign

from symgen import demo as tx40


@campaign
def test_leaving_the_coupling_out_ruins_joint_5(tx40_data) -> None:
    """Which the total hides."""
    fits = couplings.coupling_fits(tx40.prepare(quick=False))
    error = {key: [joint.relative_error for joint in fit.per_joint] for key, fit in fits.items()}
    assert set(error) == {"both", "position", "torque", "none"}
    assert all(error[key][4] > 1.25 * error["both"][4] for key in ("position", "torque", "none"))
    assert fits["none"].relative_error < fits["both"].relative_error
    assert "position alone" in couplings.coupling_table(fits).to_text()
