"""Writes reference_loops.txt: rates of the models with loops beside this file, by MuJoCo's matrices.

pip install mujoco scipy
python codegen/tests/robots/reference_loops.py

A line is a robot, a state of it by names that keeps the equations, and the rates of its velocities. Accelerations and
reactions solve `M a - J^T f = tau`, `J a = -(dJ/dt) v`, with the Jacobian J of the equations; MuJoCo's own are soft. dJ/dt
is by differences of sixth order along the motion.
"""

import pathlib

import mujoco
import numpy as np

here = pathlib.Path(__file__).parent
rng = np.random.default_rng(41)
FREE, BALL = 0, 1
lines = []


def word(name):
    return "".join(c if c.isalnum() else "_" for c in name)


def rows(model, data):
    """Residuals and Jacobian of the equations."""
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        raise SystemExit("the Jacobian is sparse")
    jacobian[:] = data.efc_J.reshape(data.nefc, model.nv)
    kept = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    return data.efc_pos[kept].copy(), jacobian[kept]


def moved(model, q, v, h):
    q = q.copy()
    mujoco.mj_integratePos(model, q, v, h)
    return q


texts = {robot: (here / f"{robot}.xml").read_text() for robot in ["linkage", "hopper", "wrist", "gate"]}
# The gate with an oblique axis through the first point.
latch = texts["gate"].replace('"0.4 0.3 0.1"', '"0.4 0.3 0.2"').replace('"-0.1 0.1 0.2"', '"-0.1 0.1 0.3"')
for robot, text in [*texts.items(), ("latch", latch)]:
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    data = mujoco.MjData(model)
    for _ in range(4):
        data.qvel[:] = 0
        data.qpos[:] = moved(model, model.qpos0, 0.2 * rng.uniform(-1, 1, model.nv), 1.0)
        for _ in range(60):
            residual, jacobian = rows(model, data)
            data.qpos[:] = moved(model, data.qpos, -np.linalg.lstsq(jacobian, residual, rcond=1e-9)[0], 1.0)
        assert abs(residual).max() < 1e-13, (robot, residual)
        q, (_, jacobian) = data.qpos.copy(), rows(model, data)
        v = rng.uniform(-1, 1, model.nv)
        v -= np.linalg.lstsq(jacobian, jacobian @ v, rcond=1e-9)[0]
        drift, h = np.zeros(len(jacobian)), 2e-3
        for k, weight in zip([1, 2, 3], [3 / 4, -3 / 20, 1 / 60]):
            for sign in [1, -1]:
                data.qpos[:] = moved(model, q, v, sign * k * h)
                drift += sign * weight / h * rows(model, data)[1] @ v
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        for k, unit in enumerate(np.eye(model.nv)):
            mujoco.mj_mulM(model, data, mass[k], unit)
        free = np.linalg.solve(mass, data.qfrc_smooth)
        response = np.linalg.solve(mass, jacobian.T)
        force = np.linalg.lstsq(jacobian @ response, -drift - jacobian @ free, rcond=1e-9)[0]
        a = free + response @ force
        state, rates = {}, {}
        for j, kind in enumerate(model.jnt_type):
            at, k = model.jnt_qposadr[j], model.jnt_dofadr[j]
            name = word(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) or "free")
            if kind not in (FREE, BALL):
                state[name], state[f"{name}_dot"], rates[f"{name}_dot"] = q[at], v[k], a[k]
                continue
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, q[at + (3 if kind == FREE else 0) :][:4])
            turn = turn.reshape(3, 3)
            if kind == BALL:
                for i in range(3):
                    state |= {f"{name}{i + 1}{n + 1}": turn[i, n] for n in range(3)}
                    state[f"{name}_rate{i + 1}"], rates[f"{name}_rate{i + 1}"] = v[k + i], a[k + i]
                continue
            spin, velocity = v[k + 3 : k + 6], turn.T @ v[k : k + 3]
            forward = turn.T @ a[k : k + 3] - np.cross(spin, velocity)
            up = -model.opt.gravity / np.linalg.norm(model.opt.gravity)
            for i in range(3):
                state[f"Omega{i + 1}"], rates[f"Omega{i + 1}"] = spin[i], a[k + 3 + i]
                state[f"V{i + 1}"], rates[f"V{i + 1}"] = velocity[i], forward[i]
                state[f"up{i + 1}"] = (turn.T @ up)[i]
            state["height"] = q[at : at + 3] @ up
        told = [" ".join(f"{key}={float(value)!r}" for key, value in values.items()) for values in (state, rates)]
        lines.append(f"{robot} | {told[0]} | {told[1]}")
(here / "reference_loops.txt").write_text("\n".join(lines) + "\n")
