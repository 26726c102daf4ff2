"""What the coupling of the drives of the TX40 explains: the same record as if the drives were
coupled in position and torque, in one of them, or in none. `python couplings.py` prints the
table. Needs the measured record.

Motor 6 also turns with joint 5. Leaving that out changes the total little, it may even look better;
joint 5 tells.
"""

from __future__ import annotations

from dataclasses import replace

import runtime
from runtime import Estimate, Record
from runtime.core.drives import Coupling, Drives
from runtime.ground.table import Table, number
from symgen.demo import Prepared, prepare

COUPLINGS: dict[Coupling, str] = {
    "both": "position and torque (used where the settings say so)",
    "position": "position alone",
    "torque": "torque alone",
    "none": "none",
}


def main() -> None:
    """Print the table."""
    prepared = prepare(quick=False)
    if prepared.note:
        raise SystemExit(prepared.note)
    print(coupling_table(coupling_fits(prepared)).to_text())


def coupling_fits(prepared: Prepared) -> dict[Coupling, Estimate]:
    """Estimates of all parameters by the coupling used; `prepared` is read with both."""
    drives = Drives.from_mapping(prepared.model.DRIVES)
    fits = {}
    for coupling in COUPLINGS:
        record = recoupled(prepared.record, drives, drives.decoupled(coupling))
        fits[coupling] = runtime.estimate(prepared.model, record, prepared.study)
    return fits


def recoupled(record: Record, used: Drives, wanted: Drives) -> Record:
    """The record as the drives `wanted` would have turned its motor side into the joint side;
    `used` are those it was read with.
    """
    q = wanted.joint_position(used.motor_position(record.q))
    tau = wanted.joint_torque(used.motor_command(record.tau))
    return record.moved(q, tau=tau, origin=replace(record.origin, drives=wanted))


def coupling_table(fits: dict[Coupling, Estimate]) -> Table:
    """Errors in total and by joint."""
    joints = [joint.joint for joint in fits["both"].per_joint]
    rows = []
    for coupling, fit in fits.items():
        errors = (fit.relative_error, *(joint.relative_error for joint in fit.per_joint))
        rows.append((COUPLINGS[coupling], *(number(error, ".2f") for error in errors)))
    header = ("coupling used in", "total", *(f"joint {j}" for j in joints))
    return Table("Relative error of all parameters, %", header, rows)


if __name__ == "__main__":
    main()
