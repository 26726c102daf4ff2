"""mujoco's sysid (wheel 4.0.0, `mujoco[sysid]`): windows of the record are simulated from measured
states under measured torques, positions and velocities compared, by its own optimiser.

Masses and centres of bodies within its bounds around the robot file, inertias in proportion to the
mass, which is its default (its pseudo-inertias of several bodies of a URDF stop with "mass and
inertia of moving bodies must be larger than mjMINVAL"); rotors, viscous and dry friction.
"""

from functools import partial

import mujoco
import numpy as np
from mujoco import sysid
from scipy.signal import butter, sosfiltfilt

STEP, LENGTH, WINDOWS = 0.004, 40, 15


def model_of(job):
    spec = mujoco.MjSpec.from_file(job.urdf)
    spec.option.gravity = job.gravity
    spec.option.timestep = STEP
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-3  # a body that is a mass alone
    spec.option.disableflags |= (
        mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    )
    for joint in spec.joints:
        kinds = {"pos": mujoco.mjtSensor.mjSENS_JOINTPOS, "vel": mujoco.mjtSensor.mjSENS_JOINTVEL}
        motor = spec.add_actuator(name=f"{joint.name}_motor", target=joint.name)
        motor.trntype, joint.actfrclimited = mujoco.mjtTrn.mjTRN_JOINT, False
        for end, kind in kinds.items():
            spec.add_sensor(
                name=f"{joint.name}_{end}",
                type=kind,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                objname=joint.name,
            )
    return spec


def changed(spec, param, name, key):
    joint = spec.joint(name)
    if key == "damping":
        joint.damping[0] = param.value[0]
    else:
        setattr(joint, key, param.value[0])


def parameters(spec, size):
    model, params = spec.compile(), sysid.ParameterDict()
    for body in spec.bodies[1:]:
        if body.joints:
            param = sysid.body_inertia_param(spec, model, body.name, scale_rot_inertia=True)
            params.add(param)
    for joint, most in zip(spec.joints, size, strict=True):
        for key in ("armature", "damping", "frictionloss"):
            modifier = partial(changed, name=joint.name, key=key)
            params.add(
                sysid.Parameter(f"{joint.name}_{key}", 0.05 * most, 0.0, most, modifier=modifier)
            )
    return params


def windows(job, spec):
    model, found = spec.compile(), []
    ends = np.cumsum(job.lengths)[:-1]
    pieces = list(zip(*(np.split(x, ends) for x in (job.t, job.raw_q, job.raw_tau)), strict=True))
    for t, q, tau in pieces:
        sos = butter(4, job.cutoff, fs=(len(t) - 1) / (t[-1] - t[0]), output="sos")
        q, tau = (sosfiltfilt(sos, x, axis=0) for x in (q, tau))
        grid = np.arange(t[0], t[-1], STEP)
        states = np.hstack([q, np.gradient(q, t, axis=0), tau])
        states = np.stack([np.interp(grid, t, x) for x in states.T], axis=1)
        n, times = q.shape[1], np.arange(LENGTH) * STEP
        for k in np.linspace(25, len(grid) - LENGTH - 25, max(WINDOWS // len(pieces), 1)).astype(
            int
        ):
            own = states[k : k + LENGTH]
            sensors = np.stack([own[:, :n], own[:, n : 2 * n]], axis=2).reshape(LENGTH, 2 * n)
            found.append(
                sysid.ModelSequences(
                    "robot", spec, f"window{len(found)}",
                    sysid.create_initial_state(model, own[0, :n], own[0, n : 2 * n], np.zeros(0)),
                    sysid.TimeSeries(times, own[:, 2 * n :]),
                    sysid.TimeSeries.from_names(times, sensors, model),
                )
            )  # fmt: skip
    return found


def fit(job):
    spec = model_of(job)
    params = parameters(spec, np.abs(job.tau).max(axis=0))
    residual = sysid.build_residual_fn(models_sequences=windows(job, spec), n_threads=1)
    params, _ = sysid.optimize(params, residual, verbose=False, max_iters=10)
    for param in params.values():
        param.apply_modifier(spec)
    model = spec.compile()
    loss = model.dof_frictionloss.copy()
    model.dof_frictionloss[:] = 0
    data = mujoco.MjData(model)

    def predict(q, qd, qdd):
        tau = np.empty_like(q)
        for k in range(len(q)):
            data.qpos, data.qvel, data.qacc = q[k], qd[k], qdd[k]
            mujoco.mj_inverse(model, data)
            tau[k] = data.qfrc_inverse + loss * np.sign(qd[k])
        return tau

    return predict, {}
